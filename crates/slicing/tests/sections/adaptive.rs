//! Semi-adaptive slicing.

use glam::DVec3;
use volery_scene::CellType::{Tetrahedron, Voxel};
use volery_slicing::{Planes, Refinement, Slicer};

use crate::support::{Parts, Random, mixed};

/// Boxes on top of each other, each thinner than the one below by half.
fn tower(count: usize) -> Parts {
    let mut parts = Parts::default();
    let mut height = 0.0;
    for floor in 0..=count {
        let corner = |at: u32| DVec3::new(f64::from(at & 1), f64::from(at >> 1), height);
        parts.points.extend((0..4).map(corner));
        height += 0.5f64.powi(floor as i32 + 1);
    }
    parts.cells = (0..count as u32).map(|floor| (Voxel, (4 * floor..4 * floor + 8).collect())).collect();
    parts
}

#[test]
fn thin_cells_get_planes_of_their_own() {
    let slicer = Slicer::new(tower(10).grid()).unwrap();
    let refinement = Refinement { first_planes: 2, share: 1.0 };
    let (stack, steps) = slicer.slice_adaptively(DVec3::Z, refinement).unwrap();
    for step in &steps {
        println!("{step:?}");
    }
    assert_eq!(steps.iter().map(|step| step.num_met).sum::<usize>(), 10);
    let num_planes: usize = steps.iter().map(|step| step.num_planes).sum();
    assert_eq!(num_planes, stack.layers().len());
    // A uniform stack that misses none of them needs a distance below the thinnest box.
    assert!(num_planes <= 24, "{num_planes} planes, a uniform stack takes more than 1024");
    let ascends = stack.layers().windows(2).all(|pair| pair[0].position < pair[1].position);
    assert!(ascends);
}

#[test]
fn a_cell_has_polygons_of_one_step_only() {
    let slicer = Slicer::new(mixed(6, 0.15, 21).grid()).unwrap();
    let refinement = Refinement { first_planes: 3, share: 1.0 };
    let (stack, steps) = slicer.slice_adaptively(DVec3::new(0.3, 0.5, 0.81), refinement).unwrap();
    let num_cells = slicer.grid().cells().len();
    let mut thickness = vec![None; num_cells];
    for (layer, section) in stack.sections() {
        for &cell in section.cells() {
            let known = thickness[cell as usize].get_or_insert(layer.thickness);
            assert_eq!(*known, layer.thickness, "cell {cell}");
        }
    }
    assert!(thickness.iter().all(Option::is_some), "all are met");
    assert_eq!(steps.iter().map(|step| step.num_polygons).sum::<usize>(), stack.num_polygons());
    for pair in steps.windows(2) {
        assert!(pair[1].distance < pair[0].distance);
    }
}

#[test]
fn the_first_step_is_the_uniform_stack() {
    let slicer = Slicer::new(mixed(5, 0.1, 22).grid()).unwrap();
    let refinement = Refinement { first_planes: 7, share: 0.0 };
    let (stack, steps) = slicer.slice_adaptively(DVec3::Y, refinement).unwrap();
    assert_eq!(steps.len(), 1);
    assert_eq!(stack, slicer.slice(&Planes::over(slicer.grid(), DVec3::Y, 7).unwrap()).unwrap());
}

#[test]
fn refinement_stops_at_the_share() {
    let slicer = Slicer::new(tower(20).grid()).unwrap();
    let met = |share: f64| -> usize {
        let refinement = Refinement { first_planes: 1, share };
        let (_, steps) = slicer.slice_adaptively(DVec3::Z, refinement).unwrap();
        let before: usize = steps[..steps.len() - 1].iter().map(|step| step.num_met).sum();
        assert!(
            steps.len() == 1 || before < (share * 20.0).ceil() as usize,
            "one step more than was asked for"
        );
        steps.iter().map(|step| step.num_met).sum()
    };
    for share in [0.05, 0.5, 0.75, 0.9, 1.0] {
        assert!(met(share) >= (share * 20.0).ceil() as usize, "share {share}");
    }
}

#[test]
fn cells_that_are_planes_or_lines_end_the_refinement_unmet() {
    let mut parts = tower(3);
    parts.cells.push((Tetrahedron, vec![0, 1, 2, 3]));
    parts.cells.push((Voxel, vec![0, 0, 0, 0, 12, 12, 12, 12]));
    let slicer = Slicer::new(parts.grid()).unwrap();
    let refinement = Refinement { first_planes: 4, share: 1.0 };
    let (_, steps) = slicer.slice_adaptively(DVec3::Z, refinement).unwrap();
    assert_eq!(steps.iter().map(|step| step.num_met).sum::<usize>(), 3);
}

#[test]
fn a_refinement_that_says_nothing_is_an_error() {
    let slicer = Slicer::new(tower(3).grid()).unwrap();
    for (first_planes, share) in [(0, 1.0), (usize::MAX, 1.0), (4, -0.1), (4, 1.5), (4, f64::NAN)] {
        let refinement = Refinement { first_planes, share };
        assert!(slicer.slice_adaptively(DVec3::Z, refinement).is_err(), "{refinement:?}");
    }
    let fine = Refinement { first_planes: 4, share: 1.0 };
    assert!(slicer.slice_adaptively(DVec3::ZERO, fine).is_err());
}

#[test]
fn the_share_of_thin_cells_is_counted_too_often() {
    // Boxes of 0.6 of the first distance in places without pattern. A plane of the first step meets 0.6 of them,
    // each for a whole distance, which alone is their volume. Of the others, each in a gap with two planes of the
    // second step, the mean box meets 1.25 planes for half a distance.
    const FIRST_PLANES: usize = 4000;
    let mut random = Random(31);
    let mut parts = Parts::default();
    for floor in 0..8000u32 {
        let low = match floor {
            0 => 0.0,
            1 => FIRST_PLANES as f64 - 0.6,
            _ => (0.5 + 0.5 * random.signed()) * (FIRST_PLANES as f64 - 0.6),
        };
        let corner =
            |at: u32| DVec3::new(f64::from(at & 1), f64::from(at >> 1 & 1), low + 0.6 * f64::from(at >> 2));
        parts.points.extend((0..8).map(corner));
        parts.cells.push((Voxel, (8 * floor..8 * floor + 8).collect()));
    }
    let slicer = Slicer::new(parts.grid()).unwrap();
    let refinement = Refinement { first_planes: FIRST_PLANES, share: 1.0 };
    let (stack, steps) = slicer.slice_adaptively(DVec3::Z, refinement).unwrap();
    assert_eq!(steps.len(), 2);
    let drawn: f64 =
        stack.sections().map(|(layer, section)| layer.thickness * section.num_polygons() as f64).sum();
    let (found, expected) = (drawn / (0.6 * 8000.0), (0.6 + 0.4 * 1.25 * 0.5) / 0.6);
    println!("thin boxes drawn {found:.3} times, expected {expected:.3}");
    assert!((found - expected).abs() < 0.03);
}
