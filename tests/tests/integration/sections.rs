//! Sections of real grids, against clipping every cell's tetrahedra in f64.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use rayon::prelude::*;
use volery_io::{GridOptions, read_grid};
use volery_scene::unstructured::Fault;
use volery_scene::{CellType, Cells, UnstructuredGrid};
use volery_slicing::{Planes, Refinement, Section, Slicer, Stack};
use volery_tests::{at_most, data_folder};

const NORMAL: DVec3 = DVec3::new(0.3, 0.5, 0.81);

fn read(file: &str, test: &str) -> Option<UnstructuredGrid> {
    let path = data_folder(test)?.join(file);
    Some(read_grid(&path, &GridOptions::default()).unwrap_or_else(|error| panic!("{error}")).grid)
}

/// The triangles of a cell's surface, outward, each face of four nodes split at its lowest node.
fn surface(cell_type: CellType, nodes: &[u32]) -> Vec<[u32; 3]> {
    let mut triangles = Vec::new();
    for face in cell_type.faces() {
        let face: Vec<u32> = face.iter().map(|&place| nodes[usize::from(place)]).collect();
        match *face {
            [a, b, c] => triangles.push([a, b, c]),
            [a, b, c, d] if a.min(c) <= b.min(d) => triangles.extend([[a, b, c], [a, c, d]]),
            [a, b, c, d] => triangles.extend([[a, b, d], [b, c, d]]),
            _ => panic!("face of {} nodes", face.len()),
        }
    }
    triangles
}

/// Tetrahedra of a cell around its centre, with the sign that their volume has beside that of the cell.
fn tetrahedra(grid: &UnstructuredGrid, cell: usize) -> Vec<([DVec3; 4], f64)> {
    let (cell_type, nodes) = grid.cells().get(cell);
    let point = |node: u32| grid.points()[node as usize];
    let center = nodes.iter().map(|&node| point(node)).sum::<DVec3>() / nodes.len() as f64;
    let corners = surface(cell_type, nodes).into_iter().map(|triangle| {
        let [a, b, c] = triangle.map(point);
        ([a, b, c, center], (a - center).dot((b - center).cross(c - center)))
    });
    let corners: Vec<_> = corners.collect();
    let sign = corners.iter().map(|(_, volume)| volume).sum::<f64>().signum();
    corners.into_iter().map(|(corners, volume)| (corners, sign * volume.signum())).collect()
}

/// Area of a tetrahedron's section.
fn tetrahedron_area(corners: &[DVec3; 4], normal: DVec3, plane: f64) -> f64 {
    let distances = corners.map(|corner| normal.dot(corner) - plane);
    let above: Vec<usize> = (0..4).filter(|&at| distances[at] >= 0.0).collect();
    let below: Vec<usize> = (0..4).filter(|&at| distances[at] < 0.0).collect();
    let cross = |a: usize, b: usize| {
        corners[a] + distances[a] / (distances[a] - distances[b]) * (corners[b] - corners[a])
    };
    let triangle = |a: DVec3, b: DVec3, c: DVec3| 0.5 * (b - a).cross(c - a).length();
    match (&above[..], &below[..]) {
        (&[a], &[b, c, d]) | (&[b, c, d], &[a]) => triangle(cross(a, b), cross(a, c), cross(a, d)),
        (&[a, b], &[c, d]) => {
            let [ac, ad, bc, bd] = [cross(a, c), cross(a, d), cross(b, c), cross(b, d)];
            triangle(ac, ad, bd) + triangle(ac, bd, bc)
        }
        _ => 0.0,
    }
}

