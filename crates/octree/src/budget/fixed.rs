//! Errors as integers, so that sums are exact and in any order the same.

/// Of sums of bytes and sums of errors: products of two of them fit in 128 bits, and so do sums of two products.
pub(super) const SUM_BITS: u32 = 62;

/// How errors are counted: in units of a power of two, so that errors of enough trailing zeros are exact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    /// The unit is `2^exponent`.
    exponent: i32,
    /// Units of one finest node whose error is unknown: above every sum of known ones.
    unknown: u64,
}

impl Scale {
    /// A scale for nodes whose largest known errors are `largest_errors`, in a tree of `num_finest` finest nodes.
    pub(super) fn new(largest_errors: &[f64], has_unknown: bool, num_finest: usize) -> Self {
        let largest = largest_errors.iter().copied().fold(0.0, f64::max);
        // Half of what there is room for: each node is rounded up, by less than a unit.
        let parts = if has_unknown { num_finest as u64 + 1 } else { 1 };
        let room_bits = SUM_BITS - 1 - parts.next_power_of_two().ilog2();
        let exponent = if largest > 0.0 {
            // Divided, since the errors may be too large to be summed as they are.
            let sum: f64 = largest_errors.iter().map(|error| error / largest).sum();
            exponent_of(largest) + exponent_of(sum) + 2 - room_bits as i32
        } else {
            0
        };
        // That the sum above was rounded is in it.
        let unknown = (1 << room_bits) + (1 << (room_bits - 20)) + largest_errors.len() as u64;
        Self { exponent, unknown }
    }

    /// The units of an error of a node that covers `num_finest` finest ones.
    pub(super) fn units_of(&self, error: f64, num_finest: u64) -> u64 {
        if error.is_nan() || error == f64::INFINITY {
            self.unknown * num_finest
        } else if error > 0.0 {
            // At least one: the quotient may vanish.
            (times_power(error, -self.exponent).ceil() as u64).max(1)
        } else {
            0
        }
    }

    /// The error of a sum of units; rises with it.
    pub(super) fn error_of(&self, units: u64) -> f64 {
        if units >= self.unknown { f64::INFINITY } else { times_power(units as f64, self.exponent) }
    }
}

/// The largest whole number whose power of two is not above `x`, which is finite and above 0.
fn exponent_of(x: f64) -> i32 {
    match (x.to_bits() >> 52) as i32 {
        0 => x.to_bits().ilog2() as i32 - 1074,
        biased => biased - 1023,
    }
}

/// `x * 2^exponent`, for exponents of twice the range of `f64`.
fn times_power(x: f64, exponent: i32) -> f64 {
    let power = |exponent: i32| f64::from_bits(((exponent + 1023) as u64) << 52);
    let half = exponent / 2;
    x * power(half) * power(exponent - half)
}
