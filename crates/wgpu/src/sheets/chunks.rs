//! Triangles in parts whose vertices a buffer can hold, whatever vertices they name.

use std::ops::Range;

/// How much a part may have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Most {
    /// At least 3.
    pub(crate) vertices: usize,
    /// At least 1.
    pub(crate) triangles: usize,
}

/// Consecutive triangles with the vertices they name.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Chunk {
    /// Which triangles.
    pub(crate) triangles: Range<u32>,
    /// Numbers of the vertices, each once, by first use.
    pub(crate) vertices: Vec<u32>,
    /// The triangles by places in the list above.
    pub(crate) corners: Vec<[u32; 3]>,
}

/// The parts in turn, each as large as can be.
pub(crate) fn chunks(triangles: &[[u32; 3]], num_vertices: usize, most: Most) -> impl Iterator<Item = Chunk> {
    let mut place_of = vec![u32::MAX; num_vertices];
    let mut start = 0;
    std::iter::from_fn(move || {
        let mut vertices = Vec::new();
        let rest = &triangles[start..];
        let mut corners = Vec::with_capacity(rest.len().min(most.triangles));
        for triangle in rest.iter().take(most.triangles) {
            // No triangle has more than three vertices that are new.
            if vertices.len() + 3 > most.vertices {
                break;
            }
            corners.push(triangle.map(|vertex| {
                let place = &mut place_of[vertex as usize];
                if *place == u32::MAX {
                    *place = vertices.len() as u32;
                    vertices.push(vertex);
                }
                *place
            }));
        }
        for &vertex in &vertices {
            place_of[vertex as usize] = u32::MAX;
        }
        let first = start;
        start += corners.len();
        (start > first).then_some(Chunk { triangles: first as u32..start as u32, vertices, corners })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_name_the_same_vertices() {
        let random = |i: u32| i.wrapping_mul(2_654_435_761) >> 16;
        let triangles: Vec<_> = (0..500).map(|i| [0, 1, 2].map(|c| random(3 * i + c) % 97)).collect();
        for most in [[3, 1], [3, 500], [7, 4], [40, 1000], [97, 1000], [100, 1000], [1000, 33]] {
            let most = Most { vertices: most[0], triangles: most[1] };
            let parts: Vec<_> = chunks(&triangles, 97, most).collect();
            let mut end = 0;
            for Chunk { triangles: range, vertices, corners } in &parts {
                assert_eq!((range.start, range.len()), (end, corners.len()), "{most:?}");
                assert!(vertices.len() <= most.vertices && corners.len() <= most.triangles, "{most:?}");
                let named = corners.iter().map(|corners| corners.map(|place| vertices[place as usize]));
                assert!(named.eq(triangles[range.start as usize..range.end as usize].iter().copied()));
                let mut sorted = vertices.clone();
                sorted.sort_unstable();
                sorted.dedup();
                assert_eq!(sorted.len(), vertices.len(), "{most:?}: each once");
                end = range.end;
            }
            println!("{most:?}: {} parts", parts.len());
            assert_eq!(end, 500, "{most:?}");
            let full = |part: &Chunk| {
                part.vertices.len() + 3 > most.vertices || part.corners.len() == most.triangles
            };
            assert!(parts[..parts.len() - 1].iter().all(full), "{most:?}: as large as can be");
        }
    }

    #[test]
    fn nothing_is_no_part() {
        assert_eq!(chunks(&[], 5, Most { vertices: 3, triangles: 1 }).count(), 0);
    }
}
