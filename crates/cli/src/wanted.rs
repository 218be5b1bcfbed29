//! What a picture shall be: the scene, and over it what the command line says.

use std::fmt;

use volery::fit;
use volery::glam::DVec3;
use volery::io::scene_file::{
    SceneBackend, SceneFile, SceneFocus, SceneInput, SceneInterest, ScenePlane, SceneSphere, SceneTechnique,
    SceneThickness, SceneTransfer,
};
use volery::io::transfer::{TransferError, TransferOptions, TransferProblem};
use volery::io::{World, one_of, read_transfer, read_transfer_2d};
use volery::{
    Data, Deadline, Dial, Focus, How, Input, InputData, Interest, Plane, PlaneView, Preset, Region, Sampling,
    Session, Slicing, StackView, Thickness, View, ViewOptions,
};

use crate::Failure;
use crate::args::{BackendName, PlaneName, RenderArgs, Technique, Transfer};

/// An option that one technique alone reads, as the command line or a scene writes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Given {
    name: &'static str,
    is_of_scene: bool,
    pub(crate) technique: SceneTechnique,
}

impl fmt::Display for Given {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, is_of_scene, .. } = self;
        match name.strip_prefix("--") {
            Some(field) if *is_of_scene => f.write_str(&field.replace('-', "_")),
            _ => f.write_str(name),
        }
    }
}

/// How a technique is called on the command line.
pub(crate) fn name_of(technique: SceneTechnique) -> &'static str {
    match technique {
        SceneTechnique::Raycast => "raycast",
        SceneTechnique::Plane => "plane",
        SceneTechnique::Fans => "fans",
        SceneTechnique::Stack => "stack",
    }
}

/// The technique by which a view is drawn, as a scene names it.
pub(crate) fn technique_of(how: &How) -> SceneTechnique {
    match how {
        How::Raycast => SceneTechnique::Raycast,
        How::Planes(_) => SceneTechnique::Plane,
        How::Fans(_) => SceneTechnique::Fans,
        How::Stack(_) | How::Slices { .. } => SceneTechnique::Stack,
    }
}

/// What is wanted of a technique.
pub(crate) fn how(wanted: &SceneFile, technique: SceneTechnique) -> How {
    match technique {
        SceneTechnique::Raycast => How::Raycast,
        SceneTechnique::Plane => How::Planes(plane_view(wanted)),
        SceneTechnique::Fans => How::Fans(match wanted.thickness {
            Some(SceneThickness::Interpolated) => Thickness::Interpolated,
            Some(SceneThickness::Exact) | None => Thickness::Exact,
        }),
        SceneTechnique::Stack => How::Stack(stack_view(wanted)),
    }
}

/// What is given that one technique alone reads.
pub(crate) fn given(wanted: &SceneFile, is_of_scene: bool) -> Vec<Given> {
    use SceneTechnique::{Fans, Plane, Stack};
    let options = [
        ("--plane", !wanted.planes.is_empty(), Plane),
        ("--focus", wanted.focus.is_some(), Plane),
        ("--transparent", wanted.transparent, Plane),
        ("--nearest", wanted.nearest, Plane),
        ("--show-nodes", wanted.show_nodes, Plane),
        ("--thickness", wanted.thickness.is_some(), Fans),
        ("--slices", wanted.slices.is_some(), Stack),
        ("--adaptive", wanted.adaptive.is_some(), Stack),
        ("--axes", wanted.axes, Stack),
        ("--quantized", wanted.quantized, Stack),
        ("--shade", wanted.shade, Stack),
    ];
    let given = options.into_iter().filter(|(_, is_given, _)| *is_given);
    given.map(|(name, _, technique)| Given { name, is_of_scene, technique }).collect()
}

