//! Attacks the raycast executors with scenes by chance, and prints how far they are from the truth:
//! `ray_attack [--count 2000] [--seed 1] [--backend software|wgpu|both] [--family TEXT].. [--save DIR]`.
//!
//! A scene is drawn at random in each aspect by itself: type and shape of the samples, what spoils their range, form and
//! density of the transfer function, spacing, view. So each counts in one row of each aspect. A scene depends on the
//! seed and its number only; `--first N --count 1` draws it again, and `--save` writes the worst as scene files.
//! Pictures that no truth was found for in time, that were refused, or that ended in a panic have a line of their own.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::{Parser, ValueEnum};
use volery::{BackendChoice, open_backend};
use volery_tests::Shared;

use crate::scene::{Measured, Outcome, Scene};
use crate::table::Table;

mod camera;
mod random;
mod save;
mod scene;
mod table;
mod transfer;
mod volume;

#[derive(Clone, Copy, ValueEnum)]
enum Backends {
    Software,
    Wgpu,
    Both,
}

/// Attacks the raycast executors with scenes by chance.
#[derive(Parser)]
struct Arguments {
    /// How many scenes.
    #[arg(long, default_value_t = 2000)]
    count: u64,
    /// Number of the first scene.
    #[arg(long, default_value_t = 0)]
    first: u64,
    /// Another seed, other scenes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Who draws.
    #[arg(long, default_value = "both")]
    backend: Backends,
    /// Only scenes of a family with this in its name, as `view inside`; given more than once, of each of them.
    #[arg(long)]
    family: Vec<String>,
    /// Most seconds for the truth of a scene.
    #[arg(long, default_value_t = 5.0)]
    truth_seconds: f64,
    /// Where to write the worst scenes.
    #[arg(long)]
    save: Option<PathBuf>,
    /// How many are the worst.
    #[arg(long, default_value_t = 10)]
    worst: usize,
}

/// One backend and what it did.
struct Attack {
    name: &'static str,
    backend: Shared,
    table: Table,
    /// Number and families of a scene with what was measured.
    measured: Vec<(u64, String, Measured)>,
    /// Reasons, how often, and the first scene's number.
    refused: BTreeMap<String, (usize, u64)>,
    panicked: Vec<u64>,
}

impl Attack {
    fn open(name: &'static str, choice: BackendChoice) -> Result<Self, Box<dyn Error>> {
        let backend = Shared::new(open_backend(choice)?);
        let (table, measured) = (Table::default(), Vec::new());
        Ok(Self { name, backend, table, measured, refused: BTreeMap::new(), panicked: Vec::new() })
    }

    fn draw(&mut self, scene: &Scene, truth: &volery_reference::Image) {
        match scene.measure(&self.backend, truth) {
            Outcome::Measured(measured) => {
                self.table.add(&scene.families, measured, scene.shows_matter(truth));
                self.measured.push((scene.index, scene.families.join(", "), measured));
            }
            Outcome::Refused(reason) => self.refused.entry(reason).or_insert((0, scene.index)).0 += 1,
            Outcome::Panicked => self.panicked.push(scene.index),
        }
    }

    fn print(&mut self, seed: u64, save: Option<&PathBuf>, worst: usize) -> Result<(), Box<dyn Error>> {
        self.table.print(self.name);
        for (reason, (count, first)) in &self.refused {
            println!("{}: {count} refused, first scene {first}: {reason}", self.name);
        }
        println!("{}: {} panicked {:?}", self.name, self.panicked.len(), self.panicked);
        self.measured.sort_by(|a, b| b.2.max.total_cmp(&a.2.max));
        println!("\nworst of {}:", self.name);
        for (index, families, measured) in self.measured.iter().take(worst) {
            print_line(*index, families, measured);
            if let Some(folder) = save {
                std::fs::create_dir_all(folder)?;
                save::save(&Scene::random(seed, *index), &format!("seed_{seed}_scene_{index}"), folder)?;
            }
        }
        println!("\nfarther from the truth than stated, of {}:", self.name);
        for (index, families, measured) in self.measured.iter().filter(|(.., m)| m.is_understated()) {
            print_line(*index, families, measured);
        }
        Ok(())
    }
}

fn print_line(index: u64, families: &str, Measured { max, rmse, stated, .. }: &Measured) {
    println!("scene {index}: max {max:.2e}, rmse {rmse:.2e}, stated {stated:.2e}; {families}");
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let names: &[_] = match arguments.backend {
        Backends::Software => &[("software", BackendChoice::Software)],
        Backends::Wgpu => &[("wgpu", BackendChoice::Wgpu)],
        Backends::Both => &[("software", BackendChoice::Software), ("wgpu", BackendChoice::Wgpu)],
    };
    let mut attacks: Vec<Attack> =
        names.iter().map(|&(name, choice)| Attack::open(name, choice)).collect::<Result<_, _>>()?;
    let start = Instant::now();
    let is_asked = |scene: &Scene| {
        arguments.family.iter().all(|asked| scene.families.iter().any(|family| family.contains(asked)))
    };
    let most = Duration::from_secs_f64(arguments.truth_seconds);
    let (mut late, mut truth_seconds) = (Vec::new(), 0.0);
    // A family that does not exist would be searched for ever.
    let numbers = (arguments.first..).take(1000 * arguments.count as usize);
    let scenes = numbers.map(|index| Scene::random(arguments.seed, index)).filter(is_asked);
    for (scene, done) in scenes.take(arguments.count as usize).zip(1..) {
        let truth_start = Instant::now();
        let truth = scene.truth(most);
        truth_seconds += truth_start.elapsed().as_secs_f64();
        match truth {
            Some(truth) => attacks.iter_mut().for_each(|attack| attack.draw(&scene, &truth)),
            None => late.push(scene.index),
        }
        if done % 100 == 0 {
            eprintln!("{done} scenes, {:.0} s", start.elapsed().as_secs_f64());
        }
    }
    for attack in &mut attacks {
        attack.print(arguments.seed, arguments.save.as_ref(), arguments.worst)?;
    }
    println!(
        "\nno truth within {} s: {} scenes {late:?}; {:.0} s in all, {truth_seconds:.0} of them for the truth",
        arguments.truth_seconds,
        late.len(),
        start.elapsed().as_secs_f64(),
    );
    Ok(())
}
