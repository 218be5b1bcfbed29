//! `volery slice`

use std::fmt;
use std::time::Instant;

use volery::io::{GlbOptions, GridOptions, read_grid, recording_files};
use volery::{GridData, SliceCounts};

use crate::args::{ChoiceArgs, SliceArgs};
use crate::outputs::Outputs;
use crate::progress::Progress;
use crate::{Failure, extent, say};

pub(crate) fn run(args: &SliceArgs) -> Result<(), Failure> {
    let outputs = Outputs::default().file("-o", &args.output);
    outputs.check([args.input.as_path()])?;
    let busy = Progress::spinner("slicing");
    let ChoiceArgs { array, channel, time_step } = args.choice.clone();
    let options = GridOptions { array: array.clone(), channel, time_step, ..GridOptions::default() };
    let (file, opened) = recording_files(|| read_grid(&args.input, &options));
    let file = file?;
    outputs.check_inputs(opened.iter().map(|file| file.path.as_path()))?;
    extent::check(&args.input, &file.grid, args.count as usize, Some(args.axis))?;
    let opened = GridData::new(file.grid, array.as_deref());
    let grid = opened.map_err(|error| Failure::of_file(&args.input, error))?;
    let sliced = grid.slices(args.axis, args.count as usize);
    let slices = sliced.map_err(|error| Failure::of_file(&args.input, error))?;
    let start = Instant::now();
    let is_glb = args.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("glb"));
    let file_bytes = if is_glb {
        slices.write_glb(&args.output, GlbOptions { is_coded: args.meshopt })?
    } else {
        slices.write_vsl(&args.output)?
    };
    let write_seconds = start.elapsed().as_secs_f64();
    drop(busy);
    say(Table {
        array: grid.array(),
        distance: slices.distance,
        counts: slices.counts,
        file_bytes,
        write_seconds,
    })
}

/// What it took, from step to step.
struct Table<'a> {
    array: &'a str,
    distance: f64,
    counts: SliceCounts,
    file_bytes: u64,
    write_seconds: f64,
}

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { array, distance, counts, file_bytes, write_seconds } = self;
        let SliceCounts { planes, polygons, triangles, vertices, .. } = counts;
        writeln!(f, "array      {}", array.escape_debug())?;
        writeln!(f, "planes     {planes}, {distance:.6e} apart")?;
        writeln!(f, "polygons   {polygons}")?;
        writeln!(
            f,
            "mesh       {triangles} triangles over {vertices} vertices, outline between planes included"
        )?;
        let stages = [
            ("float", counts.float_bytes, None, "each corner of a polygon on its own, 28 bytes"),
            ("quantised", counts.quantized_bytes, None, "the same corners in 12 bytes"),
            ("indexed", counts.indexed_bytes, None, "the same polygons over vertices that they share"),
            ("drawn", counts.drawn_bytes, Some(counts.slice_seconds), "the mesh, as a device gets it"),
            ("file", *file_bytes, Some(counts.compact_seconds + write_seconds), "the mesh, as written"),
        ];
        for (at, (stage, bytes, seconds, what)) in stages.into_iter().enumerate() {
            let percent = 100.0 * bytes as f64 / counts.float_bytes as f64;
            let seconds = seconds.map_or_else(String::new, |seconds| format!("{seconds:.3} s"));
            let end = if at + 1 < 5 { "\n" } else { "" };
            write!(f, "{stage:<10} {bytes:>12} bytes {percent:>6.2} % {seconds:>9}  {what}{end}")?;
        }
        Ok(())
    }
}
