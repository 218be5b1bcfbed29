//! From what was done to the report of it.

use volery_frame::DeviceKind;

use super::{Plan, Session, Times, View};
use crate::report::{self, Report};
use crate::technique::residency::Uploaded;

impl Session {
    pub(super) fn report(&self, view: &View, plan: &Plan, uploaded: Uploaded, times: &[Times]) -> Report {
        let device = self.backend.device();
        let mut sorted: Vec<&Times> = times.iter().collect();
        sorted.sort_by(|a, b| a.frame().total_cmp(&b.frame()));
        let median = sorted[(sorted.len() - 1) / 2];
        let dims = self.grid.dims();
        let planes = match plan {
            Plan::Rays(_) | Plan::Cubes(_) => None,
            Plan::Planes(plan) => Some(plan),
        };
        let nodes_by_level = plan.nodes_by_level();
        let focus = view.planes.focus.filter(|_| planes.is_some());
        let dial = report::Dial {
            tolerance: view.tolerance,
            error: view.planes.max_error.filter(|_| planes.is_some()),
            quality: focus.map(|focus| focus.quality),
        };
        Report {
            input: report::Input {
                path: None,
                kind: if dims[2] == 1 { "image" } else { "volume" },
                dims,
                scalar: self.grid.sample_type().name(),
            },
            technique: self.technique.name(),
            thickness: matches!(plan, Plan::Cubes(_)).then(|| view.thickness.name()),
            backend: report::Backend {
                kind: match device.kind {
                    DeviceKind::Software => "software",
                    DeviceKind::Gpu | DeviceKind::CpuDevice => "wgpu",
                },
                device: device.name,
            },
            image: report::ImageSize { width: view.width, height: view.height },
            seconds: report::Seconds {
                load: None,
                build: self.build_seconds,
                select: median.select,
                upload: median.upload,
                draw: median.draw,
                frame: median.frame(),
            },
            frames: times.iter().map(|times| report::Frame { seconds: times.frame() }).collect(),
            work: report::Work {
                nodes: nodes_by_level.iter().sum(),
                nodes_by_level,
                bricks: uploaded.bricks,
                bytes_resident: self.backend.resident_bytes(),
                bytes_uploaded: uploaded.bytes,
                polygons: planes.map(|plan| plan.num_polygons),
                triangles: match plan {
                    Plan::Cubes(plan) => Some(plan.num_triangles(&self.volume, &view.camera)),
                    Plan::Rays(_) | Plan::Planes(_) => None,
                },
            },
            dial: (dial != report::Dial::default()).then_some(dial),
            error: planes.map(|plan| report::Error { bound_max: Some(plan.bound_max), measured: None }),
        }
    }
}
