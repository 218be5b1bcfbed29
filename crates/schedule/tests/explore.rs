//! scratch
use volery_schedule::simulate::*;
use volery_schedule::*;
#[test]
fn explore() {
    let n: usize = std::env::var("FRAMES").ok().and_then(|v| v.parse().ok()).unwrap_or(10000);
    for order in [Order::Kept, Order::LargestFirst] {
        for ratio in [2.0, 4.0, 8.0] {
            for items in [16, 32, 64, 100, 150, 300] {
                let mut scene = Scene { num_frames: n, ..Scene::default() };
                scene.world.num_items = items;
                scene.world.ratio = ratio; if ratio == 2.0 { scene.device.load = 1.5; }
                if let Ok(l) = std::env::var("N") { if !l.split(',').any(|x| x == items.to_string()) {continue;} }
                let mut s = Scheduler::new(Settings { order, ..Settings::default() });
                let t = std::time::Instant::now();
                let o = play(&scene, &mut s);
                let ch: usize = o.frames.iter().map(|f| f.num_changed).sum();
                let late: Vec<(usize, i64)> = o.frames.iter().enumerate().filter(|(_, f)| !f.is_at_limit() && f.signed_error > 0.12).map(|(i, f)| (i, (f.signed_error * 100.0) as i64)).take(12).collect();
                println!("    jumps {} late {late:?}", s.model().num_jumps());
                let re: usize = o.frames.iter().map(|f| f.summary.num_refinements).sum();
                println!("{order:?} r{ratio} n{items}: {} changed {:.1}% refined {:.1}% {:.1}us/frame maxnl {:.3} p99ratio {:.2} mean {:.2}", o.distribution(), 100.0 * ch as f64 / (n * items) as f64, 100.0*re as f64/(n*items) as f64, 1e6 * t.elapsed().as_secs_f64() / n as f64, o.distribution().max_not_at_limit, s.model().errors().quantile_ratio(0.99), s.model().errors().mean_ratio());
            }
        }
    }
}
