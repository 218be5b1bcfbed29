//! Cells of several types around a cylinder.

use std::f64::consts::PI;

use glam::DVec3;
use volery_scene::{CellType, Cells, UnstructuredGrid};

/// Radius of the cylinder in [`cylinder`]; its axis is that of z.
pub const CYLINDER_RADIUS: f64 = 0.25;
/// Radius of the domain around it.
const OUTER_RADIUS: f64 = 1.5;
/// Its extent along z, from 0 on.
const HEIGHT: f64 = 1.5;

/// Potential flow of speed 1 along x around a cylinder of radius `a` and axis z, the square of its speed `q`, fading
/// along the axis: `q (1 + cos(π z / h)) / 2`, `q = 1 - 2 (a/r)² cos 2θ + (a/r)⁴`, in [0, 4].
pub fn cylinder_at(point: DVec3) -> f64 {
    let across = point.truncate();
    let share = CYLINDER_RADIUS.powi(2) / across.length_squared();
    let angle = across.y.atan2(across.x);
    let squared_speed = 1.0 - 2.0 * share * (2.0 * angle).cos() + share * share;
    squared_speed * (1.0 + (PI * point.z / HEIGHT).cos()) / 2.0
}

/// The field of [`cylinder_at`] under the name `speed2`, as f32, on a grid around the cylinder: `n` layers of wedges,
/// `n` of hexahedra, one of pyramids and tetrahedra, each `4 n` cells around and `n` along the axis. Radii grow
/// geometrically. All faces are planar and fit; faces of four nodes that meet triangles are split at their lowest node.
///
/// # Panics
/// When `n` is 0.
pub fn cylinder(n: usize) -> UnstructuredGrid {
    let lattice = Lattice { around: 4 * n, layers: 2 * n + 1, along: n };
    let mut points = lattice.points();
    let (mut types, mut nodes) = (Vec::new(), Vec::new());
    let mut add = |cell_type: CellType, cell: &[u32]| {
        types.push(cell_type);
        nodes.extend_from_slice(cell);
    };
    for step in 0..lattice.along {
        for layer in 0..lattice.layers {
            for sector in 0..lattice.around {
                let corners = lattice.corners([sector, layer, step]);
                if layer < n {
                    wedges(corners).iter().for_each(|wedge| add(CellType::Wedge, wedge));
                } else if layer < 2 * n {
                    add(CellType::Hexahedron, &corners);
                } else {
                    let middle = corners.iter().map(|&corner| points[corner as usize]).sum::<DVec3>() / 8.0;
                    // A few thousand points for any grid that is small.
                    let apex = points.len() as u32;
                    points.push(middle);
                    around_apex(corners, apex, &mut add);
                }
            }
        }
    }
    let values: Vec<f32> = points.iter().map(|&point| cylinder_at(point) as f32).collect();
    let cells = Cells::new(types, nodes).expect("every cell has the nodes of its type");
    let grid = UnstructuredGrid::new(points, cells).expect("every node is a point");
    grid.with_array("speed2", values).expect("one value per point")
}

/// Numbers of cells around the axis, away from it and along it.
struct Lattice {
    around: usize,
    layers: usize,
    along: usize,
}

impl Lattice {
    fn points(&self) -> Vec<DVec3> {
        let mut points = Vec::new();
        for step in 0..=self.along {
            for layer in 0..=self.layers {
                let share = layer as f64 / self.layers as f64;
                let radius = CYLINDER_RADIUS * (OUTER_RADIUS / CYLINDER_RADIUS).powf(share);
                points.extend((0..self.around).map(|sector| {
                    let (sine, cosine) = (2.0 * PI * sector as f64 / self.around as f64).sin_cos();
                    DVec3::new(radius * cosine, radius * sine, HEIGHT * step as f64 / self.along as f64)
                }));
            }
        }
        points
    }

    /// The nodes of a cell in VTK's order of hexahedra: outwards, around, along the axis.
    fn corners(&self, [sector, layer, step]: [usize; 3]) -> [u32; 8] {
        let node = |outer: usize, next: usize, up: usize| {
            let row = (step + up) * (self.layers + 1) + layer + outer;
            (row * self.around + (sector + next) % self.around) as u32
        };
        let ring = |up: usize| [node(0, 0, up), node(1, 0, up), node(1, 1, up), node(0, 1, up)];
        let ([a, b, c, d], [e, f, g, h]) = (ring(0), ring(1));
        [a, b, c, d, e, f, g, h]
    }
}

/// A hexahedron as two wedges, cut along the axis from its lowest node.
fn wedges(corners: [u32; 8]) -> [[u32; 6]; 2] {
    let lowest = (0..4).min_by_key(|&place| corners[place]).unwrap_or(0);
    [1, 2].map(|next| {
        let [a, b, c] = [0, next, next + 1].map(|turn| (lowest + turn) % 4);
        [a, b, c, a + 4, b + 4, c + 4].map(|place| corners[place])
    })
}

/// A hexahedron as a pyramid over its inner face and two tetrahedra over each of the others.
fn around_apex(corners: [u32; 8], apex: u32, add: &mut impl FnMut(CellType, &[u32])) {
    // By the right hand they point out of the cell; the first is the one at the hexahedra.
    const FACES: [[usize; 4]; 6] =
        [[0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]];
    for (number, face) in FACES.into_iter().enumerate() {
        let [a, b, c, d] = face.map(|place| corners[place]);
        let inward = [d, c, b, a];
        if number == 0 {
            let [a, b, c, d] = inward;
            add(CellType::Pyramid, &[a, b, c, d, apex]);
            continue;
        }
        let lowest = (0..4).min_by_key(|&place| inward[place]).unwrap_or(0);
        for next in [1, 2] {
            let [a, b, c] = [0, next, next + 1].map(|turn| inward[(lowest + turn) % 4]);
            add(CellType::Tetrahedron, &[a, b, c, apex]);
        }
    }
}
