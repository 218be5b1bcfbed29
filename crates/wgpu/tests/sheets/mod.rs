//! Sheets beyond the limits of one buffer and of one texture, and what stays on the device between frames.

use glam::DVec3;
use volery_conformance::Property;
use volery_frame::{
    Backend, Content, Counted, Frame, Image, PictureView, Revision, Sheet, SheetTransfer, SheetVertices,
    Sheets,
};
use volery_scene::{Camera, Projection};

use super::difference;

/// What this file checks.
pub(crate) const ALL: &[Property] = &[
    ("a_revision_stays_on_the_device", a_revision_stays_on_the_device),
    ("sheets_of_several_buffers_are_drawn_in_order", sheets_of_several_buffers_are_drawn_in_order),
    ("sheets_in_pictures_of_several_tiles_have_no_seam", sheets_in_pictures_of_several_tiles_have_no_seam),
];

/// Largest difference from closed forms.
const MAX: f64 = 2e-5;

/// Sheets across z, made of squares of two triangles.
#[derive(Default)]
struct Scene {
    points: Vec<[f32; 4]>,
    triangles: Vec<[u32; 3]>,
    sheets: Vec<Sheet>,
}

impl Scene {
    /// One square, `reach` to all sides of the middle.
    fn square(z: f32, reach: f32, value: f32) -> Self {
        let mut scene = Self::default();
        scene.add(z, reach, 1, value, 1.0);
        scene
    }

    /// Adds a sheet of `cells` by `cells` squares.
    fn add(&mut self, z: f32, reach: f32, cells: u32, value: f32, thickness: f32) {
        let (first, first_triangle) = (self.points.len() as u32, self.triangles.len() as u32);
        let place = |i: u32| (2.0 * i as f32 / cells as f32 - 1.0) * reach;
        let row = |y| (0..=cells).map(move |x| [place(x), place(y), z, value]);
        self.points.extend((0..=cells).flat_map(row));
        self.triangles.extend((0..cells * cells).flat_map(|i| {
            let a = first + i % cells + i / cells * (cells + 1);
            let [b, c, d] = [a + 1, a + cells + 1, a + cells + 2];
            [[a, b, c], [d, c, b]]
        }));
        let count = self.triangles.len() as u32 - first_triangle;
        self.sheets.push(Sheet {
            first: first_triangle,
            count,
            thickness: [thickness, 0.0],
            counted: Counted::All,
        });
    }

    fn draw(
        &self,
        backend: &mut dyn Backend,
        revision: Option<Revision>,
        sheets: &[Sheet],
        camera: Camera,
        [width, height]: [u32; 2],
    ) -> Image {
        let content = Content::Sheets(Sheets {
            revision,
            normal: DVec3::Z,
            origin: DVec3::ZERO,
            vertices: SheetVertices::Exact { points: &self.points, gradients: &[] },
            triangles: &self.triangles,
            sheets,
            transfer: &transfer(),
            light: None,
        });
        let frame = Frame {
            view: PictureView { width, height, camera, background: [0.25; 3], meshes: &[] },
            content,
        };
        backend.draw(&frame).expect("right sheets").image
    }
}

/// Per world length.
const EXTINCTION: f32 = 0.05;

/// Values are grays.
fn transfer() -> SheetTransfer {
    let entries = [0.0, 1.0].map(|gray| [gray, gray, gray, EXTINCTION]);
    SheetTransfer::of_entries(entries.to_vec(), 2, [0.0, 1.0], [0.0, 1.0])
}

fn from_above(projection: Projection) -> Camera {
    Camera { eye: DVec3::Z * 5.0, target: DVec3::ZERO, up: DVec3::Y, projection, is_mirrored: false }
}

/// What `behind` looks like through matter of a gray and a length.
fn over(gray: f64, length: f64, behind: f64) -> f64 {
    gray + (behind - gray) * (-f64::from(EXTINCTION) * length).exp()
}

