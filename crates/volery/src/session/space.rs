//! From the world to the space of the data.
//!
//! A view is in the world; techniques, pyramids and backends know the space of the data alone, where sample `(i, j, k)`
//! is at its index times the spacing. Here, and nowhere else, the one becomes the other: camera, planes, focus, regions
//! of interest and meshes. Lengths are the same in both, so nothing else changes.

use std::borrow::Cow;
use std::sync::Arc;

use volery_scene::{Placement, Revision, TriangleMesh};

use crate::view::{Focus, How, PlaneView, View};

/// The meshes of the last view that had some, and what they are in space: backends know them by their revisions.
#[derive(Default)]
pub(super) struct Space {
    meshes: Option<(Vec<Revision>, Arc<[TriangleMesh]>)>,
}

impl Space {
    /// A view as techniques and backends see it.
    pub(super) fn view<'v>(&mut self, placement: &Placement, view: &'v View) -> Cow<'v, View> {
        if placement.is_identity() {
            return Cow::Borrowed(view);
        }
        let how = match &view.how {
            How::Planes(planes) => How::Planes(PlaneView {
                planes: planes.planes.iter().map(|plane| placement.plane_to_grid(plane)).collect(),
                focus: planes.focus.map(|focus| Focus { point: placement.to_grid(focus.point), ..focus }),
                ..*planes
            }),
            other => other.clone(),
        };
        let camera = placement.camera_to_grid(&view.camera);
        let interest = view.interest.iter().map(|interest| interest.moved(|point| placement.to_grid(point)));
        let meshes = self.meshes(placement, &view.meshes);
        Cow::Owned(View { camera, meshes, how, interest: interest.collect(), ..view.clone() })
    }

    fn meshes(&mut self, placement: &Placement, meshes: &[TriangleMesh]) -> Arc<[TriangleMesh]> {
        let revisions: Vec<_> = meshes.iter().map(TriangleMesh::revision).collect();
        match &self.meshes {
            Some((known, kept)) if *known == revisions => kept.clone(),
            _ => {
                let moved: Arc<[_]> = meshes.iter().map(|mesh| placement.mesh_to_grid(mesh)).collect();
                self.meshes = Some((revisions, moved.clone()));
                moved
            }
        }
    }
}
