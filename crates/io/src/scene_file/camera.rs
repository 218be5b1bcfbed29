//! Cameras in JSON.

use glam::DVec3;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use volery_scene::{Camera, Projection};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraJson {
    projection: ProjectionName,
    eye: [f64; 3],
    target: [f64; 3],
    up: [f64; 3],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    fov_y_deg: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    height: Option<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ProjectionName {
    Perspective,
    Orthographic,
}

impl CameraJson {
    fn new(camera: &Camera) -> Self {
        let (projection, fov_y_deg, height) = match camera.projection {
            Projection::Perspective { fov_y_deg } => (ProjectionName::Perspective, Some(fov_y_deg), None),
            Projection::Orthographic { height } => (ProjectionName::Orthographic, None, Some(height)),
        };
        let [eye, target, up] = [camera.eye, camera.target, camera.up].map(|vector| vector.to_array());
        Self { projection, eye, target, up, fov_y_deg, height }
    }

    fn validated(self) -> Result<Camera, String> {
        let projection = match (self.projection, self.fov_y_deg, self.height) {
            (ProjectionName::Perspective, Some(fov_y_deg), None) => Projection::Perspective { fov_y_deg },
            (ProjectionName::Orthographic, None, Some(height)) => Projection::Orthographic { height },
            (ProjectionName::Perspective, None, _) => {
                return Err(
                    "camera.fov_y_deg is missing, expected the full vertical angle of a perspective camera"
                        .to_owned(),
                );
            }
            (ProjectionName::Orthographic, _, None) => {
                return Err(
                    "camera.height is missing, expected the height of an orthographic picture in world units"
                        .to_owned(),
                );
            }
            (_, Some(_), Some(_)) => {
                return Err("camera.fov_y_deg and height are both there, expected fov_y_deg in perspective or height \
                            in an orthographic camera"
                    .to_owned());
            }
        };
        let [eye, target, up] = [self.eye, self.target, self.up].map(DVec3::from_array);
        let camera = Camera { eye, target, up, projection, is_mirrored: false };
        match camera.defects().into_iter().next() {
            None => Ok(camera),
            Some(defect) => Err(defect.to_string()),
        }
    }
}

/// Serialises a camera as scene files have it.
///
/// # Errors
/// Those of the serialiser.
pub fn serialize_camera<S: Serializer>(camera: &Camera, serializer: S) -> Result<S::Ok, S::Error> {
    CameraJson::new(camera).serialize(serializer)
}

pub(super) fn serialize<S: Serializer>(camera: &Option<Camera>, serializer: S) -> Result<S::Ok, S::Error> {
    camera.as_ref().map(CameraJson::new).serialize(serializer)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Camera>, D::Error> {
    let json = Option::<CameraJson>::deserialize(deserializer)?;
    json.map(CameraJson::validated).transpose().map_err(D::Error::custom)
}