/// Why options that one technique alone reads cannot stand together, or beside the technique asked for.
pub(crate) fn conflict(wanted: &SceneFile, is_of_scene: bool) -> Option<String> {
    let dials = [
        ("tolerance", wanted.tolerance.is_some()),
        ("error", wanted.error.is_some()),
        (if is_of_scene { "budget_ms" } else { "budget-ms" }, wanted.budget_ms.is_some()),
        ("memory", wanted.memory.is_some()),
    ];
    let mut turned = dials.iter().filter(|(_, is_turned)| *is_turned).map(|(name, _)| name);
    if let (Some(first), Some(second)) = (turned.next(), turned.next()) {
        let prefix = if is_of_scene { "" } else { "--" };
        return Some(format!("{prefix}{first} and {prefix}{second} exclude each other, expected one dial"));
    }
    if is_of_scene && wanted.gaze.is_some() && wanted.budget_ms.is_none() {
        return Some("gaze is read with budget_ms alone".to_owned());
    }
    if is_of_scene && !wanted.interest.is_empty() && wanted.memory.is_none() {
        return Some("interest is read with memory alone".to_owned());
    }
    let given = given(wanted, is_of_scene);
    let alone =
        |option: &Given| format!("{option} is read by --technique {} alone", name_of(option.technique));
    // What suits an input may be planes or a stack, but never fans.
    let technique = wanted.technique;
    let is_unread = |option: &&Given| match technique {
        None => option.technique == SceneTechnique::Fans,
        Some(technique) => option.technique != technique,
    };
    if let Some(option) = given.iter().find(is_unread) {
        return Some(alone(option));
    }
    let first = given.first()?;
    let other = given.iter().find(|other| other.technique != first.technique)?;
    Some(format!("{}, {first} is not", alone(other)))
}

/// The scene with what the command line says in its place. `input` is of the data themselves.
pub(crate) fn over(args: &RenderArgs, scene: Option<&SceneFile>, input: SceneInput) -> SceneFile {
    let scene = scene.cloned().unwrap_or_default();
    let (planes, stack) = (&args.planes, &args.stack);
    // Those by name have a place once the data are known: `place_planes`.
    let plane = |plane: &PlaneName| match *plane {
        PlaneName::Equation(Plane { normal, distance }) => ScenePlane { normal: normal.to_array(), distance },
        PlaneName::Anatomical { normal, .. } => ScenePlane { normal: normal.to_array(), distance: 0.0 },
    };
    let own_planes: Vec<_> = planes.planes.iter().map(plane).collect();
    let focus = planes.focus.map(|point| SceneFocus { point: point.to_array(), quality: planes.quality });
    let preset = match &args.transfer {
        Some(Transfer::Preset(preset)) => Some(SceneTransfer::Preset(preset.name().to_owned())),
        Some(Transfer::File(_)) | None => None,
    };
    SceneFile {
        name: scene.name,
        input,
        size: args.size.or(scene.size),
        background: args.background.or(scene.background),
        // A view of its own goes before a camera.
        camera: scene.camera.filter(|_| args.view.is_none()),
        transfer: if args.transfer.is_some() { preset } else { scene.transfer },
        range: args.range.or(scene.range),
        technique: scene_technique(args.technique).or(scene.technique),
        tolerance: args.tolerance.or(scene.tolerance),
        budget_ms: args.budget_ms.or(scene.budget_ms),
        gaze: args.gaze.or(scene.gaze),
        memory: args.memory.or(scene.memory),
        interest: if args.interest.is_empty() { scene.interest } else { args.interest.clone() },
        planes: if own_planes.is_empty() { scene.planes } else { own_planes },
        focus: focus.or(scene.focus),
        error: args.error.or(scene.error),
        transparent: planes.transparent || scene.transparent,
        nearest: planes.nearest || scene.nearest,
        show_nodes: planes.show_nodes || scene.show_nodes,
        thickness: args.thickness.map(SceneThickness::from).or(scene.thickness),
        slices: stack.slices.or(scene.slices),
        adaptive: stack.adaptive.or(scene.adaptive),
        axes: stack.axes || scene.axes,
        shade: stack.shade || scene.shade,
        quantized: stack.quantized || scene.quantized,
        backend: scene_backend(args.backend).or(scene.backend),
        meshes: scene.meshes,
    }
}

fn scene_technique(technique: Technique) -> Option<SceneTechnique> {
    match technique {
        Technique::Auto => None,
        Technique::Raycast => Some(SceneTechnique::Raycast),
        Technique::Plane => Some(SceneTechnique::Plane),
        Technique::Fans => Some(SceneTechnique::Fans),
        Technique::Stack => Some(SceneTechnique::Stack),
    }
}

fn scene_backend(backend: BackendName) -> Option<SceneBackend> {
    match backend {
        BackendName::Auto => None,
        BackendName::Software => Some(SceneBackend::Software),
        BackendName::Wgpu => Some(SceneBackend::Wgpu),
    }
}

