//! The command line.

use std::path::{Path, PathBuf};

use clap::builder::{OsStringValueParser, PathBufValueParser, TypedValueParser};
use clap::error::ErrorKind;
use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};
use volery::glam::DVec3;
use volery::io::one_of;
use volery::io::scene_file::{SceneInput, SceneInterest, SceneSphere, SceneThickness};
use volery::{BackendChoice, Preset, View};

use crate::wanted;
use place::{parse_from, parse_plane, parse_up};

mod file;
mod place;
mod series;
mod slice;
mod stack;

pub(crate) use file::{ChoiceArgs, FileArgs};
pub(crate) use place::{Orientation, PlaneName, ViewFrom};
pub(crate) use series::numbered;
pub(crate) use slice::SliceArgs;
pub(crate) use stack::StackArgs;

/// Draws scientific volumes and says how far the picture is from the truth.
#[derive(Debug, Parser)]
#[command(name = "volery", version, max_term_width = 110, arg_required_else_help = false)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Threads to use; as many as there are cores if missing
    #[arg(long, value_name = "N", global = true, value_parser = whole(1024))]
    pub(crate) threads: Option<u32>,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Draw a volume or an unstructured grid
    Render(Box<RenderArgs>),
    /// Say what a file is: kind, dims, type, spacing, range, histogram
    Info(InfoArgs),
    /// Slice an unstructured grid by parallel planes, into a file that is small
    Slice(SliceArgs),
    /// Draw generated volumes in every way there is; needs no file
    Demo(DemoArgs),
}

/// `volery render`
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  volery render head.nii.gz -o head.png
  volery render engine_256x256x128_uint8.raw -o engine.exr --view 35,20,1.5 --transfer viridis
  volery render scene.json --data volumes -o scene.png --tolerance 0.02 --verify --report scene.report.json
  volery render head.nii.gz -o cut.png --technique plane --plane 0.3,0.5,0.81,120 --focus 90,80,60
  volery render photo.png -o focus.png --technique plane --focus 200,150 --show-nodes
  volery render wing.vtu -o wing.png --array Density --slices 512 --verify
  volery render wing.vtu -o wing-%03d.png --time-steps wing.pvd

