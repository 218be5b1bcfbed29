//! Cutting polygons into triangles.

use glam::DVec3;

/// Concave polygons of more corners are cut like convex ones: ears cost the cube of the corners at worst.
const MAX_CONCAVE: usize = 256;

/// Adds the triangles of a polygon that is flat or nearly so. A convex one becomes a fan; of a concave one ears are
/// cut, corners whose triangle holds no other corner (Meisters 1975).
pub(super) fn cut(corners: &[u32], points: &[DVec3], triangles: &mut Vec<[u32; 3]>) {
    let at = |corner: u32| points[corner as usize];
    // Newell's normal: the sum over sides, of which no single one decides.
    let normal: DVec3 = (0..corners.len())
        .map(|i| at(corners[i]).cross(at(corners[(i + 1) % corners.len()])))
        .fold(DVec3::ZERO, |sum, cross| sum + cross);
    let turn = |a: u32, b: u32, c: u32| (at(b) - at(a)).cross(at(c) - at(b)).dot(normal);
    let mut left = corners.to_vec();
    let around = |left: &[u32], i: usize| {
        let num = left.len();
        [left[(i + num - 1) % num], left[i], left[(i + 1) % num]]
    };
    let is_convex = (0..left.len()).all(|i| {
        let [a, b, c] = around(&left, i);
        turn(a, b, c) >= 0.0
    });
    let mut is_cut = !is_convex && left.len() <= MAX_CONCAVE;
    while is_cut && left.len() > 3 {
        let is_ear = |&i: &usize| {
            let [a, b, c] = around(&left, i);
            let is_within = |&p: &u32| {
                ![a, b, c].contains(&p)
                    && [(a, b), (b, c), (c, a)].iter().all(|&(from, to)| turn(from, to, p) >= 0.0)
            };
            turn(a, b, c) > 0.0 && !left.iter().any(is_within)
        };
        let ear = (0..left.len()).find(is_ear);
        is_cut = ear.is_some();
        if let Some(ear) = ear {
            triangles.push(around(&left, ear));
            left.remove(ear);
        }
    }
    triangles.extend((2..left.len()).map(|i| [left[0], left[i - 1], left[i]]));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(triangles: &[[u32; 3]], points: &[DVec3]) -> (f64, f64) {
        let cross = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [a, b, c].map(|i| points[i as usize]);
            (b - a).cross(c - a) / 2.0
        };
        let sum: DVec3 = triangles.iter().map(|&t| cross(t)).sum();
        (sum.length(), triangles.iter().map(|&t| cross(t).length()).sum())
    }

    /// Triangles cover a polygon once if their areas add up to that of their sum.
    #[test]
    fn concave_polygons_are_covered_once_from_whatever_corner() {
        let star: Vec<DVec3> = (0..14)
            .map(|i| {
                let angle = std::f64::consts::TAU * f64::from(i) / 14.0;
                let radius = if i % 2 == 0 { 3.0 } else { 1.0 };
                DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.3 * radius * angle.cos())
            })
            .collect();
        let arrow = vec![
            DVec3::ZERO,
            DVec3::new(4.0, 0.0, 1.0),
            DVec3::new(1.0, 1.0, 0.25),
            DVec3::new(0.0, 4.0, 0.0),
        ];
        for points in [star, arrow] {
            let num = points.len() as u32;
            for start in 0..num {
                for is_turned in [false, true] {
                    let mut corners: Vec<u32> = (0..num).map(|i| (i + start) % num).collect();
                    if is_turned {
                        corners.reverse();
                    }
                    let mut triangles = Vec::new();
                    cut(&corners, &points, &mut triangles);
                    assert_eq!(triangles.len() as u32, num - 2);
                    let (sum, total) = area(&triangles, &points);
                    assert!((sum - total).abs() < 1e-12 * total, "from {start}: {sum} of {total}");
                }
            }
        }
    }
}
