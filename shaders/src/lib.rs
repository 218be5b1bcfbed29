//! The WGSL of Volery: validated when it is built, and described for Rust so that nothing is written twice.
//!
//! # Method
//! The build script runs every file under `src/wgsl` through naga. An error fails the build. From what naga
//! found it writes a Rust module per shader: the text, `#[repr(C)]` structs of the buffers with the shader's
//! own field names, constants, entry points, workgroup sizes and bindings with the stages that use them. The compiler checks the structs' sizes and
//! offsets against naga's, so the two sides cannot drift.
//!
//! # Non-goals
//! No wgpu: [`Binding`] says in words of its own what a resource is, and who executes shaders makes layouts
//! of that. No preprocessor but `// import NAME`, which adds `src/wgsl/parts/NAME.wgsl`.

/// A resource that a shader binds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binding {
    /// The variable's name in the shader.
    pub name: &'static str,
    /// Bind group.
    pub group: u32,
    /// Index in the group.
    pub binding: u32,
    /// Where it is used.
    pub stages: Stages,
    /// What it is.
    pub kind: BindingKind,
}

/// Stages of pipelines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stages {
    /// The vertex stage of a render pipeline.
    pub vertex: bool,
    /// The fragment stage of a render pipeline.
    pub fragment: bool,
    /// A compute pipeline.
    pub compute: bool,
}

/// What a resource is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    /// A uniform buffer.
    Uniform {
        /// Bytes that the shader reads.
        bytes: u32,
    },
    /// A storage buffer.
    Storage {
        /// Whether the shader only reads it.
        read_only: bool,
    },
    /// A texture that is read, not filtered.
    Texture {
        /// Its shape.
        dimension: Dimension,
        /// What it holds.
        texel: TexelKind,
    },
    /// A sampler.
    Sampler,
}

/// The shape of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// 2D.
    D2,
    /// Layers of 2D.
    D2Array,
    /// 3D.
    D3,
}

/// What a texture's texels are to the shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexelKind {
    /// Floats, or integers read as fractions.
    Float,
    /// Unsigned integers.
    Uint,
}

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