/// The view that is wanted of a session's data.
pub(crate) fn view<D: Data>(
    args: &RenderArgs,
    wanted: &SceneFile,
    input: &Input,
    session: &Session<D>,
    mut how: How,
) -> Result<View, Failure> {
    check_applies(args, wanted, input, session)?;
    let range = wanted.range.or_else(|| window(args, wanted, input, session));
    let transfer = match load_transfer(args, wanted, session)? {
        None => None,
        Some(SceneTransfer::Values(function)) => Some(function.into()),
        Some(SceneTransfer::Magnitudes(function)) => {
            if let How::Stack(StackView { is_lit, .. }) | How::Slices { is_lit } = &mut how {
                *is_lit = true;
            }
            Some(volery::Transfer::Magnitudes(function.into()))
        }
        Some(SceneTransfer::Preset(name)) => {
            let preset = Preset::from_name(&name).ok_or_else(|| unknown_preset(&name))?;
            Some(session.data().preset_over(preset, range).into())
        }
    };
    let world = session.data().world();
    let direction = args.view.map(|view| view.direction(world, args.up.unwrap_or(DVec3::Z))).transpose();
    let direction = direction.map_err(|problem| Failure::of_file(&input.path, problem))?;
    let defaults = ViewOptions::default();
    let [width, height] = wanted.size.unwrap_or([defaults.width, defaults.height]);
    let options = ViewOptions {
        width,
        height,
        direction,
        up: args.up,
        orthographic: args.orthographic,
        transfer,
        range,
        how: Some(how),
    };
    let mut view = session.view(&options);
    if let Some(camera) = wanted.camera {
        view.camera = if args.orthographic { fit::orthographic(&camera) } else { camera };
        view.camera.up = args.up.unwrap_or(camera.up);
    }
    view.background = wanted.background.unwrap_or(view.background);
    view.dial = dial(wanted);
    view.interest = wanted.interest.iter().filter_map(interest).collect();
    view.meshes = input.meshes.clone();
    Ok(view)
}

/// A region of a scene, which has been checked.
fn interest(&SceneInterest { corners, sphere, weight }: &SceneInterest) -> Option<Interest> {
    let of_box = |[low, high]: [[f64; 3]; 2]| Region::Box { low: low.into(), high: high.into() };
    let of_sphere =
        |SceneSphere { center, radius }| Region::Sphere { center: DVec3::from_array(center), radius };
    let region = corners.map(of_box).or(sphere.map(of_sphere))?;
    Some(Interest { region, weight })
}

/// The dial of a scene without conflicts.
fn dial(wanted: &SceneFile) -> Dial {
    let deadline = |budget| Deadline { budget_secs: 1e-3 * budget, gaze: wanted.gaze };
    let tolerance = wanted.tolerance.map(Dial::Tolerance);
    let others = || wanted.error.map(Dial::Error).or(wanted.memory.map(Dial::Memory));
    tolerance.or_else(others).or(wanted.budget_ms.map(deadline).map(Dial::Deadline)).unwrap_or_default()
}

/// The values that the file asks to show, where nothing else says over which ones automatic colours run, and the data
/// have some of them.
pub(crate) fn window<D: Data>(
    args: &RenderArgs,
    wanted: &SceneFile,
    input: &Input,
    session: &Session<D>,
) -> Option<[f64; 2]> {
    let is_automatic = match (&args.transfer, &wanted.transfer) {
        (Some(Transfer::File(_)), _) => false,
        (_, None) => true,
        (_, Some(SceneTransfer::Preset(name))) => Preset::from_name(name).is_some_and(Preset::is_automatic),
        (_, Some(_)) => false,
    };
    if wanted.range.is_some() || session.data().has_colors() || !is_automatic {
        return None;
    }
    let [lowest, highest] = session.value_range();
    let [low, high] = input.volume().ok()?.display_range?;
    (low < high && low <= highest && lowest <= high).then_some([low, high])
}

