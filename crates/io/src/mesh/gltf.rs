//! glTF 2.0, as text with buffers beside it or as one binary file, by the types of crate `gltf`.
//!
//! Numbers of things that a file names are looked up, never trusted. Nodes are visited once each, without recursion.
//! Positions may be integers, as KHR_mesh_quantization has them; accessors may be sparse.

mod accessor;
mod buffers;

use std::path::Path;

use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;
use ::gltf::json::{Node, Root};
use glam::{DMat4, DQuat, DVec3};

use super::Surface;
use crate::error::{Problem, quoted};
use accessor::Accessors;
use buffers::Buffers;

/// First bytes of a binary file.
const MAGIC: &[u8] = b"glTF";

/// Extensions that a file may require: what they change is no shape, or is read.
const HARMLESS: [&str; 4] =
    ["KHR_mesh_quantization", "KHR_materials_", "KHR_texture_", "KHR_lights_punctual"];

pub(super) fn read(path: &Path, bytes: &[u8], surface: &mut Surface) -> Result<(), Problem> {
    let (text, blob) = if bytes.starts_with(MAGIC) { chunks(bytes)? } else { (bytes, None) };
    let root: Root =
        ::gltf::json::deserialize::from_slice(text).map_err(|error| Problem::damaged("the JSON", error))?;
    let is_harmless = |name: &String| HARMLESS.iter().any(|known| name.starts_with(known));
    if let Some(found) = root.extensions_required.iter().find(|name| !is_harmless(name)) {
        return Err(Problem::field(
            "extensionsRequired",
            quoted(found),
            "none that changes shapes but KHR_mesh_quantization",
        ));
    }
    let buffers = Buffers::open(path, &root, blob, surface.max_bytes)?;
    let accessors = Accessors { root: &root, buffers: &buffers };
    let mut shapes: Vec<Option<Shape>> = root.meshes.iter().map(|_| None).collect();
    let mut counts = Counts::default();
    // What shapes hold beside what the surface does; the limit is for both.
    let mut held = Surface { max_bytes: surface.max_bytes, ..Surface::default() };
    for (index, world_from_node) in placed_nodes(&root)? {
        let Some(node) = root.nodes.get(index) else { continue };
        let Some(mesh) = node.mesh else { continue };
        let Some(shape) = shapes.get_mut(mesh.value()) else {
            return Err(Problem::field(
                format!("node {index}: mesh"),
                mesh.value(),
                format!("below {}", root.meshes.len()),
            ));
        };
        if shape.is_none() {
            let of_mesh = |problem: Problem| problem.of_array(format!("mesh {}", mesh.value()));
            *shape = Some(Shape::read(&accessors, mesh.value(), &mut held, &mut counts).map_err(of_mesh)?);
        }
        let Some(shape) = shape else { continue };
        counts.skinned += u64::from(node.skin.is_some());
        surface.reserve(shape.num_points as u64, shape.num_triangles as u64)?;
        let first = surface.points.len() as u32;
        let points = &held.points[shape.first_point..][..shape.num_points];
        let triangles = &held.triangles[shape.first_triangle..][..shape.num_triangles];
        surface.points.extend(points.iter().map(|&point| world_from_node.transform_point3(point)));
        surface.triangles.extend(triangles.iter().map(|triangle| triangle.map(|corner| first + corner)));
    }
    surface.leave_out(counts.points, ["set of points", "sets of points"], "left out: no surface");
    surface.leave_out(counts.lines, ["set of lines", "sets of lines"], "left out: no surface");
    surface.leave_out(counts.morphed, ["morph", "morphs"], "left out: rest shapes are shown");
    surface.leave_out(counts.skinned, ["skin", "skins"], "left out: rest shapes are shown");
    Ok(())
}

/// The text and the binary part of a binary file.
pub(crate) fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), Problem> {
    let word = |at: usize| -> Result<u32, Problem> {
        let word = bytes.get(at..).and_then(|rest| rest.first_chunk::<4>());
        word.map(|word| u32::from_le_bytes(*word)).ok_or(Problem::Size {
            what: "the file",
            found: bytes.len() as u64,
            expected: at as u64 + 4,
        })
    };
    let version = word(4)?;
    if version != 2 {
        return Err(Problem::field("version", version, "2"));
    }
    let chunk = |at: usize| -> Result<(&[u8], u32, usize), Problem> {
        let (length, kind) = (word(at)?, word(at + 4)?);
        let end = at as u64 + 8 + u64::from(length);
        let content = usize::try_from(end).ok().and_then(|end| bytes.get(at + 8..end));
        let content =
            content.ok_or(Problem::Size { what: "the file", found: bytes.len() as u64, expected: end })?;
        Ok((content, kind, (at + 8 + content.len()).next_multiple_of(4)))
    };
    let (text, kind, mut at) = chunk(12)?;
    if kind != u32::from_le_bytes(*b"JSON") {
        return Err(Problem::field("first chunk", format!("{kind:#010x}"), "JSON"));
    }
    // Chunks of other kinds are to be passed over.
    while at < bytes.len() {
        let (content, kind, next) = chunk(at)?;
        if kind == u32::from_le_bytes(*b"BIN\0") {
            return Ok((text, Some(content)));
        }
        at = next;
    }
    Ok((text, None))
}

/// What was left out.
#[derive(Default)]
struct Counts {
    points: u64,
    lines: u64,
    morphed: u64,
    skinned: u64,
}