/// Areas of the grid's sections, by clipping.
fn clipped_areas(grid: &UnstructuredGrid, planes: &Planes) -> Vec<f64> {
    let normal = planes.normal();
    let add = |mut areas: Vec<f64>, cell: usize| {
        for (corners, sign) in tetrahedra(grid, cell) {
            let along = corners.map(|corner| normal.dot(corner));
            let low = along.into_iter().fold(f64::INFINITY, f64::min);
            let high = along.into_iter().fold(f64::NEG_INFINITY, f64::max);
            let first = planes.positions().partition_point(|&plane| plane < low);
            let end = planes.positions().partition_point(|&plane| plane <= high);
            for (area, &plane) in areas[first..end].iter_mut().zip(&planes.positions()[first..end]) {
                *area += sign * tetrahedron_area(&corners, normal, plane);
            }
        }
        areas
    };
    let sum = |a: Vec<f64>, b: Vec<f64>| a.into_iter().zip(b).map(|(a, b)| a + b).collect();
    let zero = || vec![0.0; planes.len()];
    (0..grid.cells().len()).into_par_iter().fold(zero, add).reduce(zero, sum)
}

/// Faces that only one cell has, by each of their nodes.
fn outline(grid: &UnstructuredGrid) -> BTreeMap<u32, Vec<BTreeSet<u32>>> {
    let mut count: BTreeMap<BTreeSet<u32>, usize> = BTreeMap::new();
    for (cell_type, nodes) in grid.cells().iter() {
        for face in cell_type.faces() {
            *count.entry(face.iter().map(|&place| nodes[usize::from(place)]).collect()).or_default() += 1;
        }
    }
    let mut by_node: BTreeMap<u32, Vec<BTreeSet<u32>>> = BTreeMap::new();
    for face in count.into_iter().filter(|&(_, count)| count == 1).map(|(face, _)| face) {
        face.iter().for_each(|&node| by_node.entry(node).or_default().push(face.clone()));
    }
    by_node
}

/// Every side of a polygon is shared the opposite way by one other, or lies in the outline of the grid.
fn check_sides(section: &Section, outline: &BTreeMap<u32, Vec<BTreeSet<u32>>>, what: &str) {
    let sides = section.unmatched_sides();
    assert_eq!(sides.overlapping, [[0u32; 2]; 0], "{what}");
    for side in sides.open {
        let nodes: BTreeSet<u32> = side.iter().flat_map(|&vertex| section.edges()[vertex as usize]).collect();
        let faces = nodes.first().and_then(|node| outline.get(node));
        let is_outline = faces.is_some_and(|faces| faces.iter().any(|face| nodes.is_subset(face)));
        assert!(is_outline, "{what}: a hole at the side between nodes {nodes:?}");
    }
}

/// Slices along several normals: sides match, and every section has the area that clipping gives.
fn check_sections(file: &str) {
    let Some(grid) = read(file, &format!("sections of {file}")) else { return };
    let outline = outline(&grid);
    let slicer = Slicer::new(grid).unwrap();
    for normal in [NORMAL, DVec3::X, DVec3::Y, DVec3::Z] {
        let planes = Planes::over(slicer.grid(), normal, 48).unwrap();
        let stack = slicer.slice(&planes).unwrap();
        let expected = clipped_areas(slicer.grid(), &planes);
        let largest = expected.iter().copied().fold(0.0, f64::max);
        let (mut worst, mut least): (f64, f64) = (0.0, 0.0);
        for (layer, expected) in stack.layers().iter().zip(expected) {
            let Some(section) = &layer.section else {
                worst = worst.max(expected / largest);
                continue;
            };
            check_sides(section, &outline, &format!("{file} along {normal} at {}", layer.position));
            let areas = section.areas(stack.normal(), &section.positions(slicer.grid().points()));
            worst = worst.max((areas.iter().sum::<f64>() - expected).abs() / largest);
            least = areas.iter().copied().fold(least, |least, area| least.min(area / largest));
        }
        at_most(&format!("{file} along {normal}: area of a section, over the largest"), worst, 1e-7);
        at_most(&format!("{file} along {normal}: area lying over another"), -least, 1e-9);
    }
}

#[test]
fn sections_of_bluntfin() {
    check_sections("bluntfin.vtu");
}

#[test]
fn sections_of_comb() {
    check_sections("comb.vtu");
}

#[test]
fn sections_of_k3d_fem() {
    check_sections("k3d_fem.vtu");
}

#[test]
fn sections_of_k3d_fem_with_wedges_the_other_way_round() {
    check_sections("k3d_fem_wedge_flipped.vtu");
}