Transfer functions by name: auto, ramp, ct-bone, ct-soft-tissue (both in Hounsfield units), mri,
and the colour maps grayscale, viridis, inferno, plasma, magma, turbo, cool-to-warm, black-body.
A file holds control points as a scene does, or a colour map that ParaView saved.")]
pub(crate) struct RenderArgs {
    /// A scene file; a volume: .raw (.gz, .zst), .nii (.gz), .nrrd, .nhdr, .mha, .mhd, .vti, .tif, a folder of
    /// slices; a grid: .vtu, .pvtu, .pvd, .vtk, .ex2; or slices of one: .vsl, .glb
    #[arg(value_name = "SCENE.json|FILE")]
    pub(crate) input: PathBuf,
    /// The picture: 8 bits as .png, 32-bit floats as .exr
    #[arg(short, long, value_name = "OUT.png|OUT.exr",
        value_parser = PathBufValueParser::new().try_map(|path| with_ending(path, &["png", "exr"])))]
    pub(crate) output: PathBuf,
    /// How to draw
    #[arg(long, value_enum, default_value_t = Technique::Auto)]
    pub(crate) technique: Technique,
    #[command(flatten)]
    pub(crate) file: FileArgs,
    /// Width and height of the picture in pixels [default: the scene's, else 768x768]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(crate) size: Option<[u32; 2]>,
    /// From where to look, in degrees or by name (front, back, left, right, top, bottom; of anatomical files anterior,
    /// posterior, superior, inferior, too), and how near [default: the scene's, else front for anatomical files, else
    /// 35,22,1]
    #[arg(long, value_name = "AZIMUTH,ELEVATION|SIDE[,ZOOM]", value_parser = parse_from, allow_hyphen_values = true)]
    pub(crate) view: Option<ViewFrom>,
    /// What is up in the picture, as a direction of the world [default: the scene's, else 0,0,1]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_up, allow_hyphen_values = true)]
    pub(crate) up: Option<DVec3>,
    /// Where samples are: where their file says (right, anterior, superior of anatomical files), or at their index times
    /// the spacing [default: the scene's, else index for scenes and file for other files]
    #[arg(long, value_enum, value_name = "WORLD")]
    pub(crate) orientation: Option<Orientation>,
    /// Parallel rays in place of perspective
    #[arg(long)]
    pub(crate) orthographic: bool,
    /// Values to colour and opacity [default: the scene's, else auto]
    #[arg(long, value_name = "FILE.json|PRESET",
        value_parser = OsStringValueParser::new().try_map(parse_transfer))]
    pub(crate) transfer: Option<Transfer>,
    /// The map to take from a file of several that --transfer names
    #[arg(long, value_name = "NAME", requires = "transfer")]
    pub(crate) color_map: Option<String>,
    /// Values over which automatic colours and colour maps run; those beyond have the colours of the ends
    /// [default: the scene's, else those that the file asks to show (cal_min and cal_max of NIfTI), else most of the
    /// values, without what stands for no data]
    #[arg(long, value_name = "LOW,HIGH", value_parser = parse_range, allow_hyphen_values = true)]
    pub(crate) range: Option<[f64; 2]>,
    /// Linear colour behind everything, each number from 0 to 1 [default: the scene's, else nearly black]
    #[arg(long, value_name = "R,G,B", value_parser = parse_background, allow_hyphen_values = true)]
    pub(crate) background: Option<[f64; 3]>,
    /// Largest difference of a value from the full resolution, as a fraction of the file's value range
    #[arg(long, value_name = "T", value_parser = parse_tolerance, allow_negative_numbers = true)]
    pub(crate) tolerance: Option<f64>,
    /// Largest difference of any colour channel that coarse data may make, in [0, 1]; of raycast and plane
    #[arg(long, value_name = "E", value_parser = parse_error, allow_negative_numbers = true)]
    pub(crate) error: Option<f64>,
    /// Draw the best picture that so many milliseconds allow (techniques raycast, plane, stack)
    #[arg(long, value_name = "B", value_parser = parse_budget, allow_negative_numbers = true)]
    pub(crate) budget_ms: Option<f64>,
    /// Draw the best picture that bricks in so much device memory allow: bytes, or KiB, MiB, GiB (technique raycast)
    #[arg(long, value_name = "BYTES", value_parser = parse_memory, allow_negative_numbers = true)]
    pub(crate) memory: Option<u64>,
    /// A region that matters more with --memory, or less: what is lost there counts W times. box:X,Y,Z,X,Y,Z,W from the least
    /// corner to the greatest, or sphere:X,Y,Z,RADIUS,W; may be given several times
    #[arg(long, value_name = "REGION", value_parser = parse_interest)]
    pub(crate) interest: Vec<SceneInterest>,
    /// Where somebody looks, as shares of the picture's width and height: with --budget-ms, what is near is drawn better
    #[arg(long, value_name = "X,Y", value_parser = parse_gaze, allow_hyphen_values = true, requires = "budget_ms")]
    pub(crate) gaze: Option<[f64; 2]>,
    /// Write pictures on the way to the last one into this folder, each with its report: of planes each time that
    /// more of the data has arrived, else coarse ones first
    #[arg(long, value_name = "DIR")]
    pub(crate) progressive: Option<PathBuf>,
    /// How the length of a ray in a cube is found, exact if missing (technique fans)
    #[arg(long, value_enum)]
    pub(crate) thickness: Option<ThicknessName>,
    #[command(flatten)]
    pub(crate) planes: PlaneArgs,
    #[command(flatten)]
    pub(crate) stack: StackArgs,
    /// Folder that the paths in a scene file are relative to [default: that of the scene file]
    #[arg(long, help_heading = "Output", value_name = "DIR")]
    pub(crate) data: Option<PathBuf>,
    /// Who draws: auto is a GPU if there is one, else software
    #[arg(long, help_heading = "Output", value_enum, default_value_t = BackendName::Auto)]
    pub(crate) backend: BackendName,
    /// Measure the distance from the exact picture; takes its time
    #[arg(long, help_heading = "Output")]
    pub(crate) verify: bool,
    /// Write the differences from the exact picture, amplified by the power of two that is printed
    #[arg(long, help_heading = "Output", value_name = "OUT.png",
        value_parser = PathBufValueParser::new().try_map(|path| with_ending(path, &["png", "exr"])))]
    pub(crate) error_map: Option<PathBuf>,
    /// Write how far coarse data can put each pixel off, computed without the exact picture and amplified as printed; of
    /// raycast
    #[arg(long, help_heading = "Output", value_name = "OUT.png",
        value_parser = PathBufValueParser::new().try_map(|path| with_ending(path, &["png", "exr"])))]
    pub(crate) bound_map: Option<PathBuf>,
    /// Write input, times, work and error as JSON
    #[arg(long, help_heading = "Output", value_name = "OUT.json")]
    pub(crate) report: Option<PathBuf>,
    /// Write a scene file that draws the same picture, bit for bit
    #[arg(long, help_heading = "Output", value_name = "OUT.json",
        value_parser = PathBufValueParser::new().try_map(|path| with_ending(path, &["json"])))]
    pub(crate) save_scene: Option<PathBuf>,
    /// Draw the picture so often, and report the time of each and their median; with a place for a number in OUT, such
    /// as OUT-%03d.png, each is a file of its own
    #[arg(long, help_heading = "Output", value_name = "N", default_value_t = 1, value_parser = whole(1_000_000))]
    pub(crate) frames: u32,
    /// Move the camera from one of the --frames to the next: once around, to half the distance, or both as in Li and Shen
    /// 2001 (a quarter nearer, half around, a quarter back)
    #[arg(long, help_heading = "Output", value_enum, value_name = "PATH")]
    pub(crate) path: Option<PathName>,
}

