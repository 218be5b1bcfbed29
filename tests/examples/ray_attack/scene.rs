//! A scene by chance, its picture and the truth.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use rayon::prelude::*;
use volery::glam::DVec3;
use volery::{How, View, VoxelGrid};
use volery_reference::metrics::compare;
use volery_reference::{Image, Tracer};
use volery_tests::{Drawer, Shared, exact, matter_view, values_of};

use crate::camera::{VIEWS, camera, size};
use crate::random::Random;
use crate::transfer::{Transfer, spacing};
use crate::volume::Volume;

/// What the truth may miss in an interval of a ray. Far below what is looked for; the default of 1e-13 takes several
/// times as long.
const TRUTH_TOLERANCE: f64 = 1e-9;

/// Pictures that differ less from the background show no matter.
const VISIBLE: f64 = 1e-4;

/// A volume and a view of it.
pub(crate) struct Scene {
    pub(crate) index: u64,
    pub(crate) grid: VoxelGrid,
    pub(crate) view: View,
    /// One of each aspect.
    pub(crate) families: Vec<String>,
}

impl Scene {
    /// Scene `index` of a seed.
    pub(crate) fn random(seed: u64, index: u64) -> Self {
        let random = &mut Random::new(seed, index);
        let view_name = random.pick(&VIEWS);
        let (spacing_name, spacing) = spacing(random, view_name == "faces");
        let volume = Volume::random(random, spacing);
        let transfer = Transfer::random(random, &volume);
        let size = size(random);
        let camera = camera(random, view_name, volume.grid.extent(), spacing, size);
        let view = matter_view(camera, transfer.function, random.color(), size);
        let families = [
            ("type", volume.grid.sample_type().name()),
            ("shape", volume.shape),
            ("values", volume.values),
            ("transfer", transfer.form),
            ("density", transfer.density),
            ("spacing", spacing_name),
            ("view", view_name),
        ];
        let families = families.map(|(aspect, family)| format!("{aspect} {family}")).to_vec();
        Self { index, grid: volume.grid, view, families }
    }

    /// The true picture; `None` where it takes longer than it may.
    pub(crate) fn truth(&self, most: Duration) -> Option<Image> {
        let View { width, height, background, .. } = self.view;
        let tracer = Tracer::new(&self.grid, values_of(&self.view)).expect("samples are numbers");
        let tracer = tracer.with_tolerance(TRUTH_TOLERANCE);
        let rays = self.view.camera.rays(width, height);
        let end = Instant::now() + most;
        let pixel = |index: u32| {
            let ray = rays.pixel(index % width, index / width);
            (Instant::now() < end).then(|| tracer.trace(&ray).over(background))
        };
        let pixels: Option<Vec<_>> = (0..width * height).into_par_iter().map(pixel).collect();
        Some(Image::new(width, height, pixels?).expect("one colour of each pixel"))
    }

    /// Draws the scene and compares.
    pub(crate) fn measure(&self, backend: &Shared, truth: &Image) -> Outcome {
        match catch_unwind(AssertUnwindSafe(|| self.drawn(backend, truth))) {
            Ok(Ok(measured)) => Outcome::Measured(measured),
            Ok(Err(refusal)) => Outcome::Refused(refusal),
            Err(_) => Outcome::Panicked,
        }
    }

    fn drawn(&self, backend: &Shared, truth: &Image) -> Result<Measured, String> {
        let start = Instant::now();
        let mut session = Drawer::volume(self.grid.clone(), Box::new(backend.clone()), How::Raycast)
            .map_err(|error| error.to_string())?;
        let picture = session.render(&self.view).map_err(|error| error.to_string())?;
        let seconds = start.elapsed().as_secs_f64();
        let found = compare(&exact(&picture.image), truth).map_err(|error| error.to_string())?;
        // No number is the worst of all.
        let or_infinite = |x: f64| if x.is_nan() { f64::INFINITY } else { x };
        Ok(Measured {
            max: or_infinite(found.max),
            rmse: or_infinite(found.rmse),
            // Where no brick holds matter nothing is drawn but the background, in f32.
            stated: picture
                .report
                .error
                .and_then(|error| error.budget)
                .map_or(f64::from(f32::EPSILON), |budget| budget.max),
            seconds,
        })
    }

    /// Whether there is something to see but the background.
    pub(crate) fn shows_matter(&self, truth: &Image) -> bool {
        let background = DVec3::from_array(self.view.background);
        truth
            .pixels()
            .iter()
            .any(|&pixel| (DVec3::from_array(pixel) - background).abs().max_element() > VISIBLE)
    }
}

/// What became of a picture.
pub(crate) enum Outcome {
    Measured(Measured),
    /// With the reason given.
    Refused(String),
    Panicked,
}

/// A picture beside the truth.
#[derive(Clone, Copy)]
pub(crate) struct Measured {
    /// Largest difference of a channel of a pixel.
    pub(crate) max: f64,
    pub(crate) rmse: f64,
    /// The largest error that the report admits before any comparison.
    pub(crate) stated: f64,
    /// From the samples to the picture, the pyramid included.
    pub(crate) seconds: f64,
}

impl Measured {
    /// Whether it is farther from the truth than the report admits.
    pub(crate) fn is_understated(&self) -> bool {
        self.max > self.stated
    }
}