/// Refuses options that the data, or the transfer function, have no use for.
fn check_applies<D: Data>(
    args: &RenderArgs,
    wanted: &SceneFile,
    input: &Input,
    session: &Session<D>,
) -> Result<(), Failure> {
    let own_colors = |option: &str, expected: &str| {
        let problem = format!("samples are colours of their own, expected {expected} for {option}");
        Err(Failure::of_file(&input.path, problem))
    };
    if session.data().has_colors() {
        let number = "one channel of numbers";
        if args.transfer.is_some() {
            return own_colors("--transfer", number);
        }
        if args.range.is_some() {
            return own_colors("--range", number);
        }
        let is_opaque = matches!(&input.data, InputData::Volume(volume)
            if volume.grid.sample_type().channels() == 3);
        if wanted.transparent && is_opaque {
            return own_colors("--transparent", "samples with an opacity");
        }
    }
    let fixed = match (&args.transfer, &wanted.transfer) {
        (Some(Transfer::File(_)), _) | (_, None) => None,
        (_, Some(SceneTransfer::Preset(name))) => {
            Preset::from_name(name).filter(|preset| !preset.is_automatic()).map(|_| name.clone())
        }
        (_, Some(_)) => Some("transfer_function of the scene".to_owned()),
    };
    match fixed.filter(|_| wanted.range.is_some()) {
        Some(name) => Err(has_own_values(&name)),
        None => Ok(()),
    }
}

fn has_own_values(name: &str) -> Failure {
    Failure::undone(format!(
        "{name} has values of its own, expected automatic colours or a colour map for --range"
    ))
}

fn unknown_preset(name: &str) -> Failure {
    let names: Vec<_> = Preset::all().map(Preset::name).collect();
    let (name, known) = (name.escape_debug(), one_of(name, &names));
    Failure::undone(format!("transfer function '{name}' is unknown, expected one of {known}"))
}

/// Puts planes that the command line names where they are in data of a world with that middle.
pub(crate) fn place_planes(
    args: &RenderArgs,
    how: &mut How,
    (world, middle): (World, DVec3),
) -> Result<(), String> {
    if let How::Planes(planes) = how
        && !args.planes.planes.is_empty()
    {
        let own = args.planes.planes.iter().map(|name| name.plane(world, middle));
        planes.planes = own.collect::<Result<_, _>>()?;
    }
    Ok(())
}

fn plane_view(wanted: &SceneFile) -> PlaneView {
    let plane = |plane: &ScenePlane| Plane { normal: plane.normal.into(), distance: plane.distance };
    let focus = |SceneFocus { point, quality }| Focus { point: DVec3::from_array(point), quality };
    PlaneView {
        planes: wanted.planes.iter().map(plane).collect(),
        focus: wanted.focus.map(focus),
        sampling: if wanted.nearest { Sampling::Nearest } else { Sampling::Linear },
        is_transparent: wanted.transparent,
        shows_nodes: wanted.show_nodes,
    }
}

fn stack_view(wanted: &SceneFile) -> StackView {
    let defaults = StackView::default();
    StackView {
        slicing: if wanted.axes { Slicing::Axes } else { Slicing::Immediate },
        num_slices: wanted.slices.map_or(defaults.num_slices, |slices| slices as usize),
        adaptive: wanted.adaptive,
        is_lit: wanted.shade,
        is_quantized: wanted.quantized,
    }
}

/// The transfer function of the command line's file, or else of the scene.
fn load_transfer<D: Data>(
    args: &RenderArgs,
    wanted: &SceneFile,
    session: &Session<D>,
) -> Result<Option<SceneTransfer>, Failure> {
    let Some(Transfer::File(path)) = &args.transfer else { return Ok(wanted.transfer.clone()) };
    let options = TransferOptions {
        map: args.color_map.as_deref(),
        range: Some(wanted.range.unwrap_or(session.value_range())),
        unit_distance: volery::transfer::unit_distance(session.extent()),
    };
    match read_transfer(path, &options) {
        Ok(named) if !named.is_stretched && wanted.range.is_some() => {
            Err(has_own_values(&path.display().to_string()))
        }
        Ok(named) => Ok(Some(SceneTransfer::Values(named.transfer))),
        Err(TransferError { problem: TransferProblem::HasMagnitudes, .. })
            if session.data().has_magnitudes() =>
        {
            Ok(Some(SceneTransfer::Magnitudes(read_transfer_2d(path)?)))
        }
        Err(error @ TransferError { problem: TransferProblem::Choice { .. }, .. }) => {
            Err(Failure::undone(format!("{error} for --color-map")))
        }
        Err(error) => Err(error.into()),
    }
}
