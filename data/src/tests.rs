use volery_scene::SampleType;

use super::*;

#[test]
fn the_signal_of_marschner_and_lobb_has_its_published_values() {
    // On the axis r = 0 the ring term is cos(12π) = 1; at z = -1 the sine is -1.
    assert!((marschner_lobb_at(DVec3::new(0.0, 0.0, -1.0)) - 1.0).abs() < 1e-12);
    assert!((marschner_lobb_at(DVec3::ZERO) - 0.6).abs() < 1e-12);
    // On the circle r = 1: cos(2π f cos(π/2)) = 1 again.
    assert!((marschner_lobb_at(DVec3::new(0.6, 0.8, 1.0)) - 0.2).abs() < 1e-12);
    // cos(πr/2) = 1/24 gives cos(π/2) = 0.
    let r = 2.0 / PI * (1.0f64 / 24.0).acos();
    assert!((marschner_lobb_at(DVec3::new(r, 0.0, 0.0)) - 0.5).abs() < 1e-12);
}

#[test]
fn quantised_signal_is_the_signal() {
    let (float, byte) = (marschner_lobb(9), marschner_lobb_u8(9));
    for index in 0..float.num_samples() {
        let difference = 255.0 * float.samples().value(index, 0) - byte.samples().value(index, 0);
        assert!(difference.abs() <= 0.5001, "sample {index}: {difference}");
    }
    assert_eq!(marschner_lobb(1).num_samples(), 1);
}

#[test]
fn a_ramp_is_linear_in_world_units() {
    let spacing = DVec3::new(1.0, 2.0, 0.5);
    let ramp = ramp([3, 4, 5], spacing, DVec3::new(1.0, -2.0, 4.0), 10.0);
    assert_eq!(ramp.sample_type(), SampleType::F64);
    assert_eq!(ramp.samples().value(ramp.index([2, 3, 4]), 0), 10.0 + 2.0 - 12.0 + 8.0);
}

#[test]
fn a_half_space_is_on_one_side() {
    let step = half_space([4, 4, 4], DVec3::ONE, DVec3::X, 2.0);
    for x in 0..4 {
        let value = step.samples().value(step.index([x, 1, 2]), 0);
        assert_eq!(value, if x >= 2 { 255.0 } else { 0.0 });
    }
}

#[test]
fn a_head_has_its_tissues_where_they_belong() {
    let dims = [65, 81, 81];
    let head = head(dims, DVec3::ONE);
    let at = |x: f64, y: f64, z: f64| {
        let index = |n: usize, p: f64| ((p + 1.0) / 2.0 * (n - 1) as f64).round() as usize;
        head.samples().value(head.index([index(65, x), index(81, y), index(81, z)]), 0)
    };
    assert_eq!(at(-1.0, -1.0, 1.0), -1000.0, "air around");
    assert_eq!(at(0.0, 0.5, 0.3), 38.0, "brain");
    assert_eq!(at(0.12, 0.0, 0.18), 6.0, "left ventricle");
    assert_eq!(at(-0.12, 0.0, 0.18), 6.0, "right ventricle");
    let crown: Vec<_> = (0..81).map(|z| head.samples().value(head.index([32, 41, z]), 0)).collect();
    let bone = crown.iter().filter(|&&v| v > 700.0).count();
    assert!(bone >= 3, "{bone} samples of skull above the brain");
    assert_eq!(head.sample_type(), SampleType::I16);
    let byte = head_u8(dims, DVec3::ONE);
    assert_eq!(byte.value_range(0), Some([0.0, 210.0]));
}

#[test]
fn noise_is_flat_and_has_no_neighbours() {
    let noise = noise([16, 16, 16], 7);
    let values: Vec<f64> = (0..4096).map(|i| noise.samples().value(i, 0)).collect();
    let mean = values.iter().sum::<f64>() / 4096.0;
    // Standard error of the mean: 73.9 / 64 = 1.15.
    assert!((mean - 127.5).abs() < 4.0 * 1.15, "mean {mean}");
    let covariance = values.windows(2).map(|w| (w[0] - mean) * (w[1] - mean)).sum::<f64>() / 4095.0;
    let correlation = covariance / (255.0 * 255.0 / 12.0);
    assert!(correlation.abs() < 4.0 / 64.0, "correlation {correlation}");
    assert_eq!(hash(0), 0xe220_a839_7b1d_cdaf, "first output of SplitMix64 with seed 0");
}

#[test]
fn holes_have_the_share_asked_for() {
    let grid = holes([16, 16, 16], 3, 0.1);
    let blank = (0..4096).filter(|&i| !grid.samples().value(i, 0).is_finite()).count();
    let infinite = (0..4096).filter(|&i| grid.samples().value(i, 0).is_infinite()).count();
    // 409.6 expected, standard deviation 19.2.
    assert!((333..=487).contains(&blank), "{blank} blank");
    assert!(infinite > 0 && infinite < blank / 2, "{infinite} infinite");
}

