use glam::DVec3;
use std::time::Instant;
use volery_frame::*;
use volery_scene::*;
fn main() {
    let names: Vec<String> = std::env::args().skip(1).collect();
    let mut backend = volery_wgpu::WgpuBackend::new().unwrap();
    println!("{}", backend.device().name);
    for name in names {
        run(&mut backend, &name);
    }
}
fn run(backend: &mut dyn Backend, name: &str) {
    let text = std::fs::read_to_string(format!("/tmp/gpu/{name}.txt")).unwrap();
    let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split(' ').collect()).collect();
    let num = |i: usize| -> Vec<f64> { lines[i].iter().map(|s| s.parse().unwrap()).collect() };
    let v3 = |i: usize| {
        let n = num(i);
        DVec3::new(n[0], n[1], n[2])
    };
    let dims = num(0).iter().map(|&x| x as usize).collect::<Vec<_>>();
    let dims = [dims[0], dims[1], dims[2]];
    let raw = std::fs::read(format!("/tmp/gpu/{name}.raw")).unwrap();
    let u16s = lines[1][0] == "u16";
    let spacing = v3(2);
    let (w, h) = (num(3)[0] as u32, num(3)[1] as u32);
    let camera = Camera {
        eye: v3(5),
        target: v3(6),
        up: v3(7),
        projection: Projection::Perspective { fov_y_deg: num(8)[0] },
    };
    let tf = TransferFunction::new(
        (10..lines.len())
            .map(|i| {
                let n = num(i);
                ControlPoint { value: n[0], color: [n[1], n[2], n[3]], opacity: n[4] }
            })
            .collect(),
        num(9)[0],
    )
    .unwrap();
    let grid = if u16s {
        VoxelGrid::new(
            dims,
            spacing,
            raw.chunks(2).map(|c| u16::from_le_bytes([c[0], c[1]])).collect::<Vec<u16>>(),
        )
    } else {
        VoxelGrid::new(dims, spacing, raw)
    }
    .unwrap();
    let layout = VolumeLayout {
        cells: dims.map(|n| n as u32 - 1),
        spacing,
        brick_cells: 32,
        texel: if u16s { TexelType::U16 } else { TexelType::U8 },
        value_scale: 1.0,
        value_offset: 0.0,
        value_range: grid.value_range(0).unwrap(),
    };
    let transfer = IntegratedTransfer::new(&tf, layout.value_range, spacing.min_element());
    enum T {
        A(Vec<u8>),
        B(Vec<u16>),
    }
    let mut owned = vec![];
    let b = layout.cells.map(|c| c.div_ceil(32));
    for k in 0..b[2] {
        for j in 0..b[1] {
            for i in 0..b[0] {
                let first = [i * 32, j * 32, k * 32];
                let s: [u32; 3] = std::array::from_fn(|a| (layout.cells[a] - first[a]).min(32) + 1);
                let mut idx = vec![];
                for z in 0..s[2] {
                    for y in 0..s[1] {
                        for x in 0..s[0] {
                            idx.push(grid.index([
                                (first[0] + x) as usize,
                                (first[1] + y) as usize,
                                (first[2] + z) as usize,
                            ]));
                        }
                    }
                }
                let t = match grid.samples() {
                    Samples::U8(a) => T::A(idx.iter().map(|&q| a[q]).collect()),
                    Samples::U16(a) => T::B(idx.iter().map(|&q| a[q]).collect()),
                    _ => panic!(),
                };
                owned.push((
                    PlacedBrick { id: BrickId(owned.len() as u64), first_cell: first, level: 0 },
                    s,
                    t,
                ));
            }
        }
    }
    // front to back by octant order of a regular grid: distance of centre suffices for a check
    owned.sort_by(|a, b| {
        let d = |p: &PlacedBrick| {
            (DVec3::from_array(p.first_cell.map(|c| f64::from(c) + 16.0)) * spacing).distance(camera.eye)
        };
        d(&a.0).total_cmp(&d(&b.0))
    });
    let bricks: Vec<Brick> = owned
        .iter()
        .map(|(p, s, t)| Brick {
            id: p.id,
            samples: *s,
            texels: match t {
                T::A(v) => Texels::U8(v),
                T::B(v) => Texels::U16(v),
            },
        })
        .collect();
    let t = Instant::now();
    backend.set_volume(&layout).unwrap();
    backend.upload(&bricks).unwrap();
    let up = t.elapsed();
    let placed: Vec<_> = owned.iter().map(|o| o.0).collect();
    let bg = num(4);
    let frame = Frame {
        width: w,
        height: h,
        camera,
        transfer: &transfer,
        background: [bg[0] as f32, bg[1] as f32, bg[2] as f32],
        bricks: &placed,
    };
    let mut times = vec![];
    let mut dev = vec![];
    let mut img = None;
    let mut first = 0.0;
    for i in 0..8 {
        let t = Instant::now();
        let d = backend.draw(&frame).unwrap();
        if i == 0 {
            first = t.elapsed().as_secs_f64() * 1e3;
        } else {
            times.push(t.elapsed().as_secs_f64() * 1e3);
            dev.push(d.device_seconds.unwrap_or(f64::NAN) * 1e3);
        }
        img = Some(d.image);
    }
    times.sort_by(f64::total_cmp);
    dev.sort_by(f64::total_cmp);
    let img = img.unwrap();
    if std::env::var_os("COUNT").is_some() {
        for c in 0..3 {
            let n = img.pixels.len() as f64;
            let mean = img.pixels.iter().map(|p| f64::from(p[c])).sum::<f64>() / n;
            let mut gm = 0.0;
            for y in (0..h).step_by(2) {
                for x in (0..w).step_by(4) {
                    let m = (0..8)
                        .map(|k| img.pixels[((y + k / 4) * w + x + k % 4) as usize][c])
                        .fold(0.0f32, f32::max);
                    gm += 8.0 * f64::from(m);
                }
            }
            println!("channel {c}: mean {mean:.2}, mean of group max {:.2}", gm / n);
        }
    }
    let refpath = format!("/tmp/gpu/{name}.ref");
    if !std::path::Path::new(&refpath).exists() && std::env::var_os("MAKE_REF").is_some() {
        let t = Instant::now();
        let r = volery_reference::render(&grid, &camera, &tf, [bg[0], bg[1], bg[2]], w, h).unwrap();
        println!("reference {:.1} s", t.elapsed().as_secs_f64());
        let bytes: Vec<u8> = r.pixels().iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        std::fs::write(&refpath, bytes).unwrap();
    }
    let mut msg = String::new();
    if let Ok(bytes) = std::fs::read(&refpath) {
        let r: Vec<f64> = bytes.chunks(8).map(|c| f64::from_le_bytes(c.try_into().unwrap())).collect();
        let (mut max, mut sum, mut at) = (0.0f64, 0.0, 0);
        for (i, v) in img.pixels.iter().flatten().enumerate() {
            let e = (f64::from(*v) - r[i]).abs();
            if e > max {
                max = e;
                at = i;
            }
            sum += e * e;
        }
        msg = format!(
            "rmse {:.5} max {:.4} at ({}, {})",
            (sum / r.len() as f64).sqrt(),
            max,
            at / 3 % w as usize,
            at / 3 / w as usize
        );
    }
    println!(
        "{name}: median {:.1} ms (min {:.1}), device {:.1} ms, first {:.1} ms, upload {:.0} ms, {:.1} MB, {msg}",
        times[times.len() / 2],
        times[0],
        dev[dev.len() / 2],
        first,
        up.as_secs_f64() * 1e3,
        backend.resident_bytes() as f64 / 1e6
    );
}
