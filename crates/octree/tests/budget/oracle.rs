//! The optimum, by the table that the definition gives: for each number of bytes the least error of a subtree.

use volery_pyramid::{Layout, Node};

use crate::Prices;

/// The least error of a subtree with at most `bytes` bytes, for each number of bytes up to the most of any use;
/// infinite where the subtree does not fit.
pub(crate) fn least_errors(layout: &Layout, prices: &Prices, node: Node) -> Vec<f64> {
    let own = layout.resolutions(node).filter_map(|resolution| prices.get(&(node, resolution)));
    let mut table = Vec::new();
    for price in own {
        let bytes = price.bytes as usize;
        if table.len() <= bytes {
            table.resize(bytes + 1, f64::INFINITY);
        }
        table[bytes] = f64::min(table[bytes], price.error);
    }
    let children = layout.children(node).map(|child| least_errors(layout, prices, child));
    if let Some(split) = children.reduce(|a, b| sums(&a, &b)) {
        let length = table.len().max(split.len());
        table.resize(length, f64::INFINITY);
        for (least, error) in table.iter_mut().zip(split) {
            *least = least.min(error);
        }
    }
    // At most, not exactly.
    for bytes in 1..table.len() {
        table[bytes] = table[bytes].min(table[bytes - 1]);
    }
    table
}

/// The best way to share out each number of bytes to two parts.
fn sums(a: &[f64], b: &[f64]) -> Vec<f64> {
    if a.is_empty() || b.is_empty() {
        return Vec::new();
    }
    let mut sums = vec![f64::INFINITY; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate().filter(|(_, x)| x.is_finite()) {
        for (j, y) in b.iter().enumerate() {
            sums[i + j] = sums[i + j].min(x + y);
        }
    }
    sums
}
