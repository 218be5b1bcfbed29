//! A plane on a random walk through a volume, as a hand drags it.

use glam::DVec3;
use volery_octree::{
    CuttingPlanes, Focus, IndexPlane, balance, low_corners, section, select, validate, without_unseen,
};
use volery_pyramid::NodeSource;
use volery_scene::Plane;

use crate::field::{Field, noise_floats, pyramid};
use crate::section::{area_error, clipped_area};
use crate::world::Noise;

#[test]
fn a_plane_dragged_a_thousand_steps_shows_no_hole_and_no_seam() {
    let mut noise = Noise(1);
    let dims = [65, 41, 23];
    let source = pyramid(dims, 4, noise_floats(dims, &mut noise));
    let layout = source.layout();
    let size = layout.domain() * layout.spacing();
    let mut normal = DVec3::Z;
    let mut point = size / 2.0;
    let mut quality = 1.0;
    let (mut area, mut jump): (f64, f64) = (0.0, 0.0);
    let (mut boundaries, mut levels_met) = (0, 0);
    for step in 0..1000 {
        let by = |noise: &mut Noise, scale: f64| noise.point(-DVec3::ONE, DVec3::ONE) * scale;
        normal = (normal + by(&mut noise, 0.1)).normalize_or(DVec3::X);
        point += by(&mut noise, 0.02) * size;
        quality = (quality * (0.9 + 0.2 * noise.unit())).clamp(0.05, 2.0);
        // Now and then held at an axis, at a sample, or dragged out.
        let plane = match step % 10 {
            0 => Plane { normal: DVec3::AXES[step / 10 % 3], distance: point[step / 10 % 3].round() },
            5 => Plane::through((point / layout.spacing()).round() * layout.spacing(), normal),
            _ => Plane::through(point, normal * 3.0),
        };
        point = point.clamp(-0.1 * size, 1.1 * size);
        let focus = Focus { layout, point, quality };
        let mut planes = CuttingPlanes::new(layout, &[plane]);
        let cut = balance(layout, &select(layout, (CuttingPlanes::new(layout, &[plane]), focus)));
        let cut = without_unseen(&cut, &mut planes);
        assert_eq!(validate::defects(layout, &cut), []);
        area = area.max(area_error(layout, &cut, &plane, clipped_area(size, &plane)));
        let low_corners = low_corners(layout, &cut);
        let field = Field::new(&source, cut, low_corners);
        let index_plane = IndexPlane::new(layout, &plane);
        for (place, &node) in field.cut.nodes.iter().enumerate() {
            let section = section(layout, node, &index_plane);
            let vertices = section.vertices();
            for (i, &vertex) in vertices.iter().enumerate() {
                let next = vertices[(i + 1) % vertices.len()];
                // Along the polygon's sides, which lie in the faces of the node; its corners in edges.
                let w = if noise.unit() < 0.3 { 0.0 } else { noise.unit() };
                let [low, high] = layout.bounds(node);
                let side = vertex.lerp(next, w).clamp(low, high);
                for other in field.touching(side).filter(|&other| other != place) {
                    boundaries += 1;
                    levels_met += usize::from(field.cut.nodes[other].level != node.level);
                    jump = jump.max((field.value(place, side, 0) - field.value(other, side, 0)).abs());
                }
            }
        }
    }
    println!("area wrong by {area:.1e} of what is allowed, 1e-6 of it");
    println!("largest jump {jump:.1e} of 1e-6 allowed, {boundaries} points, {levels_met} between levels");
    assert!(area <= 1.0 && jump <= 1e-6);
    assert!(boundaries > 100_000 && levels_met > 10_000);
}