/// What the technique plane alone reads.
#[derive(Debug, Args)]
#[command(next_help_heading = "Technique plane")]
pub(crate) struct PlaneArgs {
    /// The plane of all points x with (NX,NY,NZ) . x = D in world units; or, of anatomical files, axial, coronal or
    /// sagittal at a position in millimetres, else through the middle; may be given several times
    /// [default: the image, or three planes through the middle of the volume]
    #[arg(long = "plane", value_name = "NX,NY,NZ,D|NAME[:POSITION]", value_parser = parse_plane,
        allow_hyphen_values = true)]
    pub(crate) planes: Vec<PlaneName>,
    /// Full detail at this world position, less elsewhere
    #[arg(long, value_name = "X,Y[,Z]", value_parser = parse_focus, allow_hyphen_values = true)]
    pub(crate) focus: Option<DVec3>,
    /// Draw a node where its centre is farther from the focus than so many of its diagonals
    #[arg(long, value_name = "Q", requires = "focus", default_value_t = 1.0, value_parser = parse_quality,
        allow_negative_numbers = true)]
    pub(crate) quality: f64,
    /// Let light through where the transfer function's opacity is below 1
    #[arg(long)]
    pub(crate) transparent: bool,
    /// Show the nearest sample in place of interpolating
    #[arg(long)]
    pub(crate) nearest: bool,
    /// Outline the nodes of the cut in the colour of their level: black, red, green, yellow, ...
    #[arg(long)]
    pub(crate) show_nodes: bool,
}

impl Cli {
    /// Finds options that would not be read, and names without a place for a number.
    pub(crate) fn checked(self) -> Result<Self, clap::Error> {
        let problem = match &self.command {
            Command::Render(args) => args.conflict(),
            Command::Info(args) => data_without_scene(args.data.as_ref(), &args.input),
            Command::Slice(args) => args.conflict(),
            Command::Demo(_) => None,
        };
        match problem {
            None => Ok(self),
            Some(message) => Err(Self::command().error(ErrorKind::ArgumentConflict, message)),
        }
    }
}

