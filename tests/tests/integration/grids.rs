//! Real grids against what VTK 9.7.2 (its readers, by way of Python) says about them.

use volery::GridInfo;
use volery_tests::{at_most, data_folder};

/// File, points, cells by type, smallest and largest corner, and the arrays: name, place, components, range.
type Expected<'a> =
    (&'a str, usize, &'a [(&'a str, usize)], [[f64; 3]; 2], &'a [(&'a str, &'a str, usize, [f64; 2])]);

/// Ranges of several components are of the magnitude; for Exodus they are numpy's of the first time step.
const GRIDS: &[Expected] = &[
    (
        "AngularSector.vtk",
        10141,
        &[("hexahedron", 7632), ("pyramid", 144)],
        [[0.0, 0.0, 0.0], [0.23000000417232513, 0.07866460084915161, 0.07973329722881317]],
        &[("CellId", "cells", 1, [0.0, 7775.0]), ("PointId", "points", 1, [0.0, 9126.0])],
    ),
    (
        "bluntfin.vtu",
        40960,
        &[("hexahedron", 37479)],
        [[-7.815747261047363, 0.0, 0.0], [14.362203598022461, 8.327558517456055, 5.7242512702941895]],
        &[
            ("Density", "points", 1, [0.19259999692440033, 4.977499961853027]),
            ("Momentum", "points", 3, [0.0, 6.255677466567032]),
            ("StagnationEnergy", "points", 1, [0.7689569592475891, 25.160999298095703]),
        ],
    ),
    (
        "comb.vtu",
        47025,
        &[("hexahedron", 43008)],
        [
            [0.0, -5.662140846252441, 23.33116912841797],
            [16.510000228881836, 5.662140846252441, 36.19499969482422],
        ],
        &[
            ("Density", "points", 1, [0.19781309366226196, 0.710419237613678]),
            ("Momentum", "points", 3, [0.0, 446.74118205432507]),
            ("StagnationEnergy", "points", 1, [0.0, 0.0]),
        ],
    ),
    ("k3d_fem.vtu", 21332, K3D_CELLS, K3D_BOUNDS, K3D_ARRAYS),
    ("k3d_fem_wedge_flipped.vtu", 21332, K3D_CELLS, K3D_BOUNDS, K3D_ARRAYS),
    (
        "notch_stress.vtk",
        12717,
        &[("hexahedron", 2188), ("wedge", 4)],
        [[0.0; 3], [0.4, 0.1, 0.010000000000000002]],
        &[
            ("Nodal Stress-0", "points", 1, [-145362.41796875, 8107770.25]),
            ("Nodal Stress", "points", 6, [0.0, 8109795.906924712]),
            ("Nodal Stress-normed", "points", 1, [3206.613683497696, 8109795.906924712]),
        ],
    ),
    (
        "post_mixed.vtu",
        147780,
        &[("hexahedron", 51467), ("pyramid", 151848), ("tetrahedron", 50912), ("wedge", 51800)],
        [[-14.986842155456543, -14.996709823608398, 0.0], [15.0, 14.996709823608398, 4.820525169372559]],
        &[
            ("StagnationEnergy", "points", 1, [-0.541506290435791, 4.395837306976318]),
            ("MomentumMagnitude", "points", 1, [0.0, 1.3914440870285034]),
        ],
    ),
    (
        "turb_tets.vtu",
        21813,
        &[("tetrahedron", 60672)],
        [
            [25.5003604888916, -30.335969924926758, -7.1488847732543945],
            [95.7205810546875, 28.244543075561523, -5.7504353523254395],
        ],
        &[("tur_mu", "points", 1, [1.8720104435487883e-06, 0.00010412442497909069])],
    ),
    (
        "disk_out_ref.ex2",
        8499,
        &[("hexahedron", 7472)],
        [[-5.75, -5.75, -10.0], [5.75, 5.75, 10.15999984741211]],
        &[
            ("Temp", "points", 1, [293.1499938964844, 913.1500244140625]),
            ("VX", "points", 1, [-19.949113845825195, 19.949113845825195]),
            ("VY", "points", 1, [-19.949113845825195, 19.949113845825195]),
            ("VZ", "points", 1, [-21.1259765625, 6.7119011878967285]),
            ("Pres", "points", 1, [0.006785521749407053, 0.028818512335419655]),
            ("AsH3", "points", 1, [0.08047682046890259, 0.18483947217464447]),
            ("GaMe3", "points", 1, [0.00022284436272457242, 0.007213925942778587]),
            ("CH4", "points", 1, [0.0, 0.0011702391784638166]),
            ("H2", "points", 1, [0.8076131343841553, 0.9176878929138184]),
        ],
    ),
];

const K3D_CELLS: &[(&str, usize)] = &[("tetrahedron", 63008), ("wedge", 16748)];
const K3D_BOUNDS: [[f64; 3]; 2] = [
    [0.04336051270365715, 0.027959300205111504, 0.040760546922683716],
    [0.05633670091629028, 0.05073394998908043, 0.05701755732297897],
];
const K3D_ARRAYS: &[(&str, &str, usize, [f64; 2])] = &[
    ("u", "points", 1, [-0.2566223442554474, 0.5076313614845276]),
    ("v", "points", 1, [-0.2621181309223175, 0.38588351011276245]),
    ("w", "points", 1, [-0.34123778343200684, 0.34641891717910767]),
    ("p", "points", 1, [-5.378287315368652, 369.05859375]),
    ("Umag", "points", 1, [0.0, 0.5216706395149231]),
];

#[test]
fn every_grid_is_what_vtk_says() {
    let Some(data) = data_folder("every_grid_is_what_vtk_says") else { return };
    for &(name, points, cells, bounds, arrays) in GRIDS {
        let info = GridInfo::read(&data.join(name)).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((info.kind, info.points), ("grid", points), "{name}");
        assert_eq!(info.cells.into_iter().collect::<Vec<_>>(), cells, "{name}");
        assert_eq!(info.bounds, Some(bounds), "{name}");
        assert_eq!(info.arrays.len(), arrays.len(), "{name}");
        for (found, &(array, place, components, range)) in info.arrays.iter().zip(arrays) {
            let place_found = (found.name.as_str(), found.place.as_str(), found.components);
            assert_eq!(place_found, (array, place, components), "{name}");
            let [low, high] = found.range.unwrap();
            let differs = (low - range[0]).abs().max((high - range[1]).abs());
            at_most(
                &format!("{name}, {array}: range against VTK, over the largest value"),
                differs / range[1].abs().max(1e-300),
                1e-14,
            );
        }
    }
}

/// Cells that name more nodes than their type has (an exporter wrote quadratic cells as linear ones).
#[test]
fn cells_with_nodes_to_spare_are_read_by_their_first_and_said() {
    let Some(data) = data_folder("cells_with_nodes_to_spare_are_read_by_their_first_and_said") else {
        return;
    };
    let info = GridInfo::read(&data.join("notch_stress.vtk")).unwrap();
    assert_eq!(info.notes, ["2192 cells list more nodes than their type has; the first ones are used"]);
    // What VTK computes from three NaN components is NaN.
    assert_eq!(info.arrays.iter().map(|array| array.blank).collect::<Vec<_>>(), [0, 0, 9180]);
}

/// Real files cut anywhere: one line, or all that was asked for.
#[test]
fn cut_grids_are_refused_in_one_line() {
    use volery_io::{GridOptions, read_grid};
    let Some(data) = data_folder("cut_grids_are_refused_in_one_line") else { return };
    let folder = tempfile::tempdir().unwrap();
    for (name, array) in
        [("bluntfin.vtu", "Density"), ("notch_stress.vtk", "Nodal Stress"), ("disk_out_ref.ex2", "Temp")]
    {
        let whole = std::fs::read(data.join(name)).unwrap();
        let path = folder.path().join(name);
        for part in 0..40 {
            std::fs::write(&path, &whole[..whole.len() * part / 40]).unwrap();
            let options = GridOptions { array: Some(array.to_owned()), ..GridOptions::default() };
            match read_grid(&path, &options) {
                Err(error) => {
                    let line = error.to_string();
                    assert!(!line.contains('\n') && line.contains(name), "{line}");
                }
                Ok(file) => assert_eq!(file.grid.cells().len(), whole_cells(name), "{name} cut at {part}/40"),
            }
        }
    }
}

fn whole_cells(name: &str) -> usize {
    GRIDS.iter().find(|grid| grid.0 == name).unwrap().2.iter().map(|(_, count)| count).sum()
}
