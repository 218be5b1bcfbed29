//! The scenes that VTK has drawn too: two programs that share no code, the exact picture, and both backends.
//!
//! Thresholds are those of the project: rmse .005 to VTK (its opacity tables alone are good for .004), rmse
//! .002 and at most .02 to the reference, rmse .001 between the backends.

use std::sync::OnceLock;

use volery::{BackendChoice, How};
use volery_io::read_png_rgb;
use volery_reference::{Image, Tracer};
use volery_tests::{
    Drawer, at_most, backend, data_folder, distance, draw, exact, read_scene, scenes_folder, values_of,
    view_of,
};

const MAX_RMSE_TO_VTK: f64 = 0.005;
const MAX_RMSE_TO_REFERENCE: f64 = 0.002;
const MAX_DIFFERENCE_TO_REFERENCE: f64 = 0.02;
const MAX_RMSE_BETWEEN_BACKENDS: f64 = 0.001;

/// Pictures of one scene, each made once and shared by its tests.
struct Scene {
    name: &'static str,
    reference: OnceLock<Image>,
    software: OnceLock<Image>,
    wgpu: OnceLock<Option<Image>>,
}

impl Scene {
    const fn new(name: &'static str) -> Self {
        Self { name, reference: OnceLock::new(), software: OnceLock::new(), wgpu: OnceLock::new() }
    }

    /// The exact picture; `None` if the test is ignored.
    fn reference(&self, test: &str) -> Option<&Image> {
        let data = data_folder(test)?;
        Some(self.reference.get_or_init(|| {
            let input = read_scene(&data, self.name);
            let view = view_of(&input);
            let tracer = Tracer::new(&input.volume().unwrap().grid, values_of(&view)).unwrap();
            tracer.render(&view.camera, view.background, view.width, view.height, &|_| ()).unwrap()
        }))
    }

    /// The picture of a backend; `None` if the test is ignored.
    fn drawn(&self, choice: BackendChoice, test: &str) -> Option<&Image> {
        let data = data_folder(test)?;
        let make = || {
            let input = read_scene(&data, self.name);
            let mut session =
                Drawer::volume(input.volume().unwrap().grid.clone(), backend(choice, test)?, How::Raycast)
                    .unwrap();
            Some(exact(&draw(&mut session, &view_of(&input)).image))
        };
        if choice == BackendChoice::Software {
            return Some(self.software.get_or_init(|| make().expect("software is everywhere")));
        }
        // Asked before what another test has drawn, so that each test without a GPU says so.
        backend(choice, test)?;
        self.wgpu.get_or_init(make).as_ref()
    }

    fn is_near_vtk(&self, choice: BackendChoice, test: &str) {
        let Some(drawn) = self.drawn(choice, test) else { return };
        let data = data_folder(test).expect("asked before");
        let file = scenes_folder(&data).join(format!("{}.vtk.png", self.name));
        let png = read_png_rgb(&file).unwrap();
        let vtk = Image::from_f32(png.width, png.height, &png.pixels).unwrap();
        let found = distance(&format!("{test} to VTK"), drawn, &vtk);
        at_most("rmse to VTK", found.rmse, MAX_RMSE_TO_VTK);
    }

    fn is_near_reference(&self, choice: BackendChoice, test: &str) {
        let Some(drawn) = self.drawn(choice, test) else { return };
        let Some(reference) = self.reference(test) else { return };
        let found = distance(&format!("{test} to the reference"), drawn, reference);
        at_most("rmse to the reference", found.rmse, MAX_RMSE_TO_REFERENCE);
        at_most("largest difference to the reference", found.max, MAX_DIFFERENCE_TO_REFERENCE);
    }

    fn backends_agree(&self, test: &str) {
        let Some(wgpu) = self.drawn(BackendChoice::Wgpu, test) else { return };
        let Some(software) = self.drawn(BackendChoice::Software, test) else { return };
        let found = distance(&format!("{test}: software to wgpu"), software, wgpu);
        at_most("rmse between the backends", found.rmse, MAX_RMSE_BETWEEN_BACKENDS);
    }
}

macro_rules! scenes {
    ($($scene:ident)+) => {
        $(mod $scene {
            use super::Scene;
            use volery::BackendChoice::{Software, Wgpu};

            static SCENE: Scene = Scene::new(stringify!($scene));

            #[test]
            fn software_is_near_vtk() {
                SCENE.is_near_vtk(Software, concat!(stringify!($scene), " by software"));
            }

            #[test]
            fn software_is_near_the_reference() {
                SCENE.is_near_reference(Software, concat!(stringify!($scene), " by software"));
            }

            #[test]
            fn wgpu_is_near_vtk() {
                SCENE.is_near_vtk(Wgpu, concat!(stringify!($scene), " by wgpu"));
            }

            #[test]
            fn wgpu_is_near_the_reference() {
                SCENE.is_near_reference(Wgpu, concat!(stringify!($scene), " by wgpu"));
            }

            #[test]
            fn backends_agree() {
                SCENE.backends_agree(stringify!($scene));
            }
        })+
    };
}

scenes! { engine engine_inside heptane mri tooth16 }