/// Frames that break the promise of a revision tell what a backend kept.
fn a_revision_stays_on_the_device(backend: &mut dyn Backend) {
    let camera = from_above(Projection::Orthographic { height: 1.0 });
    let scenes = [0.0, 0.25, 0.5, 0.75, 1.0].map(|value| Scene::square(0.0, 2.0, value));
    let mut shown = |scene: &Scene, revision| scene.draw(backend, revision, &scene.sheets, camera, [4, 3]);
    let plain = scenes.each_ref().map(|scene| shown(scene, None));
    let revisions = [(); 5].map(|()| Some(Revision::new()));
    for number in 0..4 {
        let image = shown(&scenes[number], revisions[number]);
        assert_eq!(image, plain[number], "revision {number}");
    }
    for number in [0, 3, 1, 2, 0] {
        let image = shown(&scenes[4], revisions[number]);
        assert_eq!(image, plain[number], "the last four are kept: {number}");
        assert_eq!(shown(&scenes[4], None), plain[4], "what has none is never kept");
    }
    assert_eq!(shown(&scenes[4], revisions[4]), plain[4], "a fifth");
    assert_eq!(
        shown(&scenes[4], revisions[3]),
        plain[4],
        "the one that was not asked for the longest is gone"
    );
    assert_eq!(shown(&scenes[3], revisions[0]), plain[0], "the others are not");
}

/// More vertices than a part holds, in sheets of which one lies in two parts; drawn from both ends.
fn sheets_of_several_buffers_are_drawn_in_order(backend: &mut dyn Backend) {
    const CELLS: u32 = 500;
    let thickness = |sheet: u32| [1.0, 4.0, 2.0][sheet as usize % 3];
    let gray = |sheet: u32| (sheet * 37 % 11) as f32 / 11.0;
    let mut scene = Scene::default();
    // The large ones first: a few triangles are drawn of millions.
    (0..9).for_each(|i| scene.add(0.1 * i as f32, 300.0, CELLS, gray(i), thickness(i)));
    assert!(scene.points.len() > 1 << 21 && scene.triangles.len() > 1 << 22, "{}", scene.points.len());
    let camera = from_above(Projection::Orthographic { height: 0.5 });
    let revision = Revision::new();
    for is_turned in [false, true] {
        let direction = if is_turned { -1.0 } else { 1.0 };
        let camera = Camera {
            eye: DVec3::new(0.3, 0.4, direction * 5.0),
            target: DVec3::new(0.3, 0.4, 0.0),
            ..camera
        };
        let mut sheets: Vec<_> = (0..).zip(&scene.sheets).collect();
        if is_turned {
            sheets.reverse();
        }
        let expected = sheets
            .iter()
            .fold(0.25, |behind, &(number, _)| over(gray(number).into(), thickness(number).into(), behind));
        let sheets: Vec<_> = sheets.into_iter().map(|(_, sheet)| *sheet).collect();
        let image = scene.draw(backend, Some(revision), &sheets, camera, [9, 9]);
        let max = difference(&image, |_| expected);
        println!("several buffers: max {max:.2e} (threshold {MAX:e}) from {expected:.4}");
        assert!(max <= MAX, "several buffers: {max:e} from {expected}, expected at most {MAX:e}");
    }
}

/// Strips that are wider or higher than a texture, of one sheet in perspective, flat and steep.
fn sheets_in_pictures_of_several_tiles_have_no_seam(backend: &mut dyn Backend) {
    let scene = Scene::square(0.0, 1e4, 1.0);
    for (size, fov_y_deg) in [([5000, 3], 0.04), ([3, 5000], 60.0)] {
        for target in [DVec3::ZERO, DVec3::new(4.0, 1.0, 0.0)] {
            let camera = Camera { target, ..from_above(Projection::Perspective { fov_y_deg }) };
            let image = scene.draw(backend, None, &scene.sheets, camera, size);
            let rays = camera.rays(size[0], size[1]);
            let expected = |place: usize| {
                let ray = rays.pixel(place as u32 % size[0], place as u32 / size[0]);
                over(1.0, 1.0 / ray.direction.z.abs(), 0.25)
            };
            let max = difference(&image, expected);
            println!("{size:?} to {target}: max {max:.2e} (threshold {MAX:e})");
            assert!(max <= MAX, "{size:?} to {target}: {max:e}, expected at most {MAX:e}");
        }
    }
}
