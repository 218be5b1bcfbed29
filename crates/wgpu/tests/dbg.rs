use glam::DVec3;
use volery_frame::{Backend, Content, Cube, Cubes, Frame, TexelType, Thickness, VolumeLayout};
use volery_scene::{Camera, Projection, Ray};
use volery_wgpu::WgpuBackend;
const SIZE: [u32; 2] = [61, 47];
fn layout(cells: [u32; 3], spacing: DVec3) -> VolumeLayout {
    VolumeLayout {
        cells,
        spacing,
        brick_cells: 8,
        texel: TexelType::U8,
        value_scale: 1.0,
        value_offset: 0.0,
        value_range: [0.0, 255.0],
    }
}

fn extent(layout: &VolumeLayout) -> DVec3 {
    DVec3::from_array(layout.cells.map(f64::from)) * layout.spacing
}

/// A cube in the world, from its definition.
fn world_bounds(cube: &Cube, layout: &VolumeLayout) -> [DVec3; 2] {
    let size = f64::from(cube.level).exp2();
    let low = DVec3::from_array(cube.index.map(f64::from)) * size - 0.5;
    let end = DVec3::from_array(layout.cells.map(f64::from));
    [low, low + size].map(|corner| corner.clamp(DVec3::ZERO, end) * layout.spacing)
}

/// Numbers in [0, 1), the same in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Random cubes of the lower levels, back to front.
struct Field<'a> {
    layout: &'a VolumeLayout,
    camera: &'a Camera,
    random: Random,
    /// Of cubes: those that stay whole, and of these, those that are drawn.
    shares: [f64; 2],
    /// Per world length.
    max_extinction: f64,
    cubes: Vec<Cube>,
}

fn field(
    layout: &VolumeLayout,
    camera: &Camera,
    shares: [f64; 2],
    max_extinction: f64,
    seed: u64,
) -> Vec<Cube> {
    let largest = layout.cells.into_iter().max().unwrap_or(0);
    let root = (0..20).find(|&level| 1 << level > largest).unwrap_or(20);
    let mut field = Field { layout, camera, random: Random(seed), shares, max_extinction, cubes: Vec::new() };
    field.visit(root, [0; 3]);
    field.cubes
}

/// With gaps.
const SHARES: [f64; 2] = [0.3, 0.85];

impl Field<'_> {
    fn visit(&mut self, level: u16, index: [u16; 3]) {
        if level > 3 || level > 0 && self.random.next() >= self.shares[0] {
            self.children(level, index);
        } else if self.random.next() < self.shares[1] {
            let color = [self.random.next() as f32, self.random.next() as f32, self.random.next() as f32];
            let extinction = (self.max_extinction * self.random.next().powi(3)) as f32;
            self.cubes.push(Cube { index, level, color, extinction });
        }
    }

    /// Those on the far side of the planes between them first.
    fn children(&mut self, level: u16, index: [u16; 3]) {
        let half = f64::from(level - 1).exp2();
        let near = (0..3).fold(0_u16, |near, axis| {
            let plane = (f64::from(2 * index[axis] + 1) * half - 0.5) * self.layout.spacing[axis];
            let is_upper = match self.camera.projection {
                Projection::Perspective { .. } => self.camera.eye[axis] > plane,
                Projection::Orthographic { .. } => self.camera.target[axis] < self.camera.eye[axis],
            };
            near | u16::from(is_upper) << axis
        });
        for flips in [7, 6, 5, 3, 4, 2, 1, 0] {
            let child: [u16; 3] = std::array::from_fn(|axis| 2 * index[axis] + ((near ^ flips) >> axis & 1));
            let is_inside =
                |axis: usize| f64::from(child[axis]) * half - 0.5 < f64::from(self.layout.cells[axis]);
            if (0..3).all(is_inside) {
                self.visit(level - 1, child);
            }
        }
    }
}

