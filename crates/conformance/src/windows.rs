//! Pictures in windows: each shows the content that was drawn in it last, and that alone.

use volery_frame::backend::{MAX_STRIDE, MAX_WINDOW_SIDE, WINDOW_STEP};
use volery_frame::{Backend, Content, DrawError, Image, Window};

use super::oracle::assert_shows_something;
use super::parts::{KINDS, Kind, MAX_RMSE, SIZE, World, assert_like, wide};
use super::world::BACKGROUND_F64;

/// The same for sheets: devices put corners of triangles on 1/256 of a pixel of the window.
const MAX_SHEETS_RMSE: f64 = 2e-4;

/// What a window shows at the end.
#[derive(Clone, Copy, PartialEq)]
enum Shown {
    Nothing,
    Half,
    Whole,
}

/// The picture that has in each window what it shows.
fn composed(side: u32, shown: &[Shown], pictures: &[(Shown, Image)]) -> Image {
    let [width, height] = SIZE;
    let across = width.div_ceil(side);
    let pixel = |place: u32| {
        let [x, y] = [place % width, place / width];
        let shown = shown[(y / side * across + x / side) as usize];
        let found = pictures.iter().find(|(of, _)| *of == shown);
        found.map_or([0.0; 3], |(_, image)| image.pixels[place as usize])
    };
    Image { width, height, pixels: (0..width * height).map(pixel).collect() }
}

/// Of some windows drawn twice, first half of it and then all, of some once and of some never; with meshes and without.
pub fn windows_show_their_content_alone(backend: &mut dyn Backend) {
    let world = World::new(backend, false);
    for (kind, meshes) in KINDS.into_iter().flat_map(|kind| [(kind, &[][..]), (kind, &world.meshes)]) {
        let (half, whole) = (world.cut(kind, 2)[0], world.whole(kind));
        let view = world.view(meshes);
        backend.begin(&view).expect("the suite's pictures are small");
        let bare = backend.finish().expect("a picture was begun").image;
        let mut draw = |content| world.draw(backend, meshes, content).image;
        let pictures = [(Shown::Nothing, bare), (Shown::Half, draw(half)), (Shown::Whole, draw(whole))];
        assert_shows_something(&format!("{kind:?}"), &wide(&pictures[2].1), BACKGROUND_F64);
        for side in [WINDOW_STEP, 2 * WINDOW_STEP, MAX_WINDOW_SIDE] {
            let num = SIZE.map(|pixels| pixels.div_ceil(side)).iter().product::<u32>();
            let shown: Vec<_> =
                (0..num).map(|i| [Shown::Whole, Shown::Half, Shown::Nothing][i as usize % 3]).collect();
            backend.begin_windows(&view, side).expect("the suite's pictures are small");
            let mut parts = 0;
            let mut draw = |content: &Content<'_>, wanted: &[Shown]| {
                let windows: Vec<_> = (0..num)
                    .filter(|&number| wanted.contains(&shown[number as usize]))
                    .rev()
                    .map(|number| Window { number, stride: 1 })
                    .collect();
                for windows in windows.chunks(3) {
                    assert_eq!(backend.draw_windows(content, windows), Ok(parts), "the number of a part");
                    parts += windows.len() as u32;
                }
            };
            draw(&half, &[Shown::Whole, Shown::Half]);
            draw(&whole, &[Shown::Whole]);
            let drawn = backend.finish().expect("a picture was begun");
            let what = format!("{kind:?} with {} meshes in {num} windows", meshes.len());
            let max_rmse =
                if matches!(kind, Kind::Sheets | Kind::Slabs) { MAX_SHEETS_RMSE } else { MAX_RMSE };
            assert_like(&what, &drawn.image, &composed(side, &shown, &pictures), max_rmse);
            assert_eq!(drawn.ray_doubt.is_some(), kind == Kind::Rays, "{what}: a doubt");
            assert_eq!(backend.finished().len(), parts as usize, "{what}: parts that were told");
        }
    }
}

