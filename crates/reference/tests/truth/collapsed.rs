//! Cells some of whose nodes are one: the field is the limit of VTK's interpolation, whichever nodes they are.

use std::cell::Cell;
use std::collections::BTreeSet;

use glam::{DMat3, DVec3};
use volery_reference::GridTracer;
use volery_scene::{CellType, Cells, Ray, TransferFunction, UnstructuredGrid};

use crate::slow::{Integrand, Random, check, difference, transfer};

/// The nodes of a type in its local coordinates, as the corners of a box, a prism and a pyramid.
fn straight(cell_type: CellType) -> Vec<DVec3> {
    let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64);
    match cell_type {
        CellType::Tetrahedron => [0, 1, 2, 4].map(corner).to_vec(),
        CellType::Pyramid => {
            [0, 1, 3, 2].map(corner).into_iter().chain([DVec3::new(0.5, 0.5, 1.0)]).collect()
        }
        CellType::Wedge => [0, 1, 2, 4, 5, 6].map(corner).to_vec(),
        CellType::Hexahedron => [0, 1, 3, 2, 4, 5, 7, 6].map(corner).to_vec(),
        CellType::Voxel => [0, 1, 2, 3, 4, 5, 6, 7].map(corner).to_vec(),
    }
}

/// VTK's shape functions.
fn weights(cell_type: CellType, p: DVec3) -> Vec<f64> {
    let DVec3 { x: r, y: s, z: t } = p;
    let corner = |i: usize| {
        let side = |bit: usize, w: f64| if i >> bit & 1 == 1 { w } else { 1.0 - w };
        side(0, r) * side(1, s) * side(2, t)
    };
    match cell_type {
        CellType::Tetrahedron => vec![1.0 - r - s - t, r, s, t],
        CellType::Pyramid => [0, 1, 3, 2].map(corner).into_iter().chain([t]).collect(),
        CellType::Wedge => {
            let u = 1.0 - r - s;
            vec![u * (1.0 - t), r * (1.0 - t), s * (1.0 - t), u * t, r * t, s * t]
        }
        CellType::Hexahedron => [0, 1, 3, 2, 4, 5, 7, 6].map(corner).to_vec(),
        CellType::Voxel => [0, 1, 2, 3, 4, 5, 6, 7].map(corner).to_vec(),
    }
}

/// Points with these coordinates along each axis.
fn lattice(steps: &[f64]) -> Vec<DVec3> {
    let each = |i: usize| [i, i / steps.len(), i / steps.len().pow(2)].map(|i| steps[i % steps.len()]);
    (0..steps.len().pow(3)).map(|i| DVec3::from_array(each(i))).collect()
}

/// A cell with some of its nodes one.
struct Collapsed {
    cell_type: CellType,
    /// Numbers of the nodes; those that are one have one.
    nodes: Vec<u32>,
    /// Of all nodes, in the cell's order.
    places: Vec<DVec3>,
    values: Vec<f64>,
}

impl Collapsed {
    fn place(&self, local: DVec3) -> DVec3 {
        weights(self.cell_type, local).iter().zip(&self.places).map(|(&w, &place)| place * w).sum()
    }