#[test]
fn sections_of_post_mixed() {
    check_sections("post_mixed.vtu");
}

#[test]
fn wedges_either_way_round_have_the_same_sections() {
    let test = "wedges either way round";
    let Some(grid) = read("k3d_fem.vtu", test) else { return };
    let Some(flipped) = read("k3d_fem_wedge_flipped.vtu", test) else { return };
    let planes = Planes::over(&grid, NORMAL, 64).unwrap();
    let [expected, found] =
        [grid, flipped].map(|grid| polygons(&Slicer::new(grid).unwrap().slice(&planes).unwrap()));
    assert!(found == expected);
}

#[test]
fn the_number_of_threads_and_the_order_of_cells_change_no_bit_of_sections() {
    let Some(grid) = read("post_mixed.vtu", "threads and order of cells") else { return };
    let planes = Planes::over(&grid, NORMAL, 64).unwrap();
    let with = |threads: usize, grid: &UnstructuredGrid| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Slicer::new(grid.clone()).unwrap().slice(&planes).unwrap())
    };
    let one = with(1, &grid);
    for threads in [2, 7] {
        assert!(with(threads, &grid) == one, "{threads} threads");
    }
    // Another order by a step that has no factor in common with the number of cells.
    let (count, step) = (grid.cells().len(), 100_003);
    assert_ne!(count % step, 0);
    let order: Vec<usize> = (0..count).map(|cell| cell * step % count).collect();
    assert_eq!(order.iter().collect::<BTreeSet<_>>().len(), count);
    let types = order.iter().map(|&cell| grid.cells().get(cell).0).collect();
    let nodes = order.iter().flat_map(|&cell| grid.cells().get(cell).1.to_vec()).collect();
    let shuffled = UnstructuredGrid::new(grid.points().to_vec(), Cells::new(types, nodes).unwrap()).unwrap();
    assert!(polygons(&with(2, &shuffled)) == polygons(&one));
}

#[test]
fn bad_tetrahedra_do_no_harm() {
    let Some(grid) = read("turb_tets.vtu", "bad tetrahedra") else { return };
    let defects = grid.defects();
    let count = |name: &str| defects.iter().filter(|defect| defect.fault.name() == name).count();
    println!("{} of zero volume, {} inverted", count("zero volume"), count("inverted"));
    // Without an allowance for rounding, 8262 to 8718 are exactly zero and 461 to 671 negative, by the formula.
    assert_eq!([count("zero volume"), count("inverted")], [9632, 3]);
    let bad: BTreeSet<usize> = defects.iter().map(|defect| defect.cell).collect();
    let good: Vec<usize> = (0..grid.cells().len()).filter(|cell| !bad.contains(cell)).collect();
    let planes = Planes::over(&grid, NORMAL, 64).unwrap();
    let alone = {
        let types = vec![CellType::Tetrahedron; good.len()];
        let nodes = good.iter().flat_map(|&cell| grid.cells().get(cell).1.to_vec()).collect();
        let grid = UnstructuredGrid::new(grid.points().to_vec(), Cells::new(types, nodes).unwrap()).unwrap();
        polygons(&Slicer::new(grid).unwrap().slice(&planes).unwrap())
    };
    // Whatever bad cells give, the good ones are drawn as if they were alone.
    let all = polygons(&Slicer::new(grid).unwrap().slice(&planes).unwrap());
    for (alone, all) in alone.iter().zip(&all) {
        let all: BTreeSet<_> = all.iter().collect();
        assert!(alone.iter().all(|polygon| all.contains(polygon)));
    }
}

#[test]
fn defects_of_real_grids_are_those_known() {
    let Some(grid) = read("comb.vtu", "defects of comb") else { return };
    let folded: BTreeSet<usize> = grid
        .defects()
        .iter()
        .filter(|defect| matches!(defect.fault, Fault::FoldedCorner { .. }))
        .map(|defect| defect.cell)
        .collect();
    // Mirror images of each other; the determinant is -0.053 of the product of the edges.
    assert_eq!(folded, BTreeSet::from([39, 1775]), "cells with a corner turned over");
    let Some(grid) = read("k3d_fem_wedge_flipped.vtu", "defects of flipped wedges") else { return };
    assert!(grid.defects().iter().all(|defect| matches!(defect.fault, Fault::NonPlanarFace { .. })));
}