fn chord(ray: &Ray, [lo, hi]: [DVec3; 2]) -> Option<[f64; 2]> {
    let a = (lo - ray.origin) / ray.direction;
    let b = (hi - ray.origin) / ray.direction;
    let e = a.min(b).max_element().max(0.0);
    let l = a.max(b).min_element();
    (l > e).then_some([e, l])
}
#[test]
fn dbg() {
    let layout = layout([20, 13, 17], DVec3::ONE);
    let camera = Camera::fitted(extent(&layout), -140.0, 65.0, 4.0, true);
    let cubes = field(&layout, &camera, SHARES, 0.8, 5);
    let mut be = WgpuBackend::new().unwrap();
    be.set_volume(&layout).unwrap();
    let rays = camera.rays(SIZE[0], SIZE[1]);
    for th in [Thickness::Exact, Thickness::Interpolated] {
        let draw = |be: &mut WgpuBackend, cubes: &[Cube]| {
            be.draw(&Frame {
                width: SIZE[0],
                height: SIZE[1],
                camera,
                background: [0.125, 0.25, 0.5],
                content: Content::Cubes(Cubes { cubes, thickness: th }),
            })
            .unwrap()
            .image
            .pixels
        };
        let light = |ray: &Ray, cubes: &[Cube]| {
            let mut met: Vec<_> =
                cubes.iter().filter_map(|c| chord(ray, world_bounds(c, &layout)).map(|s| (s, c))).collect();
            met.sort_by(|a, b| b.0[0].total_cmp(&a.0[0]));
            met.iter().fold([0.125, 0.25, 0.5], |b: [f64; 3], (s, c)| {
                let t = (-f64::from(c.extinction) * (s[1] - s[0])).exp();
                std::array::from_fn(|i| b[i] * t + f64::from(c.color[i]) * (1.0 - t))
            })
        };
        let im = draw(&mut be, &cubes);
        let mut hist = [0; 6];
        for y in 0..SIZE[1] {
            for x in 0..SIZE[0] {
                let ray = rays.pixel(x, y);
                let e = light(&ray, &cubes);
                let g = im[(y * SIZE[0] + x) as usize];
                let d = (0..3).map(|i| (f64::from(g[i]) - e[i]).abs()).fold(0.0, f64::max);
                for k in 0..6 {
                    if d > 10f64.powi(-(k as i32) - 1) {
                        hist[k] += 1;
                    }
                }
                if d > 1e-3 {
                    println!("{th:?} {x},{y}: {d:.3e}");
                    for c in &cubes {
                        let one = [*c];
                        let e = light(&ray, &one);
                        let g = draw(&mut be, &one)[(y * SIZE[0] + x) as usize];
                        let d = (0..3).map(|i| (f64::from(g[i]) - e[i]).abs()).fold(0.0, f64::max);
                        if d > 1e-4 {
                            println!(
                                "   {c:?} err {d:.3e} chord {:?}",
                                chord(&ray, world_bounds(c, &layout))
                            );
                            for c2 in 0..8 {
                                let b = world_bounds(c, &layout);
                                let p = DVec3::new(b[c2 & 1].x, b[c2 >> 1 & 1].y, b[c2 >> 2].z) - rays.origin;
                                println!(
                                    "      corner {c2} px {:.5} {:.5}",
                                    p.dot(rays.origin_dx) / rays.origin_dx.length_squared(),
                                    p.dot(rays.origin_dy) / rays.origin_dy.length_squared()
                                );
                            }
                        }
                    }
                }
            }
        }
        println!("{th:?} hist >1e-1.. {hist:?}");
    }
}

#[test]
fn speed() {
    let layout = layout([56, 56, 56], DVec3::ONE);
    let camera = Camera::fitted(extent(&layout), 35.0, 22.0, 1.0, false);
    let cubes = field(&layout, &camera, [0.0, 1.0], 0.1, 5);
    let mut be = WgpuBackend::new().unwrap();
    be.set_volume(&layout).unwrap();
    for size in [32, 512] {
        let mut best = f64::MAX;
        let mut dev = None;
        for _ in 0..5 {
            let t = std::time::Instant::now();
            let d = be
                .draw(&Frame {
                    width: size,
                    height: size,
                    camera,
                    background: [0.125, 0.25, 0.5],
                    content: Content::Cubes(Cubes { cubes: &cubes, thickness: Thickness::Exact }),
                })
                .unwrap();
            let t = t.elapsed().as_secs_f64();
            if t < best {
                best = t;
                dev = d.device_seconds;
            }
        }
        println!(
            "SPEED {size}: {} cubes {:.1} ms dev {:?} {:.3} M/s",
            cubes.len(),
            best * 1e3,
            dev,
            cubes.len() as f64 / best * 1e-6
        );
    }
}
