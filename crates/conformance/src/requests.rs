//! What is asked and answered: sizes, repetition, order, errors, and what stays after them.

use glam::DVec3;
use volery_scene::Camera;

use volery_frame::{
    Backend, Brick, BrickId, Content, DrawError, Frame, Image, JoinedBrick, PictureView, PlacedBrick, Rays,
    TexelType, Texels, UploadError,
};

use super::oracle::{assert_background, assert_close, assert_same_bits, march_volume};
use super::world::{
    BACKGROUND, BACKGROUND_F64, OwnedBrick, Storage, Volume, draw, draw_resident, hold, marschner_lobb,
    smooth_transfer, transfer,
};

const SIZE: [u32; 2] = [40, 32];

fn scene() -> (Volume, Camera) {
    let volume =
        Volume::new([20, 18, 22], DVec3::ONE, Storage::unit(TexelType::U8), marschner_lobb([19, 17, 21]));
    let camera = Camera::fitted(volume.extent(), 35.0, 25.0, 1.2, false);
    (volume, camera)
}

fn draw_placed(
    backend: &mut dyn Backend,
    (volume, camera): &(Volume, Camera),
    [width, height]: [u32; 2],
    bricks: &[PlacedBrick],
) -> Result<Image, DrawError> {
    let transfer = &volume.integrated(&smooth_transfer(1.0));
    let bricks: Vec<_> = bricks.iter().copied().map(JoinedBrick::from).collect();
    let content = Content::Rays(Rays { transfer, bricks: &bricks });
    let frame = Frame {
        view: PictureView { width, height, camera: *camera, background: BACKGROUND, meshes: &[] },
        content,
    };
    backend.draw(&frame).map(|drawn| drawn.image)
}

/// One pixel, one row, and sizes that no tile divides.
pub fn pictures_of_every_size(backend: &mut dyn Backend) {
    let (volume, camera) = scene();
    let tf = smooth_transfer(1.0);
    for size in [[1, 1], [17, 5], [1, 33], [65, 1], [7, 9], [64, 16], [131, 67]] {
        let expected = march_volume(&volume, &tf, 24.0, &camera, size, BACKGROUND_F64);
        let image = draw(backend, &volume, &tf, &camera, size);
        assert_close(&format!("{size:?} pixels"), &image, &expected, 0.01, 0.002);
    }
}

/// No pixel at all, and more than any device draws.
pub fn picture_sizes_out_of_range_are_refused(backend: &mut dyn Backend) {
    let scene = scene();
    hold(backend, &scene.0, &[]);
    for [width, height] in [[0, 5], [5, 0], [0, 0], [u32::MAX, 4], [4, u32::MAX], [u32::MAX, u32::MAX]] {
        match draw_placed(backend, &scene, [width, height], &[]) {
            Err(DrawError::Size { width: w, height: h, max }) => {
                println!("{width}x{height}: refused, at most {max}");
                assert!([w, h] == [width, height] && max >= 1);
            }
            other => panic!("{width}x{height}: {other:?}, expected DrawError::Size"),
        }
    }
}

/// Twice the same frame, and once more after another one.
pub fn the_same_frame_gives_the_same_bits(backend: &mut dyn Backend) {
    let (volume, camera) = scene();
    let tf = smooth_transfer(1.0);
    let bricks = volume.bricks(&camera);
    let first = draw(backend, &volume, &tf, &camera, SIZE);
    let second = draw_resident(backend, &volume, &tf, &camera, SIZE, &bricks);
    assert_same_bits("drawn twice", &first, &second);
    let other = Camera::fitted(volume.extent(), 100.0, -10.0, 1.0, true);
    draw_resident(backend, &volume, &tf, &other, [13, 77], &volume.bricks(&other));
    let third = draw_resident(backend, &volume, &tf, &camera, SIZE, &bricks);
    assert_same_bits("drawn after another", &first, &third);
}

