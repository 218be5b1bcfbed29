//! What was handed to the device, when it is done, and what it then tells: times, and the doubt of rays.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use volery_frame::{FinishedPart, RayDoubt};

use crate::gpu::{Failure, Gpu};

/// Bytes of two timestamps, and behind them of the three numbers of a [`RayDoubt`].
const STAMP_BYTES: u64 = 16;
const DOUBT_BYTES: u64 = 12;

/// The jobs of a picture: one per part and tile, and those before and after the parts.
#[derive(Default)]
pub(crate) struct Jobs {
    pending: Vec<Job>,
    told: Vec<FinishedPart>,
    totals: Totals,
    /// Whether a ray is of one part alone, not of all.
    has_windows: bool,
    free: Vec<Slip>,
}

/// What the jobs that are done took and doubted.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Totals {
    pub(crate) device_seconds: Option<f64>,
    pub(crate) doubt: RayDoubt,
}

/// What belongs to one part, or to none.
struct Job {
    part: Option<u32>,
    slips: Vec<Slip>,
}

/// What one submission leaves to be read.
pub(crate) struct Slip {
    stamps: Option<Stamps>,
    /// The largest numbers of a [`RayDoubt`] of any ray; zero where none was cast.
    pub(crate) worst: wgpu::Buffer,
    staging: wgpu::Buffer,
    is_done: Arc<AtomicBool>,
    submission: Option<wgpu::SubmissionIndex>,
}

struct Stamps {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
}

/// Where the passes of a submission write their times, if the device has a clock.
#[derive(Clone, Copy)]
pub(crate) struct Clock<'a>(Option<&'a wgpu::QuerySet>);

impl<'a> Clock<'a> {
    /// For a render pass, which may be the first of a submission, the last, both or neither.
    pub(crate) fn render(self, is_first: bool, is_last: bool) -> Option<wgpu::RenderPassTimestampWrites<'a>> {
        self.0.filter(|_| is_first || is_last).map(|query_set| wgpu::RenderPassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: is_first.then_some(0),
            end_of_pass_write_index: is_last.then_some(1),
        })
    }

    /// The same for a compute pass.
    pub(crate) fn compute(
        self,
        is_first: bool,
        is_last: bool,
    ) -> Option<wgpu::ComputePassTimestampWrites<'a>> {
        self.0.filter(|_| is_first || is_last).map(|query_set| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: is_first.then_some(0),
            end_of_pass_write_index: is_last.then_some(1),
        })
    }
}

impl Jobs {
    /// Begins a job, of a part or of none.
    pub(crate) fn begin(&mut self, part: Option<u32>) {
        self.pending.push(Job { part, slips: Vec::new() });
    }

    /// Encodes and submits passes of the last job; what they are told is read when they are done.
    pub(crate) fn submit(
        &mut self,
        gpu: &Gpu,
        encode: impl FnOnce(&mut wgpu::CommandEncoder, Clock<'_>, &Slip),
    ) {
        let mut slip = self.free.pop().unwrap_or_else(|| Slip::new(gpu));
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("volery picture") };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        encoder.clear_buffer(&slip.worst, 0, None);
        encode(&mut encoder, Clock(slip.stamps.as_ref().map(|stamps| &stamps.queries)), &slip);
        if let Some(stamps) = &slip.stamps {
            encoder.resolve_query_set(&stamps.queries, 0..2, &stamps.resolved, 0);
            encoder.copy_buffer_to_buffer(&stamps.resolved, 0, &slip.staging, 0, STAMP_BYTES);
        }
        encoder.copy_buffer_to_buffer(&slip.worst, 0, &slip.staging, STAMP_BYTES, DOUBT_BYTES);
        slip.submission = Some(gpu.queue.submit([encoder.finish()]));
        let is_done = slip.is_done.clone();
        // A failure is the device's, which tells it elsewhere; then nothing is ever done.
        let done = move |result: Result<(), _>| is_done.store(result.is_ok(), Ordering::Release);
        slip.staging.map_async(wgpu::MapMode::Read, .., done);
        if let Some(job) = self.pending.last_mut() {
            job.slips.push(slip);
        }
    }

