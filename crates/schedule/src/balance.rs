//! How much of a cost is fixed, and how much goes with work: least squares of predicted / actual - 1.
//!
//! Relative to what parts took, a part that stalled has a residual of at most 1, so stalls hardly count. Older parts fade:
//! each counts .995 of the one after. Only the ratio of the two coefficients is taken; their level is for others to keep.

const FADING: f64 = 0.995;
/// Below this the parts are too much alike to tell the two apart.
const MIN_DETERMINANT: f64 = 1e-4;
/// Of the mean part, what either coefficient stands for at least.
const MIN_PART: f64 = 1e-3;

/// Sums over parts, each divided by what it took.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Balance {
    squares: [f64; 2],
    product: f64,
    sums: [f64; 2],
}

impl Balance {
    /// Takes the features of a part and what it took.
    pub(crate) fn push(&mut self, features: [f64; 2], secs: f64) {
        let [fixed, work] = features.map(|feature| feature / secs);
        if secs <= 0.0 || !(fixed * fixed).is_finite() || !(work * work).is_finite() {
            return;
        }
        let add = |sum: &mut f64, number: f64| *sum = FADING * *sum + number;
        add(&mut self.squares[0], fixed * fixed);
        add(&mut self.squares[1], work * work);
        add(&mut self.product, fixed * work);
        add(&mut self.sums[0], fixed);
        add(&mut self.sums[1], work);
    }

    /// Both coefficients, such that the mean of predicted / actual is what it is with the old ones; none where parts
    /// do not tell.
    pub(crate) fn solve(&self, old: [f64; 2]) -> Option<[f64; 2]> {
        let scale = self.squares[0] * self.squares[1];
        let determinant = scale - self.product * self.product;
        if determinant.is_nan() || determinant <= MIN_DETERMINANT * scale {
            return None;
        }
        let fixed = (self.sums[0] * self.squares[1] - self.sums[1] * self.product) / determinant;
        let work = (self.sums[1] * self.squares[0] - self.sums[0] * self.product) / determinant;
        // What each stands for in the sum of predicted / actual.
        let parts = [fixed * self.sums[0], work * self.sums[1]].map(|part| part.max(0.0));
        let all = parts[0] + parts[1];
        let level = old[0] * self.sums[0] + old[1] * self.sums[1];
        let new = [0, 1].map(|place| (parts[place] / all).max(MIN_PART) * level / self.sums[place]);
        new.iter().all(|number| number.is_finite() && *number > 0.0).then_some(new)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fixed_and_work_are_told_apart_whatever_the_first_guess() {
        let mut balance = Balance::default();
        for index in 0..200_u32 {
            let work = 1000.0 * 4_f64.powi((index % 5) as i32);
            let stall = if index % 20 == 7 { 5.0 } else { 1.0 };
            balance.push([1.0, work], (1e-5 + 1e-9 * work) * stall);
        }
        for old in [[1e-6, 1e-8], [1e-3, 1e-12]] {
            let [fixed, work] = balance.solve(old).expect("parts differ");
            let ratio = fixed / work / 1e4;
            println!("ratio {ratio:.3} of the true one, expected 1 within 0.1");
            assert!((ratio - 1.0).abs() < 0.1);
        }
    }

    #[test]
    fn parts_that_are_alike_tell_nothing() {
        let mut balance = Balance::default();
        assert_eq!(balance.solve([1.0, 1.0]), None);
        (0..100).for_each(|_| balance.push([1.0, 1e6], 1e-3));
        assert_eq!(balance.solve([1.0, 1.0]), None);
        for secs in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-320] {
            balance.push([1.0, f64::MAX], secs);
        }
        assert_eq!(balance.solve([1.0, 1.0]), None);
    }
}
