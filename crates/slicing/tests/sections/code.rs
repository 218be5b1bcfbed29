//! Coded meshes: what comes back, and what is refused.

use glam::DVec3;
use volery_slicing::{CompactMesh, error};

use crate::compact::Case;
use crate::support::Random;

const MAX_BYTES: u64 = 1 << 20;

fn compact() -> CompactMesh {
    Case::new(3, 0.3, 20, DVec3::new(0.3, 0.5, 0.81)).compact()
}

/// With every triangle from its least corner on.
fn turned(mut mesh: CompactMesh) -> CompactMesh {
    let turn = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap();
    mesh.triangles.iter_mut().for_each(|triangle| *triangle = turn(*triangle));
    mesh
}

/// The streams of coded bytes, decompressed.
fn streams(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut rest = &bytes[8..];
    let mut streams = Vec::new();
    while let Some((length, after)) = rest.split_first_chunk::<8>() {
        let (frame, after) = after.split_at(u64::from_le_bytes(*length) as usize);
        streams.push(zstd::decode_all(frame).unwrap());
        rest = after;
    }
    streams
}

fn from_streams(streams: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = b"VSLICES\x01".to_vec();
    for stream in streams {
        let frame = zstd::bulk::compress(stream, 1).unwrap();
        bytes.extend((frame.len() as u64).to_le_bytes());
        bytes.extend(frame);
    }
    bytes
}

#[test]
fn what_is_decoded_has_the_bits_of_what_was_encoded() {
    for (size, num_planes) in [(1, 1), (3, 20), (6, 100)] {
        let mesh = Case::new(size, 0.3, num_planes, DVec3::new(0.3, 0.5, 0.81)).compact();
        let bytes = mesh.encode();
        println!(
            "{size}^3 cubes, {num_planes} planes: {} vertices, {} bytes",
            mesh.vertices.len(),
            bytes.len()
        );
        let decoded = CompactMesh::decode(&bytes, u64::MAX).unwrap();
        assert_eq!(turned(decoded), turned(mesh));
        assert_eq!(CompactMesh::decode(&from_streams(&streams(&bytes)), u64::MAX).unwrap().encode(), bytes);
    }
}

#[test]
fn what_ends_too_soon_or_goes_on_is_an_error() {
    let bytes = compact().encode();
    for end in (0..bytes.len()).step_by(7) {
        let error = CompactMesh::decode(&bytes[..end], MAX_BYTES).unwrap_err();
        assert!(matches!(error, error::Decode::Magic { .. } | error::Decode::Size { .. }), "{end}: {error}");
    }
    let longer = [&bytes[..], &[0]].concat();
    assert!(matches!(CompactMesh::decode(&longer, MAX_BYTES), Err(error::Decode::Size { found: 1, .. })));
    let mut other = bytes.clone();
    other[7] = 2;
    assert!(matches!(CompactMesh::decode(&other, MAX_BYTES), Err(error::Decode::Magic { .. })));
    // A bit of a stream that still decompresses is seen by its checksum, if not before.
    let mut damaged = bytes.clone();
    let last = damaged.len() - 20;
    damaged[last] ^= 1;
    assert!(matches!(CompactMesh::decode(&damaged, MAX_BYTES), Err(error::Decode::Damaged { .. })));
}

#[test]
fn what_is_larger_than_allowed_is_an_error() {
    let mesh = compact();
    let bytes = mesh.encode();
    let Err(error::Decode::TooLarge { required, max: 20_000 }) = CompactMesh::decode(&bytes, 20_000) else {
        panic!("expected it to be too large");
    };
    assert!(CompactMesh::decode(&bytes, required).is_ok());
    assert!(CompactMesh::decode(&bytes, required - 1).is_err());
    // A count of four thousand million, and a stream of zeros without end.
    let mut lying = streams(&bytes);
    lying[0][12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(matches!(
        CompactMesh::decode(&from_streams(&lying), MAX_BYTES),
        Err(error::Decode::TooLarge { .. })
    ));
    let mut bomb = streams(&bytes);
    bomb[2] = vec![0; 100 << 20];
    assert!(matches!(
        CompactMesh::decode(&from_streams(&bomb), MAX_BYTES),
        Err(error::Decode::Size { stream: "lows", .. })
    ));
}

#[test]
fn numbers_that_name_nothing_are_errors() {
    let bytes = compact().encode();
    let with = |stream: usize, at: usize, new: &[u8]| {
        let mut streams = streams(&bytes);
        streams[stream][at..at + new.len()].copy_from_slice(new);
        CompactMesh::decode(&from_streams(&streams), MAX_BYTES).unwrap_err().to_string()
    };
    let nan = f64::NAN.to_le_bytes();
    for (stream, at, new, expected) in [
        (0, 24, &nan[..], "the normal is"),
        (0, 24, &3f64.to_le_bytes(), "the normal is"),
        (0, 48, &nan, "the origin is"),
        (0, 72, &f32::INFINITY.to_le_bytes(), "the least number is inf"),
        (0, 88, &(-1f32).to_le_bytes(), "a step is -1.0"),
        (0, 108, &nan, "a plane is NaN"),
        (0, 4, &7u32.to_le_bytes(), "the number of gradients is 7"),
        (2, 0, &[0xfe, 0xff, 0x7f], "a node of a vertex is"),
        (4, 0, &[0xfe, 0x7f], "a plane of a vertex is"),
        (2, 0, &[255; 6], "a number of a vertex is longer"),
    ] {
        let found = with(stream, at, new);
        assert!(found.contains(expected) && !found.contains('\n'), "{found}, expected {expected}");
    }
}

#[test]
fn damaged_streams_are_refused_or_sound() {
    let whole = compact().encode();
    let parts = streams(&whole);
    let mut random = Random(11);
    let (mut refused, mut sound) = (0, 0);
    for case in 0..3000 {
        let mut bytes = whole.clone();
        if case % 3 > 0 {
            // Behind the checksums.
            let mut parts = parts.clone();
            let stream = random.below(parts.len());
            for _ in 0..=random.below(3) {
                let at = random.below(parts[stream].len());
                parts[stream][at] = random.next() as u8;
            }
            if random.below(4) == 0 {
                let length = random.below(parts[stream].len());
                parts[stream].truncate(length);
            }
            bytes = from_streams(&parts);
        } else {
            let at = random.below(bytes.len());
            bytes[at] ^= 1 << random.below(8);
        }
        match CompactMesh::decode(&bytes, MAX_BYTES) {
            Err(error) => {
                assert!(!error.to_string().contains('\n') && error.to_string().len() < 300, "{error}");
                refused += 1;
            }
            Ok(mesh) => {
                // Nothing in it names what is not there.
                let whole = mesh.expand();
                let largest = whole.triangles.as_flattened().iter().max().copied();
                assert!(largest.is_none_or(|vertex| (vertex as usize) < whole.points.len()));
                std::hint::black_box(whole.to_mesh());
                sound += 1;
            }
        }
    }
    println!("{refused} refused, {sound} sound");
    assert!(refused > 1000 && sound > 300, "{refused} refused, {sound} sound");
}
