//! Slices through cells, each standing for a slab of matter, drawn one over another.
//!
//! # Method
//! Benölken and Graf 2005. *Immediate*: planes perpendicular to the direction of view, sliced for this picture.
//! *Axes*: three stacks along x, y and z made ahead; drawn is the one whose normal is nearest the direction of view,
//! so a camera that moves costs drawing alone. In perspective the way of a ray through a slab is found per fragment
//! (`volery_frame::sheets`), so a normal that is not the ray's own costs accuracy, not brightness.
//!
//! Strips of the outline carry what slabs have too much or too little where the grid ends. Their sign is a matter of
//! which side the ray comes in, so who draws them finds it out for each ray (`volery_frame::Counted`).
//!
//! # Accuracy
//! Of second order in the distance between planes where colour and extinction are continuous functions of the value and
//! several planes lie within the narrowest feature of the transfer function; with a step in it of first order. A slab
//! has the colour of its plane's value: nothing is integrated between slices. `docs/stacks.md` has the figures.
//!
//! # Guarantees
//! - Every colour lies between those of the transfer function and of what is behind, however few the slices.
//! - The same bits whatever the number of threads.
//! - New values at the nodes give the bits of a stack sliced anew.

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use volery_frame::{
    Backend, Content, Counted, Device, DrawError, Frame, Image, Light, PictureView, Quantization, Revision,
    Sheet, SheetTransfer, SheetVertices, Sheets, Thickness,
};
use volery_scene::{Camera, Projection, Samples, TransferFunction, TransferFunction2d};
use volery_slicing::{MeshSheet, Planes, QuantizedMesh, Refinement, SliceMesh, Slicer, error};

use crate::fit;
use crate::report::{self, Report};
use crate::session::{BACKGROUND, Picture, PlaneView, RenderError, Times, VerifyError, View, ViewOptions};

/// Its name on the command line and in reports.
pub const NAME: &str = "stack";

/// How cells are sliced; the technique stack alone reads it.
#[derive(Clone, Debug, PartialEq)]
pub struct StackView {
    /// Which planes.
    pub slicing: Slicing,
    /// Planes over the extent of the grid along their normal; of semi-adaptive slicing those of the first step.
    pub num_slices: usize,
    /// Share of the cells, in [0, 1], that planes are to meet: as long as fewer are met, planes are put between
    /// others where the cells are. `None`: even planes alone.
    pub adaptive: Option<f64>,
    /// Colour and extinction by value and gradient magnitude, in place of the view's transfer function.
    pub classification: Option<Arc<TransferFunction2d>>,
    /// Whether a light at the viewer shades matter by its gradient.
    pub is_lit: bool,
    /// Whether vertices are kept and sent in 8 bytes in place of 16, 12 in place of 32 with gradients.
    pub is_quantized: bool,
}

/// Which planes cut the cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Slicing {
    /// Perpendicular to the direction of view, for each picture anew.
    #[default]
    Immediate,
    /// Perpendicular to x, y or z, made once: what a camera in motion needs.
    Axes,
}

impl StackView {
    /// Whether cells can be sliced so.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        if self.num_slices == 0 { Err(RenderError::NoSlice) } else { Ok(()) }
    }

    /// Whether the reference knows what such pictures show.
    ///
    /// # Errors
    /// When they show light or gradient magnitudes.
    pub fn check_verifiable(&self) -> Result<(), VerifyError> {
        let what = if self.classification.is_some() { "gradient magnitudes" } else { "light" };
        if self.needs_gradients() { Err(VerifyError::Unknown { what }) } else { Ok(()) }
    }

    /// Whether pictures need gradients at the nodes.
    pub(crate) fn needs_gradients(&self) -> bool {
        self.is_lit || self.classification.is_some()
    }

    /// Of the light of matter without a gradient toward the viewer.
    const AMBIENT: f32 = 0.25;

    fn light(&self, camera: &Camera) -> Option<Light> {
        self.is_lit.then(|| Light::along_view(camera, Self::AMBIENT))
    }
}

impl Default for StackView {
    fn default() -> Self {
        Self {
            slicing: Slicing::default(),
            num_slices: 128,
            adaptive: None,
            classification: None,
            is_lit: false,
            is_quantized: false,
        }
    }
}

