//! The suite of `volery-conformance` on this machine's best device, and what only this backend's limits ask for.
//!
//! Without a device every test fails, unless `VOLERY_WITHOUT_GPU` is set: then all are counted as ignored.

mod cubes;
mod embed;
mod sheets;

use libtest_mimic::{Arguments, Failed, Trial};
use volery_conformance::{ALL, Property};
use volery_frame::Image;
use volery_wgpu::WgpuBackend;

fn main() {
    let mut arguments = Arguments::from_args();
    // One device; its memory and its threads are not to be shared.
    arguments.test_threads = Some(1);
    let without_gpu = std::env::var_os("VOLERY_WITHOUT_GPU").is_some();
    let trials = ALL
        .iter()
        .chain(cubes::ALL)
        .chain(sheets::ALL)
        .chain(embed::ALL)
        .map(|&property| trial(property).with_ignored_flag(without_gpu))
        .collect();
    let conclusion = libtest_mimic::run(&arguments, trials);
    if without_gpu {
        println!("ignored: {} GPU tests (VOLERY_WITHOUT_GPU)", conclusion.num_ignored);
    }
    conclusion.exit();
}

fn trial((name, check): Property) -> Trial {
    Trial::test(name, move || {
        let mut backend = WgpuBackend::new().map_err(|error| Failed::from(error.to_string()))?;
        check(&mut backend);
        Ok(())
    })
}

/// The largest difference from what a pixel should be.
fn difference(image: &Image, expected: impl Fn(usize) -> f64) -> f64 {
    let differences = image.pixels.iter().enumerate().flat_map(|(place, pixel)| {
        let expected = expected(place);
        pixel.map(|part| (f64::from(part) - expected).abs())
    });
    differences.fold(0.0, f64::max)
}