fn data_without_scene(data: Option<&PathBuf>, input: &Path) -> Option<String> {
    let unread = data.is_some() && !has_ending(input, &["json"]);
    unread.then(|| {
        let input = input.display();
        format!(
            "--data is for the paths in a scene file, {input} is none: expected a name that ends in .json"
        )
    })
}

impl RenderArgs {
    fn conflict(&self) -> Option<String> {
        let wanted = wanted::over(self, None, SceneInput::default());
        let is_stack = self.technique == Technique::Stack;
        let unread = || {
            let option = self.unread_by_stack().filter(|_| is_stack)?;
            Some(format!("{option} is not read by --technique stack"))
        };
        let steps = || {
            let technique = self.technique.name();
            let steps = !self.stack.time_steps.is_empty() && !is_stack && self.technique != Technique::Auto;
            steps.then(|| format!("--time-steps is read by --technique stack alone, not by {technique}"))
        };
        let map = || match (&self.color_map, &self.transfer) {
            (Some(_), Some(Transfer::Preset(preset))) => Some(format!(
                "--color-map chooses from a file, {} is a name: expected a file that ends in .json for --transfer",
                preset.name()
            )),
            _ => None,
        };
        let conflict = wanted::conflict(&wanted, false).or_else(unread).or_else(steps).or_else(map);
        let data = || data_without_scene(self.data.as_ref(), &self.input);
        conflict.or_else(data).or_else(|| series::conflict(self))
    }

    /// The view of a frame, of which the first is the view itself.
    pub(crate) fn view_at(&self, view: &View, frame: usize) -> View {
        let num = self.frames as usize;
        let way = |path| volery::Path::from(path).camera(&view.camera, frame, num);
        View { camera: self.path.map_or(view.camera, way), ..view.clone() }
    }

    /// Whether the exact picture is wanted.
    pub(crate) fn is_verified(&self) -> bool {
        self.verify || self.error_map.is_some()
    }

    /// An option that is given, and means nothing for grids, beside those of other techniques.
    pub(crate) fn unread_by_stack(&self) -> Option<&'static str> {
        let others = [
            ("--tolerance", self.tolerance.is_some()),
            ("--memory", self.memory.is_some()),
            ("--progressive", self.progressive.is_some()),
            ("--bound-map", self.bound_map.is_some()),
        ];
        others.into_iter().find(|(_, is_given)| *is_given).map(|(name, _)| name)
    }
}

/// `volery info`
#[derive(Debug, Args)]
#[command(after_help = "Example:
  volery info head.nii.gz")]
pub(crate) struct InfoArgs {
    /// A volume, an image, or a scene file
    #[arg(value_name = "FILE")]
    pub(crate) input: PathBuf,
    #[command(flatten)]
    pub(crate) file: FileArgs,
    /// Folder that the path in a scene file is relative to [default: that of the scene file]
    #[arg(long, value_name = "DIR")]
    pub(crate) data: Option<PathBuf>,
    /// As JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// `volery demo`
#[derive(Debug, Args)]
#[command(after_help = "Example:
  volery demo -o pictures")]
pub(crate) struct DemoArgs {
    /// Folder for the pictures
    #[arg(short, long, value_name = "DIR", default_value = "volery-demo")]
    pub(crate) output: PathBuf,
    /// Who draws: auto is a GPU if there is one, else software
    #[arg(long, value_enum, default_value_t = BackendName::Auto)]
    pub(crate) backend: BackendName,
}

/// How to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Technique {
    /// What suits the input: raycast for volumes, stack for grids, plane for images and colours and where an option
    /// asks for it
    Auto,
    /// One ray per pixel through the nodes of a cut
    Raycast,
    /// Cutting planes through the nodes of a cut
    Plane,
    /// Cubes of constant value, as triangle fans from back to front
    Fans,
    /// Slices through the cells of a grid, each standing for a slab
    Stack,
}

