//! Scenes as files that `volery render` draws.

use std::error::Error;
use std::fs;
use std::path::Path;
use volery_tests::values_of;

use serde_json::{Value, json};
use volery::{Projection, SampleType, Samples, View};

use crate::scene::Scene;

/// Writes `NAME.json` and `NAME.raw` into a folder that exists.
pub(crate) fn save(scene: &Scene, name: &str, folder: &Path) -> Result<(), Box<dyn Error>> {
    let raw = format!("{name}.raw");
    let text = serde_json::to_string_pretty(&scene_json(scene, &raw))?;
    fs::write(folder.join(&raw), little_endian(scene.grid.samples()))?;
    fs::write(folder.join(format!("{name}.json")), text)?;
    Ok(())
}

fn scene_json(scene: &Scene, raw: &str) -> Value {
    let View { width, height, camera, background, .. } = &scene.view;
    let transfer = values_of(&scene.view);
    let (projection, measure, number) = match camera.projection {
        Projection::Perspective { fov_y_deg } => ("perspective", "fov_y_deg", fov_y_deg),
        Projection::Orthographic { height } => ("orthographic", "height", height),
    };
    let [eye, target, up] = [camera.eye, camera.target, camera.up].map(|v| v.to_array());
    let point = |p: &volery::ControlPoint| json!({"value": p.value, "color": p.color, "opacity": p.opacity});
    let points: Vec<Value> = transfer.points().iter().map(point).collect();
    json!({
        "input": {
            "kind": "volume",
            "file": raw,
            "dims": scene.grid.dims(),
            "dtype": dtype(scene.grid.sample_type()),
            "spacing": scene.grid.spacing().to_array(),
        },
        "size": [width, height],
        "background": background,
        "camera": {"projection": projection, measure: number, "eye": eye, "target": target, "up": up},
        "transfer_function": {"points": points, "unit_distance": transfer.unit_distance()},
    })
}

fn dtype(sample_type: SampleType) -> &'static str {
    match sample_type {
        SampleType::U8 => "|u1",
        SampleType::I8 => "|i1",
        SampleType::U16 => "<u2",
        SampleType::I16 => "<i2",
        SampleType::U32 => "<u4",
        SampleType::I32 => "<i4",
        SampleType::F32 => "<f4",
        _ => "<f8",
    }
}

fn little_endian(samples: &Samples) -> Vec<u8> {
    volery_scene::for_samples!(samples, |values| values.iter().flat_map(|v| v.to_le_bytes()).collect(); color _ => Vec::new())
}
