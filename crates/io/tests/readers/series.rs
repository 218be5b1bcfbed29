//! Collections of time steps.

use std::path::Path;

use volery_io::grid::{GridFormat, TimeStep, read_time_steps};
use volery_io::{GridFile, GridOptions, is_grid, read_grid};

use crate::Folder;
use crate::make_grid::{ASCII, usual_vtu};

fn collection(entries: &[&str]) -> String {
    let entries: String = entries.iter().map(|entry| format!("<DataSet {entry}/>")).collect();
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\"><Collection>{entries}</Collection></VTKFile>"
    )
}

#[track_caller]
fn steps(path: &Path) -> Vec<TimeStep> {
    read_time_steps(path).unwrap_or_else(|error| panic!("{error}"))
}

fn read(step: &TimeStep) -> Result<GridFile, String> {
    step.read(&GridOptions::default()).map_err(|error| error.to_string())
}

/// The usual grid, another value at its second point.
fn vtu_of(value: &str) -> String {
    String::from_utf8(usual_vtu(ASCII)).unwrap().replace(">0 1.5 3 4.5", &format!(">0 {value} 3 4.5"))
}

#[test]
fn steps_ascend_and_each_has_its_own_values() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("steps")).unwrap();
    folder.put("steps/b.vtu", vtu_of("7"));
    folder.put("steps/a.vtu", vtu_of("-2"));
    let text = collection(&[
        "timestep=\"10\" group=\"\" part=\"0\" file=\"steps/b.vtu\"",
        "timestep=\" -1.5e0\" file=\"steps/a.vtu\"",
    ]);
    let path = folder.put("a.pvd", text);
    let found = steps(&path);
    let expected = [(-1.5, "steps/a.vtu"), (10.0, "steps/b.vtu")];
    let expected = expected.map(|(time, file)| TimeStep { time, files: vec![folder.path(file)] });
    assert_eq!(found, expected);
    let second = |file: &GridFile| file.grid.arrays()[0].values.value(1, 0);
    assert_eq!([-2.0, 7.0], [0, 1].map(|step| second(&read(&found[step]).unwrap())));
    // The collection is the grid of its first step, whatever its name.
    let text = std::fs::read(&path).unwrap();
    for path in [path, folder.put("series.xml", text)] {
        assert!(is_grid(&path));
        let first = read_grid(&path, &GridOptions::default()).unwrap();
        assert_eq!((first.format, second(&first)), (GridFormat::Pvd, -2.0));
        assert!(
            first.notes.iter().any(|note| note
                .contains("the file holds 2 time steps; the first is used (another, 0 to 1, can be chosen)")),
            "{:?}",
            first.notes
        );
    }
}

#[test]
fn parts_of_a_step_are_joined() {
    let folder = Folder::new();
    folder.put("0.vtu", usual_vtu(ASCII));
    folder.put("1.vtu", vtu_of("2"));
    let text = collection(&["part=\"0\" file=\"0.vtu\"", "part=\"1\" file=\"1.vtu\""]);
    let found = steps(&folder.put("a.pvd", text));
    let file = read(&found[0]).unwrap();
    assert_eq!((found.len(), file.format, file.grid.points().len()), (1, GridFormat::Pvtu, 13));
    let line = |second: &str| {
        folder.put("1.vtu", second);
        read(&found[0]).unwrap_err()
    };
    let one = folder.path("1.vtu").display().to_string();
    assert!(line("<a").starts_with(&format!("{one}: the XML is damaged")));
    let wrong = line(&collection(&["file=\"0.vtu\""]));
    assert_eq!(wrong, format!("{one}: type is 'Collection', expected UnstructuredGrid"));
}

#[test]
fn what_is_no_series_is_refused_in_one_line() {
    let folder = Folder::new();
    let refuse = |text: String| read_time_steps(&folder.put("a.pvd", text)).unwrap_err().to_string();
    for (entries, words) in [
        (&[][..], "DataSet is missing, expected at least one"),
        (&["timestep=\"0\""], "file is missing, expected one for each DataSet"),
        (&["timestep=\"noon\" file=\"a.vtu\""], "timestep is 'noon', expected a finite number"),
        (&["timestep=\"nan\" file=\"a.vtu\""], "timestep is 'nan', expected a finite number"),
    ] {
        assert_eq!(refuse(collection(entries)), format!("{}: {words}", folder.path("a.pvd").display()));
    }
    assert!(refuse(collection(&[])[..60].to_owned()).contains("the XML is damaged"));
    // One that names itself, and one whose file is gone.
    for (file, words) in [
        ("a.pvd", "a.pvd: file is a collection, expected a grid of one time"),
        ("b.vtu", "b.vtu: cannot be read"),
    ] {
        let path = folder.put("a.pvd", collection(&[&format!("file=\"{file}\"")]));
        let line = read(&steps(&path)[0]).unwrap_err();
        assert!(line.contains(words) && !line.contains('\n'), "{line}");
        let line = read_grid(&path, &GridOptions::default()).unwrap_err().to_string();
        assert!(line.contains(words) && line.starts_with(&path.display().to_string()), "{line}");
    }
}

#[test]
fn repeated_steps_other_separators_and_surfaces_do_no_harm() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("sub")).unwrap();
    folder.put("sub/a.vtu", vtu_of("7"));
    folder.put("wall.vtp", "<VTKFile type=\"PolyData\"><PolyData/></VTKFile>");
    folder.put(
        "p.pvtu",
        "<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid><Piece Source=\"sub/a.vtu\"/></PUnstructuredGrid></VTKFile>",
    );
    let cells = |entries: &[&str]| {
        let file = read_grid(&folder.put("a.pvd", collection(entries)), &GridOptions::default());
        let file = file.unwrap_or_else(|error| panic!("{error}"));
        (file.grid.cells().len(), file.notes)
    };
    let (once, _) = cells(&["timestep=\"1\" file=\"sub/a.vtu\""]);
    let same = ["timestep=\"1\" part=\"0\" file=\"sub/a.vtu\""; 2];
    assert_eq!(cells(&same).0, once);
    assert_eq!(cells(&["timestep=\"1\" file=\"sub\\a.vtu\""]).0, once);
    let (found, notes) = cells(&[same[0], "timestep=\"1\" part=\"1\" file=\"wall.vtp\""]);
    assert_eq!(found, once);
    assert!(
        notes.iter().any(|note| note.ends_with("wall.vtp has no cells of volume, and is left out")),
        "{notes:?}"
    );
    assert_eq!(cells(&[same[0], "timestep=\"1\" part=\"1\" file=\"p.pvtu\""]).0, 2 * once);
    // A step that is asked for, and one that is not there.
    folder.put("b.vtu", vtu_of("9"));
    let path = folder.put("a.pvd", collection(&[same[0], "timestep=\"2\" file=\"b.vtu\""]));
    let options = |step| GridOptions { time_step: Some(step), ..GridOptions::default() };
    assert_eq!(read_grid(&path, &options(1)).unwrap().grid.arrays()[0].values.value(1, 0), 9.0);
    let line = read_grid(&path, &options(2)).unwrap_err().to_string();
    assert!(line.ends_with("time step asked for is 2, expected 0 to 1"), "{line}");
    let line = read_grid(&folder.path("b.vtu"), &options(1)).unwrap_err().to_string();
    assert!(line.ends_with("time step asked for is 1, expected 0: the file holds one"), "{line}");
}
