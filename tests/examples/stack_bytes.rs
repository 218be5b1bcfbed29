//! Bytes of stacks of slices from step to step, and how fast they come back: `stack_bytes DATA [PLANES]` prints the
//! tables of `docs/stacks.md`.
//!
//! Seconds are the least of several runs. Decoding is measured from the bytes of a file in memory to vertices and
//! triangles in memory; a rate is the bytes of these per second.

use std::error::Error;
use std::path::Path;
use std::time::Instant;
use volery_tests::Drawer;

use glam::DVec3;
use meshoptimizer_rs::Workspace;
use meshoptimizer_rs::codec::{
    IndexEncoding, VertexEncoding, decode_index_buffer, decode_vertex_buffer, encode_index_buffer,
    encode_vertex_buffer,
};
use volery::{BackendChoice, Slices, open_backend};
use volery_io::{GridOptions, read_grid};
use volery_slicing::{CompactMesh, Planes, QuantizedMesh, Slicer};

const NAMES: [&str; 3] = ["bluntfin", "k3d_fem", "post_mixed"];
const NORMAL: DVec3 = DVec3::new(0.3, 0.5, 0.81);
const RUNS: usize = 7;
/// Of Zstandard, as files have it.
const LEVEL: i32 = 9;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let data = arguments.first().ok_or("expected the folder of data")?;
    let num_planes = arguments.get(1).map_or(Ok(256), |count| count.parse())?;
    let mut made = Vec::new();
    for name in NAMES {
        let file = read_grid(&Path::new(data).join(format!("{name}.vtu")), &GridOptions::default())?;
        let slicer = Slicer::new(file.grid.clone())?;
        let stack = slicer.slice(&Planes::over(slicer.grid(), NORMAL, num_planes)?)?;
        let num_corners = stack.sections().map(|(_, section)| section.corners().len()).sum::<usize>();
        let session = Drawer::grid(file.grid, None, open_backend(BackendChoice::Software)?)?;
        made.push(Made { name, num_corners, slices: session.data().slices(NORMAL, num_planes)? });
    }
    print_bytes(&made);
    print_coders(&made)
}

struct Made {
    name: &'static str,
    /// Of polygons of slices.
    num_corners: usize,
    slices: Slices,
}

fn print_bytes(made: &[Made]) {
    println!(
        "| {:<10} | polygons | float | quantised | indexed | drawn, with outline | `.vsl`, with outline |",
        "grid"
    );
    println!("|---|---|---|---|---|---|---|");
    for Made { name, slices, .. } in made {
        let counts = slices.counts;
        let percent = |bytes: u64| format!("{:.1} %", 100.0 * bytes as f64 / counts.float_bytes as f64);
        println!(
            "| {name} | {} | {} bytes | {} | {} | {} | {} bytes, **{:.2} %** |",
            counts.polygons,
            counts.float_bytes,
            percent(counts.quantized_bytes),
            percent(counts.indexed_bytes),
            percent(counts.drawn_bytes),
            slices.compact().encode().len(),
            100.0 * slices.compact().encode().len() as f64 / counts.float_bytes as f64,
        );
    }
    println!(
        "\n| `.vsl` over floats of | polygons | polygons without normals | triangles | triangles and outline |"
    );
    println!("|---|---|---|---|---|");
    for Made { name, num_corners, slices } in made {
        let coded = slices.compact().encode().len() as f64;
        let percent = |bytes: usize| format!("{:.2} %", 100.0 * coded / bytes as f64);
        // A polygon of n corners makes n - 2 triangles.
        let num_triangles = num_corners - 2 * slices.counts.polygons;
        println!(
            "| {name} | {} | {} | {} | {} |",
            percent(28 * num_corners),
            percent(16 * num_corners),
            percent(84 * num_triangles),
            percent(84 * slices.counts.triangles),
        );
    }
}

/// A way to make a mesh small and back.
struct Coder {
    name: &'static str,
    num_bytes: usize,
    seconds: f64,
}