    /// Looks, without waiting, which jobs are done.
    pub(crate) fn look(&mut self, gpu: &Gpu) -> Result<(), Failure> {
        gpu.poll()?;
        let is_done = |job: &mut Job| job.slips.iter().all(|slip| slip.is_done.load(Ordering::Acquire));
        let done: Vec<Job> = self.pending.extract_if(.., is_done).collect();
        for Job { part, slips } in done {
            let (mut seconds, mut doubt) = (gpu.has_clock().then_some(0.0), RayDoubt::default());
            for slip in slips {
                let told = slip.read(gpu)?;
                seconds = seconds.zip(told.device_seconds).map(|(sum, seconds)| sum + seconds);
                doubt = doubt.max(told.doubt);
                self.free.push(slip);
            }
            if let Some(seconds) = seconds {
                *self.totals.device_seconds.get_or_insert(0.0) += seconds;
            }
            let total = &mut self.totals.doubt;
            if self.has_windows {
                *total = total.max(doubt);
            } else {
                // Of each ray it is no more than the sum of the largest.
                total.cells += doubt.cells;
                total.table_way += doubt.table_way;
                total.touching += doubt.touching;
            }
            self.told.extend(part.map(|number| FinishedPart { number, device_seconds: seconds }));
        }
        Ok(())
    }

    /// Waits for the first part that is not done.
    pub(crate) fn wait(&mut self, gpu: &Gpu) -> Result<(), Failure> {
        let part = self.pending.iter().find(|job| job.part.is_some());
        let last = part.and_then(|job| job.slips.last()).and_then(|slip| slip.submission.clone());
        last.map_or(Ok(()), |submission| gpu.wait_for(submission))
    }

    /// Parts that are done and were not told yet.
    pub(crate) fn take_told(&mut self) -> Vec<FinishedPart> {
        std::mem::take(&mut self.told)
    }

    pub(crate) fn totals(&self) -> Totals {
        self.totals
    }

    /// Forgets a picture, for one that is drawn in windows or not.
    pub(crate) fn clear(&mut self, has_windows: bool) {
        self.has_windows = has_windows;
        self.pending.clear();
        self.told.clear();
        self.totals = Totals::default();
    }
}

impl Slip {
    fn new(gpu: &Gpu) -> Self {
        let buffer = |label, size, usage| {
            let descriptor =
                wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
            gpu.device.create_buffer(&descriptor)
        };
        let copied = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        Self {
            stamps: gpu.has_clock().then(|| Stamps {
                queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("volery timestamps"),
                    ty: wgpu::QueryType::Timestamp,
                    count: 2,
                }),
                resolved: buffer(
                    "volery timestamps",
                    STAMP_BYTES,
                    wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                ),
            }),
            worst: buffer("volery doubt", DOUBT_BYTES, wgpu::BufferUsages::STORAGE | copied),
            staging: buffer(
                "volery slip",
                STAMP_BYTES + DOUBT_BYTES,
                wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            ),
            is_done: Arc::default(),
            submission: None,
        }
    }

    /// What the submission told, which is done. The slip can be used again.
    fn read(&self, gpu: &Gpu) -> Result<Totals, Failure> {
        let view = self.staging.get_mapped_range(..).map_err(|e| Failure::Other(e.to_string()))?;
        let [from, to] = [0, 8].map(|i| u64::from_le_bytes(std::array::from_fn(|byte| view[i + byte])));
        let [cells, table_way, touching] =
            [16, 20, 24].map(|i| f32::from_le_bytes(std::array::from_fn(|byte| view[i + byte])));
        drop(view);
        self.staging.unmap();
        self.is_done.store(false, Ordering::Release);
        let seconds = to.saturating_sub(from) as f64 * f64::from(gpu.queue.get_timestamp_period()) * 1e-9;
        // Ways are depths to the base 2.
        let doubt = RayDoubt { cells, table_way: table_way * std::f32::consts::LN_2, touching };
        Ok(Totals { device_seconds: self.stamps.is_some().then_some(seconds), doubt })
    }
}
