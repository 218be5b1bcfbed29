//! Rust text from a shader: one module per file, with
//! - `SOURCE`, and `LABEL` for error messages;
//! - a `#[repr(C)]` struct for each struct in a uniform or storage buffer, with the shader's field names,
//!   whose size and offsets the compiler checks against naga's;
//! - each constant of a numeric type, and `NAME` of each override;
//! - `BINDINGS`, with the stages that use them;
//! - for each entry point its name, and of compute shaders the workgroup size.
//!
//! Vertices come out of buffers by their numbers: attributes of vertices are refused.

use std::fmt::Write as _;

use naga::proc::Layouter;
use naga::{
    AddressSpace, ArraySize, Binding, EntryPoint, Expression, GlobalVariable, Handle, ImageClass,
    ImageDimension, Literal, Module, Scalar, ScalarKind, ShaderStage, StorageAccess, StructMember, Type,
    TypeInner, VectorSize,
};

use crate::Shader;

/// The Rust module of one shader.
pub(crate) fn module(shader: &Shader) -> Result<String, String> {
    let module = &shader.module;
    let mut layouter = Layouter::default();
    layouter.update(module.to_ctx()).map_err(|e| format!("{}: {e}", shader.path.display()))?;
    let mut text = String::new();
    let path = shader.path.display().to_string();
    let name = &shader.name;
    text += &format!("/// `{name}.wgsl`.\npub mod {name} {{\n");
    text += &format!("/// Names the shader in messages.\npub const LABEL: &str = {name:?};\n");
    text += &format!("/// The text of the shader.\npub const SOURCE: &str = include_str!({path:?});\n");
    constants(&mut text, module);
    for (_, item) in module.overrides.iter() {
        let name = item.name.as_deref().unwrap_or_default();
        text += &format!("/// Name of an override of the shader.\npub const {name}: &str = {name:?};\n");
    }
    for ty in buffer_structs(module) {
        structure(&mut text, shader, ty)?;
    }
    bindings(&mut text, shader, &layouter)?;
    for entry in &module.entry_points {
        entry_point(&mut text, shader, entry)?;
    }
    text += "}\n";
    Ok(text)
}

fn entry_point(text: &mut String, shader: &Shader, entry: &EntryPoint) -> Result<(), String> {
    let name = &entry.name;
    let upper = name.to_uppercase();
    *text += &format!("/// Name of an entry point.\npub const {upper}: &str = {name:?};\n");
    let is_builtin = |binding: &Option<Binding>| matches!(binding, Some(Binding::BuiltIn(_)));
    match entry.stage {
        ShaderStage::Compute => {
            let [x, y, z] = entry.workgroup_size;
            *text += &format!("/// Invocations of a workgroup of [`{upper}`].\n");
            *text += &format!("pub const {upper}_WORKGROUP: [u32; 3] = [{x}, {y}, {z}];\n");
        }
        ShaderStage::Vertex if !entry.function.arguments.iter().all(|a| is_builtin(&a.binding)) => {
            let path = shader.path.display();
            return Err(format!(
                "{path}: {name}: an attribute of vertices, expected numbers of vertices only"
            ));
        }
        _ => {}
    }
    Ok(())
}

/// The stages in which entry points use a resource.
fn stages(shader: &Shader, variable: Handle<GlobalVariable>) -> String {
    let is_used_in = |stage: ShaderStage| {
        let entries = shader.module.entry_points.iter().enumerate();
        entries.into_iter().any(|(place, entry)| {
            entry.stage == stage && !shader.info.get_entry_point(place)[variable].is_empty()
        })
    };
    let [vertex, fragment, compute] =
        [ShaderStage::Vertex, ShaderStage::Fragment, ShaderStage::Compute].map(is_used_in);
    format!("crate::Stages {{ vertex: {vertex}, fragment: {fragment}, compute: {compute} }}")
}

/// The table of all shaders.
pub(crate) fn list(names: &[String]) -> String {
    let rows: String = names.iter().map(|n| format!("({n}::LABEL, {n}::SOURCE), ")).collect();
    format!("/// Name and text of every shader.\npub const ALL: &[(&str, &str)] = &[{rows}];\n")
}

fn constants(text: &mut String, module: &Module) {
    for (_, constant) in module.constants.iter() {
        let Some(name) = &constant.name else { continue };
        let Expression::Literal(value) = module.global_expressions[constant.init] else { continue };
        let (ty, value) = match value {
            Literal::F32(value) => ("f32", format!("{value:?}")),
            Literal::U32(value) => ("u32", value.to_string()),
            Literal::I32(value) => ("i32", value.to_string()),
            Literal::Bool(value) => ("bool", value.to_string()),
            _ => continue,
        };
        let _ = writeln!(text, "/// A constant of the shader.\npub const {name}: {ty} = {value};");
    }
}