fn print_coders(made: &[Made]) -> Result<(), Box<dyn Error>> {
    println!("\n| grid | coder | bytes | share of floats | decoded |");
    println!("|---|---|---|---|---|");
    for Made { name, slices, .. } in made {
        let mesh = slices.mesh();
        let drawn = mesh.num_bytes() as f64;
        for coder in [zstd_alone(&mesh)?, meshopt(&mesh, false)?, meshopt(&mesh, true)?, ours(slices)?] {
            println!(
                "| {name} | {} | {} | {:.2} % | {:.0} MB/s |",
                coder.name,
                coder.num_bytes,
                100.0 * coder.num_bytes as f64 / slices.counts.float_bytes as f64,
                drawn / coder.seconds / 1e6,
            );
        }
    }
    Ok(())
}

/// The least time of several runs.
fn seconds<T>(mut run: impl FnMut() -> Result<T, Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    let mut least = f64::INFINITY;
    for _ in 0..RUNS {
        let start = Instant::now();
        std::hint::black_box(run()?);
        least = least.min(start.elapsed().as_secs_f64());
    }
    Ok(least)
}

/// Vertices of 12 bytes and triangles of 12, as bytes.
fn plain(mesh: &QuantizedMesh) -> [Vec<u8>; 2] {
    let vertex = |(point, gradient): (&[u16; 4], &[i8; 4])| {
        let point = point.iter().flat_map(|number| number.to_le_bytes());
        point.chain(gradient.map(i8::cast_unsigned)).collect::<Vec<u8>>()
    };
    let vertices = mesh.points.iter().zip(&mesh.gradients).flat_map(vertex).collect();
    [vertices, mesh.triangles.as_flattened().iter().flat_map(|corner| corner.to_le_bytes()).collect()]
}

fn zstd_alone(mesh: &QuantizedMesh) -> Result<Coder, Box<dyn Error>> {
    let coded = plain(mesh).map(|bytes| zstd::bulk::compress(&bytes, LEVEL));
    let coded = coded.into_iter().collect::<Result<Vec<_>, _>>()?;
    let decode = || coded.iter().map(|part| Ok(zstd::decode_all(&part[..])?)).collect::<Result<Vec<_>, _>>();
    Ok(Coder {
        name: "Zstandard alone",
        num_bytes: coded.iter().map(Vec::len).sum(),
        seconds: seconds(decode)?,
    })
}

/// meshoptimizer's codecs of vertices and triangles, with Zstandard behind them or not.
fn meshopt(mesh: &QuantizedMesh, with_zstd: bool) -> Result<Coder, Box<dyn Error>> {
    let (num_vertices, num_corners) = (mesh.points.len(), 3 * mesh.triangles.len());
    let [vertices, _] = plain(mesh);
    let mut workspace = Workspace::default();
    let mut coded = [
        encode_vertex_buffer(&vertices, num_vertices, 12, VertexEncoding::DEFAULT, &mut workspace)?,
        encode_index_buffer(mesh.triangles.as_flattened(), IndexEncoding::DEFAULT, &mut workspace)?,
    ];
    if with_zstd {
        coded = [zstd::bulk::compress(&coded[0], LEVEL)?, zstd::bulk::compress(&coded[1], LEVEL)?];
    }
    let decode = || {
        let open = |part: &[u8]| if with_zstd { zstd::decode_all(part) } else { Ok(part.to_vec()) };
        let [vertices, triangles] = [open(&coded[0])?, open(&coded[1])?];
        let vertices = decode_vertex_buffer(num_vertices, 12, &vertices, &mut workspace)?;
        Ok((vertices, decode_index_buffer(num_corners, 4, &triangles, &mut workspace)?))
    };
    let name = if with_zstd { "meshoptimizer and Zstandard" } else { "meshoptimizer" };
    Ok(Coder { name, num_bytes: coded.iter().map(Vec::len).sum(), seconds: seconds(decode)? })
}

fn ours(slices: &Slices) -> Result<Coder, Box<dyn Error>> {
    let coded = slices.compact().encode();
    let decode = || Ok(CompactMesh::decode(&coded, u64::MAX)?.expand());
    Ok(Coder { name: "nodes and edges, `.vsl`", num_bytes: coded.len(), seconds: seconds(decode)? })
}