/// Bricks uploaded in reverse.
pub fn order_of_uploads_does_not_matter(backend: &mut dyn Backend) {
    let (volume, camera) = scene();
    let tf = smooth_transfer(1.0);
    let mut bricks = volume.bricks(&camera);
    hold(backend, &volume, &bricks);
    let first = draw_resident(backend, &volume, &tf, &camera, SIZE, &bricks);
    bricks.reverse();
    hold(backend, &volume, &bricks);
    bricks.reverse();
    let second = draw_resident(backend, &volume, &tf, &camera, SIZE, &bricks);
    assert_same_bits("uploaded in reverse", &first, &second);
}

/// What was transparent may become visible, and back.
pub fn transfer_functions_can_change_between_frames(backend: &mut dyn Backend) {
    let (volume, camera) = scene();
    let bricks = volume.bricks(&camera);
    hold(backend, &volume, &bricks);
    let clear = transfer(&[[0.0, 1.0, 1.0, 1.0, 0.0]], 1.0);
    let high = transfer(&[[0.6, 0.1, 1.0, 0.3, 0.0], [0.9, 0.1, 1.0, 0.3, 0.3]], 1.0);
    for tf in [&clear, &high, &smooth_transfer(1.0), &clear] {
        let expected = march_volume(&volume, tf, 24.0, &camera, SIZE, BACKGROUND_F64);
        let image = draw_resident(backend, &volume, tf, &camera, SIZE, &bricks);
        assert_close("another transfer function", &image, &expected, 0.01, 0.002);
    }
}

/// Nothing to draw.
pub fn a_frame_without_bricks_is_background(backend: &mut dyn Backend) {
    let scene = scene();
    hold(backend, &scene.0, &scene.0.bricks(&scene.1));
    let image = draw_placed(backend, &scene, SIZE, &[]).expect("nothing is missing");
    assert_background("no bricks", &image, BACKGROUND);
}

/// A backend that was told no volume draws none. The backend must be fresh.
pub fn drawing_needs_a_volume(backend: &mut dyn Backend) {
    let found = draw_placed(backend, &scene(), SIZE, &[]);
    assert_eq!(found.err(), Some(DrawError::NoVolume), "draw before set_volume");
}

/// A backend that was told no volume takes no brick. The backend must be fresh.
pub fn upload_needs_a_volume(backend: &mut dyn Backend) {
    let brick = Brick { id: BrickId(7), samples: [1; 3], texels: Texels::U8(&[0]) };
    let found = backend.upload(&[brick]);
    assert_eq!(found, Err(UploadError::NoVolume { id: BrickId(7) }), "upload before set_volume");
    assert!(!backend.is_resident(BrickId(7)), "a refused brick is resident");
}

/// The frame names a brick that was never uploaded.
pub fn missing_bricks_are_named(backend: &mut dyn Backend) {
    let scene = scene();
    let bricks = scene.0.bricks(&scene.1);
    hold(backend, &scene.0, &bricks[1..]);
    let placed: Vec<_> = bricks.iter().map(|brick| brick.placed).collect();
    let id = placed[0].id;
    assert!(!backend.is_resident(id) && backend.is_resident(placed[1].id), "residency");
    let found = draw_placed(backend, &scene, SIZE, &placed);
    assert_eq!(found.err(), Some(DrawError::NotResident { id }), "a frame with a missing brick");
    let found = draw_placed(backend, &scene, SIZE, &placed[1..]);
    assert!(found.is_ok(), "a frame of resident bricks after a refused one: {found:?}");
}

/// Corners beside the grid of their level, outside the volume, and levels that no volume has.
pub fn misplaced_bricks_are_named(backend: &mut dyn Backend) {
    let scene = scene();
    let bricks = scene.0.bricks(&scene.1);
    hold(backend, &scene.0, &bricks);
    let good = bricks[0].placed;
    for (level, found) in [
        (0, [4, 0, 0]),
        (1, [8, 0, 0]),
        (0, [0, 24, 0]),
        (0, [0, 0, 4_294_967_288]),
        (29, [0; 3]),
        (40, [0; 3]),
        (u32::MAX, [0; 3]),
    ] {
        let placed = PlacedBrick { id: good.id, first_cell: found, level };
        let expected = DrawError::Misplaced { id: good.id, level, found };
        let result = draw_placed(backend, &scene, SIZE, &[good, placed]);
        assert_eq!(result.err(), Some(expected), "level {level} at {found:?}");
    }
}