/// Why cells could not be sliced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// There are no such planes.
    #[error(transparent)]
    Planes(#[from] error::Planes),
    /// Too many polygons, vertices or triangles.
    #[error(transparent)]
    Mesh(#[from] error::Mesh),
    /// The same, of planes where cells are.
    #[error(transparent)]
    Adaptive(#[from] error::MeshAdaptively),
    /// Values that do not fit.
    #[error(transparent)]
    Values(#[from] error::Values),
    /// Vertices cannot be told in few bits.
    #[error(transparent)]
    Quantize(#[from] error::Quantize),
}

/// What a stack was made by: it serves every view that asks for the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Recipe {
    pub(crate) normal: DVec3,
    pub(crate) num_slices: usize,
    pub(crate) adaptive: Option<f64>,
    pub(crate) has_gradients: bool,
    pub(crate) is_quantized: bool,
}

/// A stack as backends may keep it.
pub(crate) struct Stack {
    mesh: SliceMesh,
    /// What is drawn in place of the mesh's own vertices.
    quantized: Option<QuantizedMesh>,
    /// Its sheets for any eye.
    sheets: Vec<MeshSheet>,
    /// Names the contents of the mesh.
    revision: Revision,
    /// The revision that was drawn last.
    sent: Option<Revision>,
}

impl Recipe {
    /// What a view asks for, by planes perpendicular to a unit vector.
    pub(crate) fn new(view: &StackView, normal: DVec3) -> Self {
        let &StackView { slicing: _, num_slices, adaptive, is_quantized, .. } = view;
        Self { normal, num_slices, adaptive, has_gradients: view.needs_gradients(), is_quantized }
    }

    /// Slices; `gradients` at the nodes are used where they are needed.
    pub(crate) fn stack(
        self,
        slicer: &Slicer,
        values: &Samples,
        gradients: Option<&[DVec3]>,
    ) -> Result<Stack, Error> {
        let Self { normal, num_slices, adaptive, has_gradients, is_quantized } = self;
        let gradients = gradients.filter(|_| has_gradients);
        let mesh = match adaptive {
            None => slicer.mesh(&Planes::over(slicer.grid(), normal, num_slices)?, values, gradients)?,
            Some(share) => {
                let refinement = Refinement { first_planes: num_slices, share };
                slicer.mesh_adaptively(normal, refinement, values, gradients)?.0
            }
        };
        let quantized = is_quantized.then(|| QuantizedMesh::new(&mesh)).transpose()?;
        Ok(Stack::new(mesh, quantized))
    }
}

impl Stack {
    fn new(mesh: SliceMesh, quantized: Option<QuantizedMesh>) -> Self {
        let sheets = mesh.sheets_for_any_eye();
        Self { mesh, quantized, sheets, revision: Revision::new(), sent: None }
    }

    /// Of a mesh from a file, drawn as it is there.
    pub(crate) fn of_file(quantized: QuantizedMesh) -> Self {
        Self::new(quantized.to_mesh(), Some(quantized))
    }

    /// Places relative to [`Stack::origin`], and values.
    pub(crate) fn points(&self) -> &[[f32; 4]] {
        &self.mesh.points
    }

    pub(crate) fn origin(&self) -> DVec3 {
        self.mesh.origin
    }

    pub(crate) fn normal(&self) -> DVec3 {
        self.mesh.normal
    }

    pub(crate) fn has_gradients(&self) -> bool {
        !self.mesh.gradients.is_empty()
    }

    /// Gives the vertices other values, and gradients where it has some.
    pub(crate) fn set_values(&mut self, values: &Samples, gradients: Option<&[DVec3]>) -> Result<(), Error> {
        let gradients = gradients.filter(|_| self.has_gradients());
        self.mesh.set_values(values, gradients)?;
        if self.quantized.is_some() {
            self.quantized = Some(QuantizedMesh::new(&self.mesh)?);
        }
        self.revision = Revision::new();
        Ok(())
    }

    /// Draws, by a backend. Returns the picture, and how many bytes of vertices and triangles it had not been sent.
    fn draw(
        &mut self,
        view: &View,
        transfer: &SheetTransfer,
        backend: &mut dyn Backend,
    ) -> Result<(Image, u64), DrawError> {
        let sheets = self.sheets(&view.camera);
        let SliceMesh { normal, origin, points, gradients, triangles, .. } = &self.mesh;
        let content = Sheets {
            revision: Some(self.revision),
            normal: *normal,
            origin: *origin,
            vertices: match &self.quantized {
                None => SheetVertices::Exact { points, gradients },
                Some(mesh) => quantized_vertices(mesh),
            },
            triangles,
            sheets: &sheets,
            transfer,
            light: view.stack.light(&view.camera),
        };
        let picture = PictureView {
            width: view.width,
            height: view.height,
            camera: view.camera,
            background: view.background.map(|c| c as f32),
            meshes: &view.meshes,
        };
        let image = backend.draw(&Frame { view: picture, content: Content::Sheets(content) })?.image;
        let is_new = self.sent.replace(self.revision) != Some(self.revision);
        Ok((image, if is_new { self.num_bytes() } else { 0 }))
    }

    /// The sheets back to front.
    fn sheets(&self, camera: &Camera) -> Vec<Sheet> {
        let normal = self.mesh.normal;
        let eye = match camera.projection {
            Projection::Perspective { .. } => normal.dot(camera.eye - self.mesh.origin),
            Projection::Orthographic { .. } => f64::NEG_INFINITY * normal.dot(camera.axes()[2]).signum(),
        };
        let sheet = |sheet: &MeshSheet| Sheet {
            first: sheet.triangles.start,
            count: sheet.triangles.end - sheet.triangles.start,
            thickness: sheet.thickness.map(|part| part as f32),
            counted: match sheet.thickness[1] {
                0.0 => Counted::All,
                slope if slope > 0.0 => Counted::Rising,
                _ => Counted::Falling,
            },
        };
        MeshSheet::back_to_front(&self.sheets, eye).map(sheet).collect()
    }

    /// How many planes met cells.
    fn num_slices(&self) -> usize {
        self.mesh.sheets.iter().filter(|sheet| sheet.thickness[1] == 0.0).count()
    }

    /// Bytes of vertices and triangles.
    pub(crate) fn num_bytes(&self) -> u64 {
        let SliceMesh { points, gradients, triangles, .. } = &self.mesh;
        let exact = || size_of_val(&points[..]) + size_of_val(&gradients[..]) + size_of_val(&triangles[..]);
        self.quantized.as_ref().map_or_else(exact, QuantizedMesh::num_bytes) as u64
    }
}

fn quantized_vertices(mesh: &QuantizedMesh) -> SheetVertices<'_> {
    let volery_slicing::Quantization { low, scale, magnitude_scale } = mesh.quantization;
    SheetVertices::Quantized {
        points: &mesh.points,
        gradients: &mesh.gradients,
        quantization: Quantization { low, scale, magnitude_scale },
    }
}

/// A view of all of a box.
pub(crate) fn view(
    world_bounds: [DVec3; 2],
    options: &ViewOptions,
    transfer: impl FnOnce() -> TransferFunction,
) -> View {
    let &ViewOptions { width, height, direction, orthographic, .. } = options;
    let aspect = f64::from(width.max(1)) / f64::from(height.max(1));
    View {
        width,
        height,
        camera: fit::camera(&[world_bounds], direction.unwrap_or_default(), orthographic, aspect),
        transfer: options.transfer.clone().unwrap_or_else(transfer),
        background: BACKGROUND,
        tolerance: None,
        planes: PlaneView::default(),
        thickness: Thickness::default(),
        stack: options.stack.clone(),
        meshes: [].into(),
    }
}

/// Frames on their way to a picture and its report.
#[derive(Default)]
pub(crate) struct Frames {
    times: Vec<Times>,
    last: Option<Image>,
    bytes_uploaded: u64,
    slices: usize,
    triangles: usize,
    polygons: Option<usize>,
}

impl Frames {
    /// Draws one of a stack, with the values of `range`; slicing took `geometry` seconds.
    pub(crate) fn draw(
        &mut self,
        stack: &mut Stack,
        table: &mut Option<Tabulated>,
        (view, range): (&View, [f64; 2]),
        backend: &mut dyn Backend,
        geometry: Option<f64>,
    ) -> Result<(), DrawError> {
        let start = Instant::now();
        let transfer = Tabulated::get(table, view, range);
        let select = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let (image, bytes) = stack.draw(view, transfer, backend)?;
        let draw = start.elapsed().as_secs_f64();
        self.times.push(Times { select, geometry, upload: None, draw });
        self.bytes_uploaded += bytes;
        (self.slices, self.triangles) = (stack.num_slices(), stack.mesh.triangles.len());
        self.polygons = stack.mesh.num_polygons;
        self.last = Some(image);
        Ok(())
    }

    /// The last frame, and a report of all.
    pub(crate) fn picture(
        self,
        view: &View,
        input: report::Input,
        (device, bytes_resident): (Device, u64),
        build_seconds: f64,
    ) -> Result<Picture, RenderError> {
        let image = self.last.ok_or(RenderError::NoFrame)?;
        let report = Report {
            version: report::VERSION,
            input,
            inputs: Vec::new(),
            technique: NAME,
            thickness: None,
            backend: report::Backend::of(device),
            image: report::ImageSize { width: view.width, height: view.height },
            camera: view.camera,
            transfer_function: Some(report::transfer_of(view)),
            seconds: Times::median(&self.times, build_seconds),
            frames: Times::frames(&self.times),
            work: report::Work {
                nodes: None,
                nodes_by_level: None,
                bricks: None,
                bytes_resident,
                bytes_uploaded: self.bytes_uploaded,
                polygons: self.polygons,
                slices: Some(self.slices),
                triangles: Some(self.triangles),
            },
            dial: None,
            error: None,
        };
        Ok(Picture { image, report })
    }
}

/// A table, and what it is of.
pub(crate) struct Tabulated {
    transfer: TransferFunction,
    classification: Option<Arc<TransferFunction2d>>,
    range: [f64; 2],
    table: SheetTransfer,
}

impl Tabulated {
    /// The table that a view asks for, over a range of values: the one that was made, or a new one.
    pub(crate) fn get<'a>(made: &'a mut Option<Self>, view: &View, range: [f64; 2]) -> &'a SheetTransfer {
        let View { transfer, stack: StackView { classification, .. }, .. } = view;
        let is_same = |made: &Self| {
            made.transfer == *transfer && made.range == range && made.classification == *classification
        };
        let new = || Self {
            transfer: transfer.clone(),
            classification: classification.clone(),
            range,
            table: match classification {
                None => SheetTransfer::new(transfer, range),
                Some(function) => SheetTransfer::new_2d(function),
            },
        };
        let same = made.take().filter(is_same);
        &made.insert(same.unwrap_or_else(new)).table
    }
}