impl Technique {
    /// As written on the command line.
    pub(crate) fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }
}

/// How the length of a ray in a cube is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ThicknessName {
    /// The exact chord, per fragment
    Exact,
    /// Linear on the screen between the corners of triangles
    Interpolated,
}

impl From<ThicknessName> for SceneThickness {
    fn from(name: ThicknessName) -> Self {
        match name {
            ThicknessName::Exact => Self::Exact,
            ThicknessName::Interpolated => Self::Interpolated,
        }
    }
}

/// The way of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PathName {
    /// Once around what it looks at
    Orbit,
    /// To half the distance
    Zoom,
    /// A quarter of the frames nearer, half around, a quarter back
    Paper,
}

impl From<PathName> for volery::Path {
    fn from(name: PathName) -> Self {
        match name {
            PathName::Orbit => Self::Orbit,
            PathName::Zoom => Self::Zoom,
            PathName::Paper => Self::Paper,
        }
    }
}

/// Who draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum BackendName {
    /// A GPU if there is one, else software
    Auto,
    /// The CPU, all cores
    Software,
    /// The best device that wgpu finds
    Wgpu,
}

impl From<BackendName> for BackendChoice {
    fn from(name: BackendName) -> Self {
        match name {
            BackendName::Auto => Self::Auto,
            BackendName::Software => Self::Software,
            BackendName::Wgpu => Self::Wgpu,
        }
    }
}

/// Where a transfer function comes from.
#[derive(Clone, Debug)]
pub(crate) enum Transfer {
    Preset(Preset),
    File(PathBuf),
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    path.extension().is_some_and(|found| endings.iter().any(|ending| found.eq_ignore_ascii_case(ending)))
}

fn with_ending(path: PathBuf, endings: &[&str]) -> Result<PathBuf, String> {
    let expected = || format!("expected a name that ends in .{}", endings.join(" or ."));
    if has_ending(&path, endings) { Ok(path) } else { Err(expected()) }
}

fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let numbers = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    let size = numbers.ok_or("expected WIDTHxHEIGHT in pixels, such as 800x600")?;
    volery::io::scene_file::check_size(size).map_err(|problem| problem.to_string())?;
    Ok(size)
}

/// Reads a whole number from 1 to `max`.
fn whole(max: u32) -> impl Fn(&str) -> Result<u32, String> + Clone + Send + Sync + 'static {
    move |text| {
        let found = text.parse().ok().filter(|number| (1..=max).contains(number));
        found.ok_or_else(|| format!("expected a whole number from 1 to {max}"))
    }
}

fn parse_budget(text: &str) -> Result<f64, String> {
    let found = text.parse().ok();
    let good = found.filter(|budget: &f64| *budget >= 0.0 && budget.is_finite());
    good.ok_or_else(|| "expected a number of milliseconds of at least 0".to_owned())
}

fn parse_memory(text: &str) -> Result<u64, String> {
    let units = [("KiB", 10), ("MiB", 20), ("GiB", 30)];
    let (number, shift) = units
        .into_iter()
        .find_map(|(unit, shift)| Some((text.strip_suffix(unit)?.trim_end(), shift)))
        .unwrap_or((text, 0));
    let bytes = number.parse::<u64>().ok().and_then(|number| number.checked_mul(1 << shift));
    bytes.ok_or_else(|| "expected a whole number of bytes, KiB, MiB or GiB, such as 64MiB".to_owned())
}