    fn slopes(&self, local: DVec3) -> DMat3 {
        // The map is linear in each coordinate, but for rounding.
        let slope = |axis: DVec3| self.place(local + axis * 0.5) - self.place(local - axis * 0.5);
        DMat3::from_cols(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z))
    }

    /// Whether no part of it is flat or turned inside out, and no face curved: the truth of curved faces is a rule.
    fn is_upright(&self) -> bool {
        let is_planar = |face: &&[u8]| {
            let at = |i: usize| self.places[usize::from(face[i])] - self.places[usize::from(face[0])];
            face.len() < 4 || at(1).cross(at(2)).dot(at(3)).abs() < 1e-12
        };
        if !self.cell_type.faces().iter().all(is_planar) {
            return false;
        }
        let is_inside = |p: &DVec3| self.cell_type != CellType::Wedge || p.x + p.y < 0.99;
        let locals = lattice(&[0.02, 0.2, 0.4, 0.6, 0.8, 0.98]);
        locals.into_iter().filter(is_inside).all(|local| self.slopes(local).determinant() > 1e-9)
    }

    /// Local coordinates of a place, by Newton's method from a lattice of guesses and damped: slow and sure.
    fn local(&self, place: DVec3, guess: &Cell<DVec3>) -> DVec3 {
        let off = |local: DVec3| (self.place(local) - place).length();
        let mut best = (f64::INFINITY, guess.get());
        for start in [guess.get()].into_iter().chain(lattice(&[0.1, 0.35, 0.65, 0.9])) {
            let mut local = start;
            for _ in 0..60 {
                let step = self.slopes(local).inverse() * (self.place(local) - place);
                let shorter = (0..30).map(|k| local - step * 0.5f64.powi(k)).find(|&p| off(p) < off(local));
                let Some(next) = shorter else { break };
                local = next;
            }
            let aside = (local - local.clamp(DVec3::ZERO, DVec3::ONE)).length();
            let is_better = off(local) < 1e-12 && aside < best.0;
            if is_better {
                best = (aside, local);
            }
            if best.0 < 1e-9 {
                break;
            }
        }
        assert!(
            best.0 < 0.3,
            "{:?} {:?}: no local coordinates of {place}: {best:?}",
            self.cell_type,
            self.nodes
        );
        guess.set(best.1);
        best.1
    }

    fn value(&self, place: DVec3, guess: &Cell<DVec3>) -> f64 {
        weights(self.cell_type, self.local(place, guess)).iter().zip(&self.values).map(|(w, v)| w * v).sum()
    }

    /// Where a ray meets the triangles of the surface, split as [`GridTracer`] says.
    fn meets(&self, ray: &Ray) -> Vec<f64> {
        let mut found = Vec::new();
        let mut meet = |corners: [u8; 3]| {
            let numbers = corners.map(|corner| self.nodes[usize::from(corner)]);
            if numbers[0] == numbers[1] || numbers[1] == numbers[2] || numbers[2] == numbers[0] {
                return;
            }
            let [a, b, c] = corners.map(|corner| self.places[usize::from(corner)]);
            let solved = DMat3::from_cols(b - a, c - a, -ray.direction).inverse() * (ray.origin - a);
            let is_met = solved.x >= 0.0 && solved.y >= 0.0 && solved.x + solved.y <= 1.0;
            if is_met {
                found.push(solved.z);
            }
        };
        for face in self.cell_type.faces() {
            match **face {
                [a, b, c] => meet([a, b, c]),
                [a, b, c, d] => {
                    let number = |corner: u8| self.nodes[usize::from(corner)];
                    if number(a).min(number(c)) <= number(b).min(number(d)) {
                        [[a, b, c], [a, c, d]].into_iter().for_each(&mut meet);
                    } else {
                        [[b, c, d], [b, d, a]].into_iter().for_each(&mut meet);
                    }
                }
                _ => unreachable!("a face has three or four nodes"),
            }
        }
        found.sort_by(f64::total_cmp);
        found
    }
}

/// Every way to make nodes of a type one along its edges that leaves a cell upright with planar faces.
fn collapsed(cell_type: CellType, random: &mut Random) -> Vec<Collapsed> {
    let count = cell_type.num_nodes();
    let mut edges = BTreeSet::new();
    for face in cell_type.faces() {
        for (i, &a) in face.iter().enumerate() {
            let b = face[(i + 1) % face.len()];
            edges.insert((a.min(b), a.max(b)));
        }
    }
    let edges: Vec<(u8, u8)> = edges.into_iter().collect();
    let mut patterns = BTreeSet::new();
    for subset in 0..1u32 << edges.len() {
        let mut nodes: Vec<u8> = (0..count as u8).collect();
        for (i, &(a, b)) in edges.iter().enumerate() {
            if subset >> i & 1 == 1 {
                let (a, b) = (nodes[usize::from(a)], nodes[usize::from(b)]);
                nodes.iter_mut().filter(|node| **node == a.max(b)).for_each(|node| *node = a.min(b));
            }
        }
        patterns.insert(nodes);
    }
    let turned =
        DMat3::from_cols(DVec3::new(1.1, 0.2, -0.1), DVec3::new(0.1, 0.9, 0.3), DVec3::new(-0.2, 0.1, 1.2));
    let straight = straight(cell_type);
    let cells = patterns.into_iter().map(|pattern| {
        let same = |node: u8| (0..count).filter(|&i| pattern[i] == node).collect::<Vec<_>>();
        let places = pattern.iter().map(|&node| {
            let same = same(node);
            turned * (same.iter().map(|&i| straight[i]).sum::<DVec3>() / same.len() as f64)
        });
        let of_node: Vec<f64> = (0..count).map(|_| random.unit()).collect();
        Collapsed {
            cell_type,
            places: places.collect(),
            values: pattern.iter().map(|&node| of_node[usize::from(node)]).collect(),
            nodes: pattern.into_iter().map(u32::from).collect(),
        }
    });
    cells.filter(Collapsed::is_upright).collect()
}

