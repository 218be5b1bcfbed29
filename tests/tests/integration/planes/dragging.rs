//! A person drags a plane and looks here and there.

use volery::glam::DVec3;
use volery::{BackendChoice, ControlPoint, Focus, How, Plane, PlaneView, TransferFunction, ViewOptions};
use volery_scene::Ray;
use volery_tests::{Drawer, at_most, backend, data_folder, draw, planes_of};

use super::{MOUSE, Random, read};

/// World distance, in parts of the extent, from the domain's surface below which a place may count as outside.
const MARGIN: f64 = 1e-5;

/// Whether a ray meets a plane in the domain; `None` where that is too near its surface to tell.
fn sees(ray: &Ray, plane: &Plane, extent: DVec3) -> Option<bool> {
    let depth = -plane.signed_distance(ray.origin) / plane.normal.dot(ray.direction);
    let place = (ray.origin + ray.direction * depth) / extent;
    let outside = (-place).max(place - 1.0).max_element();
    if depth < 0.0 || !depth.is_finite() || outside > MARGIN {
        Some(false)
    } else {
        (outside < -MARGIN).then_some(true)
    }
}

by_both_backends! { a_plane_dragged_through_the_mouse }

/// Each step moves the plane a little, now and then far away or out of the domain, with the focus on it; where it
/// is in the domain each pixel shows it, and what stays resident is at most the pyramid.
fn a_plane_dragged_through_the_mouse(choice: BackendChoice, test: &str) {
    let Some(data) = data_folder(test) else { return };
    let Some(backend) = backend(choice, test) else { return };
    let num_steps = if choice == BackendChoice::Software { 1000 } else { 100 };
    let grid = read(&data, MOUSE);
    let num_samples = grid.num_samples() as f64;
    let mut session = Drawer::volume(grid, backend, How::Planes(PlaneView::default())).unwrap();
    let extent = session.data().grid().extent();
    // Never black, which the background is.
    let point = |value, level| ControlPoint { value, color: [level; 3], opacity: 1.0 };
    let transfer = TransferFunction::new(vec![point(0.0, 0.2), point(255.0, 1.0)], 1.0).unwrap();
    let options =
        ViewOptions { width: 64, height: 64, transfer: Some(transfer.into()), ..ViewOptions::default() };
    let mut view = session.view(&options);
    view.background = [0.0; 3];
    let mut random = Random::new(1000);
    let mut plane = random.plane(extent);
    let (mut num_pixels, mut num_wrong, mut most_resident, mut uploaded) = (0_usize, 0_usize, 0, 0);
    for step in 0..num_steps {
        if step % 50 == 0 {
            plane = random.plane(extent);
        }
        let turn = random.direction() * 0.05;
        plane.normal = (plane.normal + turn).normalize();
        plane.distance += random.between(-0.02, 0.02) * extent.length();
        planes_of(&mut view).planes = vec![plane];
        let focus = random.point(extent);
        let on_plane = focus - plane.normal * plane.signed_distance(focus);
        planes_of(&mut view).focus = Some(Focus { point: on_plane, quality: random.between(0.2, 1.5) });
        let picture = draw(&mut session, &view);
        most_resident = picture.report.work.bytes_resident.max(most_resident);
        uploaded += picture.report.work.bytes_uploaded;
        let rays = view.camera.rays(view.width, view.height);
        for (index, pixel) in (0..).zip(&picture.image.pixels) {
            let ray = rays.pixel(index % view.width, index / view.width);
            let Some(is_seen) = sees(&ray, &plane, extent) else { continue };
            num_pixels += usize::from(is_seen);
            num_wrong += usize::from(is_seen == (*pixel == [0.0; 3]));
        }
    }
    println!("{num_steps} steps, {num_pixels} pixels on the plane, {:.1} MB uploaded", uploaded as f64 / 1e6);
    assert!(num_pixels > 100 * num_steps, "{num_pixels} pixels show the plane");
    at_most("pixels with a hole, or with a plane where none is", num_wrong as f64, 0.0);
    // Shared boundaries: (31 / 30)^3; coarser levels: 8 / 7.
    let pyramid = num_samples * (31.0_f64 / 30.0).powi(3) * 8.0 / 7.0 * 1.1;
    at_most("bytes resident", most_resident as f64, pyramid);
}
