//! Reading opaque surfaces: `.obj`, `.gltf` and `.glb`, as triangles of one colour.
//!
//! # Method
//! Every triangle of a file becomes one of the mesh, at the place that the scene of the file gives it; polygons are
//! cut into triangles. What is no surface (points, lines, free-form curves) is counted in the notes, as are skins and
//! morph targets, whose rest pose is drawn. Materials, colours, normals and textures of the file are not used.
//! Coordinates are the file's own: no axis is turned up, no unit converted.

pub(crate) mod gltf;
mod obj;
mod polygon;

use std::path::Path;

use glam::DVec3;
use volery_scene::TriangleMesh;

use crate::bytes::load;
use crate::error::{Problem, ReadError};
use crate::volume::lower_name;

/// Limit of a mesh in memory where nobody says otherwise: 4 GiB.
pub const MAX_MESH_BYTES: u64 = 4 << 30;

/// A mesh as read.
#[derive(Clone, Debug)]
pub struct MeshFile {
    /// Its triangles.
    pub mesh: TriangleMesh,
    /// What the reader left out, a sentence each.
    pub notes: Vec<String>,
}

/// Reads a mesh from a file, to be shown in one linear RGB colour. `max_bytes` limits the file, the files that it
/// names, and the points and triangles; the reader itself may need a small multiple.
///
/// # Errors
/// When the file or one that it names cannot be read, is damaged, is larger than allowed, has no triangle or is of
/// another kind, or the colour is none.
pub fn read_mesh(path: &Path, color: [f64; 3], max_bytes: u64) -> Result<MeshFile, ReadError> {
    let fail = |problem| ReadError { path: path.to_owned(), problem };
    let surface = read(path, max_bytes).map_err(fail)?;
    let Surface { points, triangles, notes, .. } = surface;
    if triangles.is_empty() {
        let found = if notes.is_empty() { "none".to_owned() } else { format!("none ({})", notes.join("; ")) };
        return Err(fail(Problem::field("number of triangles", found, "at least 1")));
    }
    let mesh = TriangleMesh::new(points, triangles, color).map_err(|error| fail(Problem::Mesh(error)))?;
    Ok(MeshFile { mesh, notes })
}

fn read(path: &Path, max_bytes: u64) -> Result<Surface, Problem> {
    let name = lower_name(path);
    let is_obj = name.ends_with(".obj");
    if !is_obj && !name.ends_with(".gltf") && !name.ends_with(".glb") {
        return Err(Problem::field("ending of the name", name, ".obj, .gltf or .glb"));
    }
    let bytes = load(path)?;
    let mut surface = Surface { max_bytes, ..Surface::default() };
    surface.check("size of the file", bytes.len() as u64)?;
    if is_obj {
        obj::read(&bytes, &mut surface)?;
    } else {
        gltf::read(path, &bytes, &mut surface)?;
    }
    Ok(surface)
}

/// What has been read.
#[derive(Default)]
struct Surface {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    notes: Vec<String>,
    max_bytes: u64,
}

impl Surface {
    fn check(&self, what: &str, bytes: u64) -> Result<(), Problem> {
        if bytes <= self.max_bytes {
            return Ok(());
        }
        Err(Problem::field(what, format!("{bytes} bytes"), format!("at most {}", self.max_bytes)))
    }

    /// Makes room for so many points and triangles more.
    fn reserve(&mut self, num_points: u64, num_triangles: u64) -> Result<(), Problem> {
        let bytes = |held: usize, more: u64, each: usize| {
            (held as u64).saturating_add(more).saturating_mul(each as u64)
        };
        let points = bytes(self.points.len(), num_points, size_of::<DVec3>());
        let triangles = bytes(self.triangles.len(), num_triangles, size_of::<[u32; 3]>());
        self.check("size of the mesh", points.saturating_add(triangles))?;
        if self.points.len() as u64 + num_points > u64::from(u32::MAX) {
            return Err(Problem::field("number of points", num_points, "below 2^32 in all"));
        }
        let no_memory = |_| Problem::field("size of the mesh", "more than there is memory", "less");
        // In range: both are below the limit.
        self.points.try_reserve(num_points as usize).map_err(no_memory)?;
        self.triangles.try_reserve(num_triangles as usize).map_err(no_memory)
    }

    /// Notes what is left out, if there is any of it.
    fn leave_out(&mut self, count: u64, [one, many]: [&str; 2], why: &str) {
        if count > 0 {
            self.notes.push(format!("{count} {} {why}", if count == 1 { one } else { many }));
        }
    }
}