#[test]
fn areas_of_post_mixed_sum_to_its_volume() {
    let Some(grid) = read("post_mixed.vtu", "volume of post_mixed") else { return };
    let slicer = Slicer::new(grid).unwrap();
    let error = |count: usize| {
        let stack = slicer.slice(&Planes::over(slicer.grid(), NORMAL, count).unwrap()).unwrap();
        let volume: f64 = stack
            .sections()
            .map(|(layer, section)| {
                let areas = section.areas(stack.normal(), &section.positions(slicer.grid().points()));
                layer.thickness * areas.iter().sum::<f64>()
            })
            .sum();
        (volume / 3399.6622 - 1.0).abs()
    };
    at_most("volume of post_mixed by 16 planes, relative", error(16), 4e-3);
    at_most("volume of post_mixed by 256 planes, relative", error(256), 4e-3 / 256.0);
}

#[test]
fn as_many_polygons_of_bluntfin_as_vtk_finds() {
    // VTK's count is of polygons before they are split into triangles, one per cell and plane here. It has 250792
    // points, one per edge and plane; seven more here lie on diagonals of the few faces that are warped.
    let Some(grid) = read("bluntfin.vtu", "polygons of bluntfin") else { return };
    let slicer = Slicer::new(grid).unwrap();
    let planes = Planes::over(slicer.grid(), NORMAL, 256).unwrap();
    let stack = slicer.slice(&planes).unwrap();
    println!(
        "{} polygons, {} vertices; VTK's cutter 235021 polygons",
        stack.num_polygons(),
        stack.num_vertices()
    );
    assert_eq!(stack.num_polygons(), 235_021);
    assert_eq!(stack.num_vertices(), 250_792 + 7);
}

#[test]
fn semi_adaptive_slices_meet_every_cell_of_bluntfin() {
    let Some(grid) = read("bluntfin.vtu", "semi-adaptive slices of bluntfin") else { return };
    let num_cells = grid.cells().len();
    let slicer = Slicer::new(grid).unwrap();
    let (stack, steps) =
        slicer.slice_adaptively(NORMAL, Refinement { first_planes: 32, share: 1.0 }).unwrap();
    let mut met = 0;
    for step in &steps {
        met += step.num_met;
        println!("{step:?}, {met} of {num_cells} cells met");
    }
    assert_eq!(met, num_cells);
    // Uniform planes that miss no cell are as far apart as those of the last step. Chopra's rule, a distance below
    // the smallest edge (6.8e-4, edges without length aside), would take some 21 million polygons.
    let finest = steps.last().unwrap().distance;
    let extent = steps[0].distance * 32.0;
    let uniform =
        slicer.slice(&Planes::over(slicer.grid(), NORMAL, (extent / finest).round() as usize).unwrap());
    let uniform = uniform.unwrap().num_polygons();
    let share = stack.num_polygons() as f64 / uniform as f64;
    at_most(&format!("polygons, over the {uniform} of uniform planes"), share, 0.06);
}

/// A polygon as the edges of its vertices and the bits of their weights, from the least on.
type Meaning = Vec<([u32; 2], u32)>;

/// The polygons of a stack as what they mean, layer by layer, sorted.
fn polygons(stack: &Stack) -> Vec<Vec<Meaning>> {
    let of_section = |section: &Section| {
        let vertex = |&at: &u32| (section.edges()[at as usize], section.weights()[at as usize].to_bits());
        let turned = |polygon: &[u32]| {
            let mut polygon: Vec<_> = polygon.iter().map(vertex).collect();
            let least = (0..polygon.len()).min_by_key(|&at| polygon[at]).unwrap_or(0);
            polygon.rotate_left(least);
            polygon
        };
        let mut polygons: Vec<_> = section.polygons().map(turned).collect();
        polygons.sort();
        polygons
    };
    stack.layers().iter().map(|layer| layer.section.as_ref().map(of_section).unwrap_or_default()).collect()
}
