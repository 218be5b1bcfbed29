//! From what was done to the report of it.

use volery_frame::RayDoubt;

use super::{Plan, Session, Times, View};
use crate::ray_budget::RayBudget;
use crate::report::{self, Report};
use crate::technique::residency::Uploaded;

impl Session {
    pub(super) fn report(
        &self,
        view: &View,
        (plan, ray_doubt): (&Plan, Option<RayDoubt>),
        uploaded: Uploaded,
        times: &[Times],
    ) -> Report {
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
        let is_color = self.grid.sample_type().channels() > 1;
        Report {
            version: report::VERSION,
            inputs: Vec::new(),
            input: report::Input {
                path: None,
                kind: if dims[2] == 1 { "image" } else { "volume" },
                dims: Some(dims),
                cells: None,
                scalar: self.grid.sample_type().name(),
                place: None,
            },
            technique: self.technique.name(),
            thickness: matches!(plan, Plan::Cubes(_)).then(|| view.thickness.name()),
            backend: report::Backend::of(self.backend.device()),
            image: report::ImageSize { width: view.width, height: view.height },
            camera: view.camera,
            transfer_function: (!is_color).then(|| report::transfer_of(view)),
            seconds: Times::median(times, self.build_seconds),
            frames: Times::frames(times),
            work: report::Work {
                nodes: Some(nodes_by_level.iter().sum()),
                nodes_by_level: Some(nodes_by_level),
                bricks: Some(uploaded.bricks),
                bytes_resident: self.backend.resident_bytes(),
                bytes_uploaded: uploaded.bytes,
                polygons: planes.map(|plan| plan.num_polygons),
                slices: None,
                triangles: match plan {
                    Plan::Cubes(plan) => Some(plan.num_triangles(&self.volume, &view.camera)),
                    Plan::Rays(_) | Plan::Planes(_) => None,
                },
            },
            dial: (dial != report::Dial::default()).then_some(dial),
            error: self.error(plan, ray_doubt),
        }
    }

    /// What is known of the error without the truth.
    fn error(&self, plan: &Plan, ray_doubt: Option<RayDoubt>) -> Option<report::Error> {
        let none = report::Error::default();
        match (plan, &self.transfer, ray_doubt) {
            (Plan::Planes(plan), ..) => Some(report::Error {
                bound_max: Some(plan.bound_max),
                bound_against: Some("full resolution"),
                ..none
            }),
            (Plan::Rays(_), Some((_, transfer)), Some(doubt)) => {
                Some(report::Error { budget: Some(RayBudget::new(transfer, &self.volume, doubt)), ..none })
            }
            _ => None,
        }
    }
}