#[test]
fn tissue_is_smooth_and_of_its_formula() {
    let dims = [41, 33, 21];
    let tissue = tissue(dims);
    assert_eq!(tissue.sample_type(), SampleType::Rgba8);
    let channel = |index: [usize; 3], c: usize| tissue.samples().value(tissue.index(index), c);
    // In the middle the coarse gyroid is 0, and the fine one that of its phases alone.
    let fine = (1f64.sin() * 2f64.cos() + 2f64.sin() * 3f64.cos() + 3f64.sin() * 1f64.cos()) / 1.5;
    let expected = [0.64 + 0.09 * fine, 0.42 - 0.06 * fine, 0.34 - 0.08 * fine, 0.5 + 0.15 * fine];
    for (c, expected) in expected.into_iter().enumerate() {
        let found = channel([20, 16, 10], c);
        assert_eq!(found, (255.0 * expected).round(), "channel {c}");
    }
    for c in 0..4 {
        let [low, high] = tissue.value_range(c).unwrap();
        assert!(low > 0.0 && high < 255.0 && high - low > 30.0, "channel {c}: {low} to {high}");
    }
}

#[test]
fn a_zone_plate_is_an_image_of_rings_on_tiles() {
    let plate = zone_plate([257, 201]);
    assert_eq!((plate.dims(), plate.sample_type()), ([257, 201, 1], SampleType::Rgb8));
    let color = |x: usize| [0, 1, 2].map(|c| plate.samples().value(plate.index([x, 100, 0]), c));
    // The middle is a crest, in a tile of sand: (128 / 17 + 100 / 17) is even.
    assert_eq!(color(128), [0.95, 0.85, 0.60].map(|c| (255.0f64 * c).round()));
    // 39² is 6 n but for 1 %, a trough; the tile two further on is of sky: (167 / 17 + 5) is even again.
    let (crest, trough) = (color(128), color(167));
    for c in 0..3 {
        let found = trough[c] / crest[c];
        assert!((0.24..0.27).contains(&found), "channel {c}: {found}");
    }
}

#[test]
fn cells_around_a_cylinder_fit_face_to_face() {
    use std::collections::BTreeMap;
    use volery_scene::CellType;
    for n in [1, 2, 3, 6] {
        let grid = cylinder(n);
        assert_eq!(grid.defects(), [], "{n}");
        let sector = 4 * n * n;
        let expected = [10 * sector, sector, 2 * n * sector, n * sector, 0];
        let of = |cell_type: CellType| grid.cells().count_by_type()[cell_type as usize];
        let types = [
            CellType::Tetrahedron,
            CellType::Pyramid,
            CellType::Wedge,
            CellType::Hexahedron,
            CellType::Voxel,
        ];
        assert_eq!(types.map(of), expected, "{n}");
        let mut faces: BTreeMap<Vec<u32>, u32> = BTreeMap::new();
        for (cell_type, nodes) in grid.cells().iter() {
            for face in cell_type.faces() {
                let mut face: Vec<u32> = face.iter().map(|&node| nodes[usize::from(node)]).collect();
                face.sort_unstable();
                *faces.entry(face).or_default() += 1;
            }
        }
        assert!(faces.values().all(|&cells| cells <= 2), "{n}");
        // At the cylinder and at both ends of wedges and hexahedra; triangles outside and at the ends of the rest.
        let alone = faces.values().filter(|&&cells| cells == 1).count();
        let (around, inner) = (4 * n, 4 * n * n);
        assert_eq!(alone, inner + 2 * around * (2 * n + n) + 2 * inner + 4 * around, "{n}");
        let volume =
            (1.5f64.powi(2) - CYLINDER_RADIUS.powi(2)) * 1.5 * 2.0 * n as f64 * (PI / 2.0 / n as f64).sin();
        let found: f64 =
            grid.cells().iter().map(|(cell_type, nodes)| volume_of(&grid, cell_type, nodes)).sum();
        println!("{n}: volume {found}, expected {volume}");
        assert!((found - volume).abs() < 1e-12 * volume, "{n}: {found}, expected {volume}");
    }
    // At a quarter of the way around the speed is doubled, in front of and behind the cylinder the flow stands.
    let at = |x, y| cylinder_at(glam::DVec3::new(x, y, 0.0));
    assert!((at(0.0, CYLINDER_RADIUS) - 4.0).abs() < 1e-12 && at(-CYLINDER_RADIUS, 0.0).abs() < 1e-12);
}

/// By the divergence theorem over faces split at their first node; faces are planar.
fn volume_of(grid: &volery_scene::UnstructuredGrid, cell_type: volery_scene::CellType, nodes: &[u32]) -> f64 {
    let at = |node: u8| grid.points()[nodes[usize::from(node)] as usize];
    let triangle = |a, b, c| at(a).dot(at(b).cross(at(c))) / 6.0;
    let faces = cell_type.faces().iter();
    faces.flat_map(|face| face.windows(2).map(|side| triangle(face[0], side[0], side[1]))).sum::<f64>().abs()
}