fn grid(cell: &Collapsed) -> UnstructuredGrid {
    let cells =
        Cells::new(vec![cell.cell_type], cell.nodes.clone()).expect("as many nodes as the type asks for");
    UnstructuredGrid::new(cell.places.clone(), cells).expect("nodes that exist")
}

fn matter() -> TransferFunction {
    let points = [
        (0.0, [0.0, 0.1, 0.9], 0.05),
        (0.3, [0.5, 0.8, 0.0], 0.3),
        (0.5, [0.1, 0.2, 0.8], 0.1),
        (0.5, [0.9, 0.9, 0.9], 0.4),
        (1.0, [1.0, 0.1, 0.3], 0.7),
    ];
    transfer(&points, 0.6)
}

/// How far the tracer is from the integral of the interpolation, at worst of some rays, and how many met matter.
fn worst(cell: &Collapsed, random: &mut Random) -> (f64, usize) {
    let (grid, matter) = (grid(cell), matter());
    let tracer = GridTracer::new(&grid, &cell.values.clone().into(), &matter).expect("values at all nodes");
    let middle = cell.places.iter().sum::<DVec3>() / cell.places.len() as f64;
    let (mut greatest, mut lit) = (0.0, 0);
    for _ in 0..4 {
        let toward = middle + (random.point() - 0.5) * 0.5;
        let direction = (random.point() - 0.5).normalize();
        let ray = Ray { origin: toward - direction * 4.0, direction };
        // Just two, not an edge of the surface met twice.
        let expected = match cell.meets(&ray)[..] {
            [start, end] if end - start > 1e-3 => {
                let guess = Cell::new(DVec3::splat(0.4));
                let value = |t: f64| cell.value(ray.origin + direction * t, &guess);
                Integrand { transfer: &matter, value, tolerance: 1e-6 }.over(&[start, end])
            }
            _ => continue,
        };
        let error = difference(&tracer.trace(&ray), &expected);
        if error > 1e-7 {
            println!("{:?} {:?}: {ray:?}: error {error:e}", cell.cell_type, cell.nodes);
        }
        greatest = f64::max(greatest, error);
        lit += usize::from(expected.transmittance < 0.99);
    }
    (greatest, lit)
}

#[test]
fn cells_collapsed_in_every_way_have_the_field_of_their_interpolation() {
    let mut random = Random::new(40);
    for (cell_type, at_least) in [(CellType::Pyramid, 5), (CellType::Wedge, 15), (CellType::Hexahedron, 150)]
    {
        let cells = collapsed(cell_type, &mut random);
        let (mut greatest, mut num_lit) = (0.0, 0);
        for cell in &cells {
            let (error, lit) = worst(cell, &mut random);
            greatest = f64::max(greatest, error);
            num_lit += lit;
        }
        assert!(cells.len() >= at_least, "{} ways to collapse {cell_type}", cells.len());
        assert!(num_lit >= 2 * at_least, "{num_lit} rays meet {} cells", cells.len());
        check(&format!("{} ways to collapse {cell_type}", cells.len()), greatest, 1e-7);
    }
}
