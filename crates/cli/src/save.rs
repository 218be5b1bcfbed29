//! `--save-scene`: a scene file that remakes a picture bit for bit.

use std::path::{Component, Path, PathBuf};

use volery::io::scene_file::{SceneFile, SceneMesh, SceneOrientation, ScenePlane, SceneTransfer};
use volery::{How, Plane, Transfer, View};

use crate::{Failure, wanted};

/// Writes what was wanted, with everything that was left open as it was found for this view; `orientation` is where the
/// samples of a file are that has a world of its own.
pub(crate) fn save_scene(
    path: &Path,
    wanted: &SceneFile,
    view: &View,
    (orientation, has_colors): (Option<SceneOrientation>, bool),
) -> Result<(), Failure> {
    let mut scene = wanted.clone();
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    scene.input.file = relative(folder, &scene.input.file);
    let mesh = |SceneMesh { file, color }: SceneMesh| SceneMesh { file: relative(folder, &file), color };
    scene.meshes = scene.meshes.into_iter().map(mesh).collect();
    scene.input.orientation = orientation.or(scene.input.orientation);
    scene.size = Some([view.width, view.height]);
    scene.background = Some(view.background);
    scene.camera = Some(view.camera);
    scene.technique = Some(wanted::technique_of(&view.how));
    let transfer = match &view.transfer {
        Transfer::Magnitudes(function) => SceneTransfer::Magnitudes(function.as_ref().clone()),
        Transfer::Values(transfer) => SceneTransfer::Values(transfer.clone()),
    };
    (scene.transfer, scene.range) = ((!has_colors).then_some(transfer), None);
    // An infinite quality is full resolution, as without a focus; JSON has no infinity.
    scene.focus = scene.focus.filter(|focus| focus.quality.is_finite());
    if let How::Planes(planes) = &view.how {
        let plane = |plane: &Plane| ScenePlane { normal: plane.normal.to_array(), distance: plane.distance };
        scene.planes = planes.planes.iter().map(plane).collect();
    }
    Ok(scene.write(path)?)
}

/// A file's path from a folder, or its full path where there is no way. Of the file's own name links are not followed,
/// since the name may say what the file holds.
fn relative(folder: &Path, file: &Path) -> PathBuf {
    let parent = file.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let (Ok(folder), Ok(parent)) = (folder.canonicalize(), parent.canonicalize()) else {
        return file.to_owned();
    };
    let Some(name) = file.file_name() else { return file.canonicalize().unwrap_or(file.to_owned()) };
    let steps = |path: &Path| path.components().map(|step| step.as_os_str().to_owned()).collect::<Vec<_>>();
    let (from, to) = (steps(&folder), steps(&parent));
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return parent.join(name);
    }
    let up = from[shared..].iter().map(|_| Component::ParentDir.as_os_str().to_owned());
    up.chain(to[shared..].iter().cloned()).collect::<PathBuf>().join(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_from_a_folder_leads_to_the_file() {
        let root = tempfile::tempdir().unwrap();
        let [scenes, data] = ["scenes/a", "data"].map(|name| root.path().join(name));
        std::fs::create_dir_all(&scenes).unwrap();
        std::fs::create_dir_all(&data).unwrap();
        std::fs::write(data.join("x"), "here").unwrap();
        let found = relative(&scenes, &data.join("x"));
        assert_eq!(found, Path::new("../../data/x"));
        assert_eq!(std::fs::read(scenes.join(found)).unwrap(), b"here");
        assert_eq!(relative(&data, &data.join("x")), Path::new("x"));
        assert_eq!(relative(&data, &data.join("gone/x")), data.join("gone/x"));
    }
}