/// Where a mesh's own points and triangles are among those held.
struct Shape {
    first_point: usize,
    num_points: usize,
    first_triangle: usize,
    num_triangles: usize,
}

impl Shape {
    fn read(
        accessors: &Accessors<'_>,
        mesh: usize,
        held: &mut Surface,
        counts: &mut Counts,
    ) -> Result<Self, Problem> {
        let (first_point, first_triangle) = (held.points.len(), held.triangles.len());
        let primitives = accessors.root.meshes.get(mesh).map_or(&[][..], |mesh| &mesh.primitives);
        for (index, primitive) in primitives.iter().enumerate() {
            counts.morphed += primitive.targets.as_ref().map_or(0, |targets| targets.len() as u64);
            let of_primitive = |problem: Problem| problem.of_array(format!("primitive {index}"));
            match primitive.mode {
                Checked::Valid(Mode::Points) => counts.points += 1,
                Checked::Valid(Mode::Lines | Mode::LineLoop | Mode::LineStrip) => counts.lines += 1,
                Checked::Valid(mode) => {
                    add_triangles(accessors, primitive, mode, first_point, held).map_err(of_primitive)?;
                }
                Checked::Invalid => {
                    return Err(of_primitive(Problem::field("mode", "another number", "0 to 6")));
                }
            }
        }
        Ok(Self {
            first_point,
            num_points: held.points.len() - first_point,
            first_triangle,
            num_triangles: held.triangles.len() - first_triangle,
        })
    }
}

/// Adds the triangles of a primitive, whose corners are counted from the first point of their mesh.
fn add_triangles(
    accessors: &Accessors<'_>,
    primitive: &Primitive,
    mode: Mode,
    first_point: usize,
    held: &mut Surface,
) -> Result<(), Problem> {
    let Some(&positions) = primitive.attributes.get(&Checked::Valid(Semantic::Positions)) else {
        return Ok(());
    };
    let positions = accessors.find(positions)?;
    let num_points = positions.count();
    held.reserve(num_points, 0)?;
    let first = (held.points.len() - first_point) as u32;
    held.points.extend(positions.vectors()?);
    let corners = match primitive.indices {
        None => (0..num_points as u32).collect(),
        Some(indices) => {
            let indices = accessors.find(indices)?;
            held.reserve(0, indices.count())?;
            indices.indices()?
        }
    };
    if let Some(found) = corners.iter().find(|&&corner| u64::from(corner) >= num_points) {
        return Err(Problem::field("an index", found, format!("below {num_points}")));
    }
    held.reserve(0, corners.len() as u64)?;
    let triangle = |corners: [u32; 3]| corners.map(|corner| first + corner);
    match mode {
        Mode::TriangleStrip => {
            held.triangles.extend(corners.windows(3).map(|c| triangle([c[0], c[1], c[2]])))
        }
        Mode::TriangleFan => {
            held.triangles.extend(corners.windows(2).skip(1).map(|c| triangle([corners[0], c[0], c[1]])));
        }
        _ => held.triangles.extend(corners.as_chunks::<3>().0.iter().map(|&c| triangle(c))),
    }
    Ok(())
}

/// The nodes of the scene to show, each with what takes its own places to the world.
fn placed_nodes(root: &Root) -> Result<Vec<(usize, DMat4)>, Problem> {
    let scene = root.scene.map_or(0, |scene| scene.value());
    let roots: Vec<usize> = match root.scenes.get(scene) {
        Some(scene) => scene.nodes.iter().map(|node| node.value()).collect(),
        None if root.scenes.is_empty() && root.scene.is_none() => {
            let children =
                |node: &Node| node.children.iter().flatten().map(|child| child.value()).collect::<Vec<_>>();
            let mut is_child = vec![false; root.nodes.len()];
            for child in root.nodes.iter().flat_map(children) {
                is_child.get_mut(child).into_iter().for_each(|is_child| *is_child = true);
            }
            (0..root.nodes.len()).filter(|&node| !is_child[node]).collect()
        }
        None => return Err(Problem::field("scene", scene, format!("below {}", root.scenes.len()))),
    };
    let mut is_visited = vec![false; root.nodes.len()];
    let mut open: Vec<(usize, DMat4)> = roots.into_iter().rev().map(|node| (node, DMat4::IDENTITY)).collect();
    let mut placed = Vec::new();
    while let Some((index, world_from_parent)) = open.pop() {
        let Some(node) = root.nodes.get(index) else {
            return Err(Problem::field("a node", index, format!("below {}", root.nodes.len())));
        };
        if std::mem::replace(&mut is_visited[index], true) {
            return Err(Problem::field(
                format!("node {index}"),
                "a child more than once",
                "at most once: nodes are a tree",
            ));
        }
        let world_from_node = world_from_parent * parent_from_node(node);
        placed.push((index, world_from_node));
        open.extend(node.children.iter().flatten().rev().map(|child| (child.value(), world_from_node)));
    }
    Ok(placed)
}

fn parent_from_node(node: &Node) -> DMat4 {
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    let [scale, translation] = [node.scale.unwrap_or([1.0; 3]), node.translation.unwrap_or([0.0; 3])]
        .map(|vector| DVec3::from_array(vector.map(f64::from)));
    let rotation = node.rotation.unwrap_or_default().0.map(f64::from);
    DMat4::from_scale_rotation_translation(scale, DQuat::from_array(rotation), translation)
}