/// Wrong types, sizes and counts: the whole upload is refused, what was resident stays and draws the same.
pub fn bricks_that_do_not_fit_are_refused_and_change_nothing(backend: &mut dyn Backend) {
    let (volume, camera) = scene();
    let tf = smooth_transfer(1.0);
    let bricks = volume.bricks(&camera);
    hold(backend, &volume, &bricks);
    let before = draw_resident(backend, &volume, &tf, &camera, SIZE, &bricks);
    let bytes = backend.resident_bytes();
    let texels = vec![9_u8; 9 * 9 * 9];
    let wide = vec![9_u16; 9 * 9 * 9];
    let good = Brick { id: BrickId(901), samples: [9; 3], texels: Texels::U8(&texels) };
    let replaced = Brick { id: bricks[0].placed.id, ..good };
    let id = BrickId(902);
    let bad = [
        Brick { id, samples: [9; 3], texels: Texels::U16(&wide) },
        Brick { id, samples: [10, 9, 9], texels: Texels::U8(&texels) },
        Brick { id, samples: [9, 0, 9], texels: Texels::U8(&[]) },
        Brick { id, samples: [9, 9, 8], texels: Texels::U8(&texels) },
        Brick { id, samples: [9, 9, 9], texels: Texels::U8(&texels[1..]) },
        Brick { id, samples: [u32::MAX; 3], texels: Texels::U8(&texels) },
    ];
    for bad in bad {
        let found = backend.upload(&[good, replaced, bad]);
        match &found {
            Err(UploadError::Mismatch { id: named, found, expected }) => {
                println!("refused: {found}, expected {expected}");
                assert_eq!(*named, id, "the brick that does not fit");
            }
            _ => panic!(
                "{:?} texels of {:?} samples: {found:?}, expected a mismatch",
                bad.texels.len(),
                bad.samples
            ),
        }
        assert!(!backend.is_resident(BrickId(901)), "a brick of a refused upload is resident");
        assert!(!backend.is_resident(id), "a refused brick is resident");
    }
    assert_eq!(backend.resident_bytes(), bytes, "resident bytes after refused uploads");
    let after = draw_resident(backend, &volume, &tf, &camera, SIZE, &bricks);
    assert_same_bits("after refused uploads", &before, &after);
}

/// New texels under an old name.
pub fn bricks_of_the_same_name_are_replaced(backend: &mut dyn Backend) {
    let (volume, camera) = scene();
    let tf = smooth_transfer(1.0);
    let bricks = volume.bricks(&camera);
    let expected = draw(backend, &volume, &tf, &camera, SIZE);
    let other = Volume::new([20, 18, 22], DVec3::ONE, Storage::unit(TexelType::U8), |p| p.x / 19.0);
    hold(backend, &volume, &other.bricks(&camera));
    let bytes = backend.resident_bytes();
    let before = draw_resident(backend, &volume, &tf, &camera, SIZE, &bricks);
    assert!(before != expected, "two fields look alike");
    // Twice in one upload: the last counts.
    let mut lent: Vec<_> = bricks.iter().map(OwnedBrick::lend).collect();
    let texels = vec![255_u8; 9 * 9 * 9];
    lent.insert(0, Brick { id: bricks[0].placed.id, samples: [9; 3], texels: Texels::U8(&texels) });
    backend.upload(&lent).expect("the suite's bricks fit");
    let after = draw_resident(backend, &volume, &tf, &camera, SIZE, &bricks);
    assert_same_bits("replaced", &expected, &after);
    assert_eq!(backend.resident_bytes(), bytes, "resident bytes after replacing every brick");
}

