//! scratch
use volery_schedule::simulate::*;
use volery_schedule::*;
struct T { s: Scheduler, log: Vec<(f64, Option<Part>, f64)>, budget: f64, n: usize, printed: usize, costs: std::collections::BTreeMap<u64, f64> }
impl Controller for T {
    fn begin(&mut self, b: f64, i: &[Item<'_>]) { self.log.clear(); self.costs.clear(); self.n += 1; self.s.begin(b, i) }
    fn next(&mut self, e: f64) -> Step { let st = self.s.next(e); self.log.push((e, if let Step::Draw(p) = st { Some(p) } else { None }, self.s.model().pace())); st }
    fn observe(&mut self, id: u64, secs: f64) { self.costs.insert(id, secs); self.s.observe(id, secs) }
    fn finish(&mut self, a: f64) -> Summary { let s = self.s.finish(a);
        if s.signed_error() > 0.12 && !s.is_at_floor && self.printed < 3 && self.n > 1 { self.printed += 1;
            println!("frame {} error {:.1}% parts {} outside {:.3} mean {:.2} q99 {:.2}", self.n - 1, 100.0 * s.signed_error(), s.num_parts, 100.0*self.s.outside_secs()/self.budget, self.s.model().errors().mean_ratio(), self.s.model().errors().quantile_ratio(0.99));
            let l = self.log.len();
            for (e, p, pace) in &self.log[l.saturating_sub(30)..] { if let Some(p) = p { println!("  at {:.2}% item {} level {} ref {} pred {:.2}% took {:.2}% pace {pace:.3}", 100.0 * e / self.budget, p.item, p.level, p.is_refinement, 100.0 * p.predicted_secs / self.budget, 100.0 * self.costs[&p.id] / self.budget); } else { println!("  at {:.2}% wait/done", 100.0*e/self.budget) } }
        } s }
}
#[test]
fn trace() {
    for (order, ratio, items) in [(Order::Kept, 4.0, 64), (Order::LargestFirst, 8.0, 100)] {
        let mut scene = Scene { num_frames: 10000, ..Scene::default() };
        scene.world.num_items = items; scene.world.ratio = ratio;
        let mut t = T { s: Scheduler::new(Settings { order, ..Settings::default() }), log: vec![], budget: scene.budget_secs, n: 0, printed: 0, costs: Default::default() };
        let o = play(&scene, &mut t);
        println!("{}", o.distribution());
    }
}
