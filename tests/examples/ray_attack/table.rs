//! Distributions of errors by family, as a Markdown table.

use std::collections::BTreeMap;

use crate::scene::Measured;

/// Pictures whose largest difference is at least this are wrong.
pub(crate) const WRONG: f64 = 0.01;

/// A picture nearer to the truth than this, of which more than [`WRONG`] is stated, is better than it says.
const GOOD: f64 = 0.001;

/// Everything measured of one backend.
#[derive(Default)]
pub(crate) struct Table {
    rows: BTreeMap<String, Vec<Measured>>,
    all: Vec<(Measured, bool)>,
}

impl Table {
    /// Adds a picture of these families.
    pub(crate) fn add(&mut self, families: &[String], measured: Measured, shows_matter: bool) {
        for family in families {
            self.rows.entry(family.clone()).or_default().push(measured);
        }
        self.all.push((measured, shows_matter));
    }

    /// The table, and how many pictures are right.
    pub(crate) fn print(&self, backend: &str) {
        println!(
            "\n| {backend} | pictures | max median | 90 % | 99 % | most | rmse median | 90 % | 99 % | most | max < {WRONG} | stated median | 90 % | too low | too high | ms |"
        );
        println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
        let all: Vec<Measured> = self.all.iter().map(|(measured, _)| *measured).collect();
        for (family, measured) in self.rows.iter().chain([(&"all".to_owned(), &all)]) {
            println!("| {family} | {} |", row(measured).join(" | "));
        }
        let with_matter: Vec<Measured> = self
            .all
            .iter()
            .filter(|(_, shows_matter)| *shows_matter)
            .map(|(measured, _)| *measured)
            .collect();
        println!(
            "\n{backend}: {} of {} pictures below {WRONG}; of {} that show matter {}; stated too low: {}, above {WRONG} \
             where {GOOD} is right: {}",
            percent(right_share(&all)),
            all.len(),
            with_matter.len(),
            percent(right_share(&with_matter)),
            all.iter().filter(|m| m.is_understated()).count(),
            all.iter().filter(is_overstated).count(),
        );
    }
}

fn is_overstated(measured: &&Measured) -> bool {
    measured.max < GOOD && measured.stated > WRONG
}

fn row(measured: &[Measured]) -> Vec<String> {
    let sorted = |of: fn(&Measured) -> f64| {
        let mut values: Vec<f64> = measured.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let (max, rmse, stated) = (sorted(|m| m.max), sorted(|m| m.rmse), sorted(|m| m.stated));
    let seconds = sorted(|m| m.seconds);
    let four = |values: &[f64]| [0.5, 0.9, 0.99, 1.0].map(|share| format!("{:.1e}", quantile(values, share)));
    let mut cells = vec![measured.len().to_string()];
    cells.extend(four(&max));
    cells.extend(four(&rmse));
    cells.push(percent(right_share(measured)));
    cells.extend([0.5, 0.9].map(|share| format!("{:.1e}", quantile(&stated, share))));
    cells.push(measured.iter().filter(|m| m.is_understated()).count().to_string());
    cells.push(measured.iter().filter(is_overstated).count().to_string());
    cells.push(format!("{:.1}", 1e3 * quantile(&seconds, 0.5)));
    cells
}

fn right_share(measured: &[Measured]) -> f64 {
    measured.iter().filter(|m| m.max < WRONG).count() as f64 / measured.len() as f64
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// The least value that this share of the sorted values does not exceed.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(place.max(1) - 1).copied().unwrap_or(f64::NAN)
}