/// Squares of a window show the ray of their middle pixel, whatever the stride of other windows.
pub fn strides_show_some_rays_of_the_picture(backend: &mut dyn Backend) {
    let world = World::new(backend, false);
    let (content, view) = (world.whole(Kind::Rays), world.view(&[]));
    let whole = world.draw(backend, &[], content).image;
    let across = SIZE[0].div_ceil(WINDOW_STEP);
    let num = across * SIZE[1].div_ceil(WINDOW_STEP);
    let stride_of = |window: u32| 1 << (window % 4);
    backend.begin_windows(&view, WINDOW_STEP).expect("the suite's pictures are small");
    for window in 0..num {
        // What was drawn before with another stride is gone.
        for stride in [MAX_STRIDE / stride_of(window), stride_of(window)] {
            backend
                .draw_windows(&content, &[Window { number: window, stride }])
                .expect("the suite's windows are right");
        }
    }
    let drawn = backend.finish().expect("a picture was begun");
    let mut expected = drawn.image.clone();
    let [width, height] = SIZE;
    let mut num_shared = 0;
    for (place, pixel) in (0..).zip(&mut expected.pixels) {
        let at = [place % width, place / width];
        let stride = stride_of(at[1] / WINDOW_STEP * across + at[0] / WINDOW_STEP);
        let [x, y] = at.map(|place| place / stride * stride + stride / 2);
        // Beyond the edge of the picture nobody knows.
        if x < width && y < height {
            *pixel = whole.pixels[(y * width + x) as usize];
            num_shared += u32::from(stride > 1);
        }
    }
    assert!(num_shared > width * height / 2, "{num_shared} pixels share rays");
    assert_like("windows of several strides", &drawn.image, &expected, MAX_RMSE);
    assert!(drawn.ray_doubt.is_some(), "a doubt");
    backend.begin_windows(&view, WINDOW_STEP).expect("the suite's pictures are small");
    for (content, stride) in
        [(content, 0), (content, 3), (content, 2 * MAX_STRIDE), (world.whole(Kind::Planes), 2)]
    {
        let found = backend.draw_windows(&content, &[Window { number: 0, stride }]);
        assert!(
            matches!(found, Err(DrawError::Window { found, .. }) if found == stride),
            "{stride}: {found:?}"
        );
    }
}

/// Windows that there are not are refused and change nothing.
pub fn windows_that_are_none_are_refused(backend: &mut dyn Backend) {
    let world = World::new(backend, false);
    let (content, view) = (world.whole(Kind::Rays), world.view(&[]));
    assert_eq!(
        backend.draw_windows(&content, &[Window { number: 0, stride: 1 }]),
        Err(DrawError::NoPicture),
        "a window without a beginning"
    );
    for side in [0, 1, WINDOW_STEP + 1, MAX_WINDOW_SIDE + WINDOW_STEP, u32::MAX] {
        let found = backend.begin_windows(&view, side);
        assert!(matches!(found, Err(DrawError::Window { found, .. }) if found == side), "{side}: {found:?}");
        assert_eq!(backend.finish().err(), Some(DrawError::NoPicture), "an end after a side of {side}");
    }
    backend.begin(&view).expect("the suite's pictures are small");
    let found = backend.draw_windows(&content, &[Window { number: 0, stride: 1 }]);
    assert!(matches!(found, Err(DrawError::Window { .. })), "a window of a whole picture: {found:?}");
    assert_eq!(backend.draw_part(&content), Ok(0), "a part after a window that was refused");
    let whole = backend.finish().expect("a picture was begun").image;
    let num = SIZE.map(|pixels| pixels.div_ceil(WINDOW_STEP)).iter().product::<u32>();
    backend.begin_windows(&view, WINDOW_STEP).expect("the suite's pictures are small");
    for window in 0..num {
        backend
            .draw_windows(&content, &[Window { number: window, stride: 1 }])
            .expect("the suite's windows are right");
    }
    let found = backend.draw_windows(&content, &[Window { number: num, stride: 1 }]);
    assert!(matches!(found, Err(DrawError::Window { found, .. }) if found == num), "{found:?}");
    let drawn = backend.finish().expect("a picture was begun").image;
    assert_like("after a window that was refused", &drawn, &whole, MAX_RMSE);
}