/// Structs that stand directly in a buffer, each once.
fn buffer_structs(module: &Module) -> Vec<Handle<Type>> {
    let mut structs = Vec::new();
    for (_, variable) in module.global_variables.iter() {
        let is_buffer = matches!(variable.space, AddressSpace::Uniform | AddressSpace::Storage { .. });
        let ty = match module.types[variable.ty].inner {
            TypeInner::Array { base, .. } => base,
            _ => variable.ty,
        };
        let is_struct = matches!(module.types[ty].inner, TypeInner::Struct { .. });
        if is_buffer && is_struct && !structs.contains(&ty) {
            structs.push(ty);
        }
    }
    structs
}

fn structure(text: &mut String, shader: &Shader, ty: Handle<Type>) -> Result<(), String> {
    let types = &shader.module.types;
    let TypeInner::Struct { members, span } = &types[ty].inner else { return Ok(()) };
    let name = types[ty].name.as_deref().unwrap_or_default();
    let mut fields = String::new();
    let mut checks = String::new();
    let mut end = 0;
    let mut num_pads = 0;
    let mut pad = |fields: &mut String, bytes: u32| {
        if bytes > 0 {
            let _ = writeln!(fields, "/// Padding.\npub pad_{num_pads}: [u8; {bytes}],");
            num_pads += 1;
        }
    };
    for StructMember { name: field, ty, offset, .. } in members {
        let field = field.as_deref().unwrap_or_default();
        let (rust, size) = rust_type(&shader.module, *ty)
            .ok_or_else(|| format!("{}: {name}.{field}: no Rust type for it", shader.path.display()))?;
        pad(&mut fields, offset - end);
        let _ = writeln!(fields, "/// See the shader.\npub {field}: {rust},");
        let _ = writeln!(checks, "assert!(core::mem::offset_of!({name}, {field}) == {offset});");
        end = offset + size;
    }
    pad(&mut fields, span - end);
    let _ = write!(
        text,
        "/// A struct of the shader, laid out as it lies in buffers.\n\
         #[repr(C)]\n#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]\n\
         pub struct {name} {{\n{fields}}}\nconst _: () = {{\nassert!(size_of::<{name}>() == {span});\n{checks}}};\n"
    );
    Ok(())
}

/// The Rust type of the same bytes and its size, for the types that buffers of ours hold.
fn rust_type(module: &Module, ty: Handle<Type>) -> Option<(String, u32)> {
    let scalar_name = |scalar: Scalar| match scalar {
        Scalar::F32 => Some("f32"),
        Scalar::U32 => Some("u32"),
        Scalar::I32 => Some("i32"),
        _ => None,
    };
    match module.types[ty].inner {
        TypeInner::Scalar(scalar) => Some((scalar_name(scalar)?.to_owned(), 4)),
        TypeInner::Vector { size, scalar } => {
            let num = match size {
                VectorSize::Bi => 2,
                VectorSize::Tri => 3,
                VectorSize::Quad => 4,
            };
            Some((format!("[{}; {num}]", scalar_name(scalar)?), 4 * num))
        }
        TypeInner::Array { base, size: ArraySize::Constant(num), stride } => {
            let (element, size) = rust_type(module, base)?;
            (size == stride).then(|| (format!("[{element}; {num}]"), size * num.get()))
        }
        _ => None,
    }
}

fn bindings(text: &mut String, shader: &Shader, layouter: &Layouter) -> Result<(), String> {
    let module = &shader.module;
    *text += "/// What the shader's resources are, in the order of the file.\n";
    *text += "pub const BINDINGS: &[crate::Binding] = &[\n";
    for (handle, variable) in module.global_variables.iter() {
        let Some(binding) = &variable.binding else { continue };
        let name = variable.name.as_deref().unwrap_or_default();
        let size = layouter[variable.ty].size;
        let kind = match (variable.space, &module.types[variable.ty].inner) {
            (AddressSpace::Uniform, _) => format!("Uniform {{ bytes: {size} }}"),
            (AddressSpace::Storage { access }, _) => {
                format!("Storage {{ read_only: {} }}", !access.contains(StorageAccess::STORE))
            }
            (_, TypeInner::Sampler { comparison: false }) => "Sampler".to_owned(),
            (_, TypeInner::Image { dim, arrayed, class: ImageClass::Sampled { kind, multi: false } }) => {
                let dimension = match (dim, arrayed) {
                    (ImageDimension::D2, false) => "D2",
                    (ImageDimension::D2, true) => "D2Array",
                    (ImageDimension::D3, false) => "D3",
                    _ => return Err(unknown(shader, name)),
                };
                let texel = match kind {
                    ScalarKind::Float => "Float",
                    ScalarKind::Uint => "Uint",
                    _ => return Err(unknown(shader, name)),
                };
                format!(
                    "Texture {{ dimension: crate::Dimension::{dimension}, texel: crate::TexelKind::{texel} }}"
                )
            }
            _ => return Err(unknown(shader, name)),
        };
        let (group, index) = (binding.group, binding.binding);
        let stages = stages(shader, handle);
        let _ = writeln!(
            text,
            "crate::Binding {{ name: {name:?}, group: {group}, binding: {index}, stages: {stages}, \
             kind: crate::BindingKind::{kind} }},"
        );
    }
    *text += "];\n";
    Ok(())
}

fn unknown(shader: &Shader, name: &str) -> String {
    format!("{}: {name}: a kind of resource that the reflection does not know", shader.path.display())
}
