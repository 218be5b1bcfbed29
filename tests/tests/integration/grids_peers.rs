//! Grids that VTK has drawn too: two programs that share no code, the exact picture, and both backends.
//!
//! The project asks for rmse .006 to VTK's march by default, for .004 with 1,024 slices and to the exact picture. The
//! thresholds here are what there is: what is left is values that are linear across polygons, whatever their number.

use std::sync::OnceLock;

use volery::{BackendChoice, GridData, Input, InputData};
use volery_io::read_png_rgb;
use volery_reference::Image;
use volery_tests::{
    Drawer, at_most, backend, data_folder, distance, exact, read_scene, scenes_folder, view_of, with_stack,
};

const MAX_RMSE_TO_VTK: f64 = 0.002;
const MAX_RMSE_TO_REFERENCE: f64 = 0.002;
const MAX_RMSE_BETWEEN_BACKENDS: f64 = 0.0005;

/// Slices of the fine picture.
const FINE: usize = 1024;

/// Pictures of one scene by one backend: by default, and fine.
type Pictures = [Image; 2];

/// Pictures of one scene, each made once and shared by its tests.
struct Scene {
    name: &'static str,
    reference: OnceLock<Image>,
    software: OnceLock<Pictures>,
    wgpu: OnceLock<Pictures>,
}

fn open(input: &Input, choice: BackendChoice, test: &str) -> Option<Drawer<GridData>> {
    let InputData::Grid(file) = &input.data else { panic!("{test}: is no grid") };
    let array = file.array.as_ref().map(|array| array.name.as_str());
    Some(Drawer::grid(file.grid.clone(), array, backend(choice, test)?).unwrap())
}

impl Scene {
    const fn new(name: &'static str) -> Self {
        Self { name, reference: OnceLock::new(), software: OnceLock::new(), wgpu: OnceLock::new() }
    }

    /// The pictures of a backend; `None` if the test is ignored.
    fn drawn(&self, choice: BackendChoice, test: &str) -> Option<&Pictures> {
        let data = data_folder(test)?;
        // Asked before what another test has drawn, so that each test without a GPU says so.
        backend(choice, test)?;
        let made = if choice == BackendChoice::Software { &self.software } else { &self.wgpu };
        Some(made.get_or_init(|| {
            let input = read_scene(&data, self.name);
            let mut session = open(&input, choice, test).expect("asked before");
            let view = view_of(&input);
            let fine = with_stack(&view, |stack| stack.num_slices = FINE);
            [view, fine].map(|view| exact(&session.render(&view).unwrap().image))
        }))
    }

    /// The exact picture; `None` if the test is ignored.
    fn reference(&self, test: &str) -> Option<&Image> {
        let data = data_folder(test)?;
        Some(self.reference.get_or_init(|| {
            let input = read_scene(&data, self.name);
            let mut session = open(&input, BackendChoice::Software, test).expect("software is everywhere");
            let view = view_of(&input);
            let mut picture = session.render(&view).unwrap();
            session.verify(&view, &mut picture, &|_| ()).unwrap()
        }))
    }

    fn is_near_vtk(&self, choice: BackendChoice, test: &str) {
        let Some(drawn) = self.drawn(choice, test) else { return };
        let data = data_folder(test).expect("asked before");
        let png = read_png_rgb(&scenes_folder(&data).join(format!("{}.vtk.png", self.name))).unwrap();
        let vtk = Image::from_f32(png.width, png.height, &png.pixels).unwrap();
        for (picture, what) in drawn.iter().zip(["by default", "fine"]) {
            let found = distance(&format!("{test}, {what}, to VTK"), picture, &vtk);
            at_most("rmse to VTK", found.rmse, MAX_RMSE_TO_VTK);
        }
    }

    fn is_near_reference(&self, choice: BackendChoice, test: &str) {
        let Some(drawn) = self.drawn(choice, test) else { return };
        let Some(reference) = self.reference(test) else { return };
        for (picture, what) in drawn.iter().zip(["by default", "fine"]) {
            let found = distance(&format!("{test}, {what}, to the reference"), picture, reference);
            at_most("rmse to the reference", found.rmse, MAX_RMSE_TO_REFERENCE);
        }
    }

    fn backends_agree(&self, test: &str) {
        let Some([wgpu, _]) = self.drawn(BackendChoice::Wgpu, test) else { return };
        let Some([software, _]) = self.drawn(BackendChoice::Software, test) else { return };
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

scenes! { bluntfin k3d_fem }