fn parse_interest(text: &str) -> Result<SceneInterest, String> {
    let expected = || "expected box:X,Y,Z,X,Y,Z,W or sphere:X,Y,Z,RADIUS,W in world units".to_owned();
    let (shape, list) = text.split_once(':').ok_or_else(expected)?;
    let interest = match (shape, numbers(list).as_deref()) {
        ("box", Some(&[a, b, c, d, e, f, weight])) => {
            SceneInterest { corners: Some([[a, b, c], [d, e, f]]), sphere: None, weight }
        }
        ("sphere", Some(&[x, y, z, radius, weight])) => {
            let sphere = Some(SceneSphere { center: [x, y, z], radius });
            SceneInterest { corners: None, sphere, weight }
        }
        _ => return Err(expected()),
    };
    volery::io::scene_file::check_interest(&interest).map(|()| interest)
}

fn parse_gaze(text: &str) -> Result<[f64; 2], String> {
    let shares: Option<Vec<f64>> = text.split(',').map(|share| share.trim().parse().ok()).collect();
    let good = shares.filter(|shares| shares.iter().all(|share| (0.0..=1.0).contains(share)));
    let good = good.and_then(|shares| <[f64; 2]>::try_from(shares).ok());
    good.ok_or_else(|| "expected two numbers from 0 to 1, such as 0.5,0.5".to_owned())
}

fn parse_tolerance(text: &str) -> Result<f64, String> {
    let found: Option<f64> = text.parse().ok();
    let good = found.filter(|tolerance| (0.0..=1.0).contains(tolerance));
    good.ok_or_else(|| "expected a fraction of the value range, from 0 to 1".to_owned())
}

/// As many numbers as `text` has between commas.
fn numbers(text: &str) -> Option<Vec<f64>> {
    text.split(',').map(|part| part.trim().parse().ok()).collect()
}

fn parse_range(text: &str) -> Result<[f64; 2], String> {
    let range = numbers(text).and_then(|numbers| <[f64; 2]>::try_from(numbers).ok());
    let range = range.filter(|[low, high]| low < high && (high - low).is_finite());
    range.ok_or_else(|| "expected LOW,HIGH: two finite values, the lower first".to_owned())
}

fn parse_background(text: &str) -> Result<[f64; 3], String> {
    let color = numbers(text).and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    let color = color.filter(|color| color.iter().all(|channel| (0.0..=1.0).contains(channel)));
    color.ok_or_else(|| "expected R,G,B: three numbers from 0 to 1".to_owned())
}

fn parse_focus(text: &str) -> Result<DVec3, String> {
    let point = match numbers(text).as_deref() {
        Some(&[x, y]) => Some(DVec3::new(x, y, 0.0)),
        Some(&[x, y, z]) => Some(DVec3::new(x, y, z)),
        _ => None,
    };
    point.filter(|point| point.is_finite()).ok_or_else(|| "expected X,Y or X,Y,Z in world units".to_owned())
}

fn parse_quality(text: &str) -> Result<f64, String> {
    let found: Option<f64> = text.parse().ok();
    found.filter(|quality| *quality >= 0.0).ok_or_else(|| "expected a number of at least 0".to_owned())
}

fn parse_error(text: &str) -> Result<f64, String> {
    let found: Option<f64> = text.parse().ok();
    let good = found.filter(|error| (0.0..=1.0).contains(error));
    good.ok_or_else(|| "expected a difference of colours, from 0 to 1".to_owned())
}

fn parse_transfer(name: std::ffi::OsString) -> Result<Transfer, String> {
    if let Some(preset) = name.to_str().and_then(Preset::from_name) {
        return Ok(Transfer::Preset(preset));
    }
    let path = PathBuf::from(name);
    if has_ending(&path, &["json"]) {
        return Ok(Transfer::File(path));
    }
    let names: Vec<_> = Preset::all().map(Preset::name).collect();
    let name = path.to_string_lossy();
    Err(format!("expected a file that ends in .json, or one of {}", one_of(&name, &names)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn help_names_every_preset() {
        let help = Cli::command().find_subcommand_mut("render").unwrap().render_help().to_string();
        for preset in Preset::all() {
            assert!(help.contains(preset.name()), "{}", preset.name());
        }
    }
}