/// `set_volume` begins anew, also with the same layout.
pub fn a_new_volume_forgets_bricks(backend: &mut dyn Backend) {
    let (volume, camera) = scene();
    let bricks = volume.bricks(&camera);
    hold(backend, &volume, &bricks);
    assert!(bricks.iter().all(|brick| backend.is_resident(brick.placed.id)), "uploaded bricks are resident");
    backend.set_volume(&volume.layout).expect("the layout was taken before");
    assert!(!bricks.iter().any(|brick| backend.is_resident(brick.placed.id)), "bricks outlive their volume");
}

/// Bytes grow with what is resident, and cover at least the texels.
pub fn resident_bytes_count_the_texels(backend: &mut dyn Backend) {
    let (volume, camera) = scene();
    let bricks = volume.bricks(&camera);
    let texels: u64 =
        bricks.iter().map(|brick| brick.samples.iter().map(|&n| u64::from(n)).product::<u64>()).sum();
    hold(backend, &volume, &bricks);
    let bytes = backend.resident_bytes();
    println!("{bytes} bytes resident for {texels} bytes of texels (threshold: at least as many)");
    assert!(bytes >= texels, "{bytes} bytes for {texels} bytes of texels");
}

/// Bricks that come one at a time, as a viewer sends them, give the picture of one upload.
pub fn many_uploads_one_by_one(backend: &mut dyn Backend) {
    let storage = Storage { brick_cells: 4, ..Storage::unit(TexelType::U8) };
    let volume = Volume::new([40, 33, 37], DVec3::ONE, storage, marschner_lobb([39, 32, 36]));
    let camera = Camera::fitted(volume.extent(), 35.0, 25.0, 1.2, false);
    let tf = smooth_transfer(1.0);
    let bricks = volume.bricks(&camera);
    let expected = draw(backend, &volume, &tf, &camera, SIZE);
    hold(backend, &volume, &[]);
    for brick in &bricks {
        backend.upload(&[brick.lend()]).expect("the suite's bricks fit");
    }
    let image = draw_resident(backend, &volume, &tf, &camera, SIZE, &bricks);
    assert_same_bits(&format!("{} uploads", bricks.len()), &expected, &image);
}

/// A backend that was told how many bricks come, and how many bytes it may take, never takes more, whatever it held before;
/// what bricks are said to take is enough for them.
pub fn reserved_bytes_are_kept(backend: &mut dyn Backend) {
    let (volume, camera) = scene();
    let bricks = volume.bricks(&camera);
    let layout = &volume.layout;
    hold(backend, &volume, &bricks);
    for count in [bricks.len() / 2, bricks.len(), 1, bricks.len() / 3] {
        let priced: u64 =
            bricks[..count].iter().map(|brick| backend.brick_bytes(layout, brick.samples)).sum();
        let mut max_bytes = priced;
        while backend.room(layout, max_bytes) < priced {
            max_bytes += priced - backend.room(layout, max_bytes);
        }
        assert!(backend.room(layout, 0) == 0 && max_bytes < 4 * priced, "{priced} bytes in {max_bytes}");
        let others: Vec<BrickId> = bricks[count..].iter().map(|brick| brick.placed.id).collect();
        backend.evict(&others);
        backend.reserve(count, max_bytes).expect("room for a few bricks");
        assert!(backend.resident_bytes() <= max_bytes, "{} of {max_bytes}", backend.resident_bytes());
        for brick in &bricks[..count] {
            backend.upload(&[brick.lend()]).expect("reserved");
            assert!(backend.resident_bytes() <= max_bytes, "{} of {max_bytes}", backend.resident_bytes());
        }
        let is_held = |brick: &OwnedBrick| backend.is_resident(brick.placed.id);
        assert!(bricks[..count].iter().all(is_held) && !bricks[count..].iter().any(is_held));
    }
}
