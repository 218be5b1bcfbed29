//! Colour maps as ParaView saves them, turned into transfer functions.
//!
//! A map is a list of colours with a space to interpolate in, and maybe a list of opacities. A
//! [`TransferFunction`] is linear in RGB, so the map is resampled: each interval is halved until the straight
//! line is within [`MAX_COLOR_ERROR`] of the true colour in every channel, and within [`MAX_OPACITY_ERROR`] of the
//! true opacity. Opacities between two points follow the curve that VTK 9.7 has for midpoint and sharpness.

use volery_scene::{ControlPoint, TransferFunction, transfer};

use super::color::ColorSpace;

/// The largest difference of a resampled channel from the map's own interpolation.
pub const MAX_COLOR_ERROR: f64 = 1.0 / 512.0;

/// The largest difference of a resampled opacity from the map's own interpolation.
pub const MAX_OPACITY_ERROR: f64 = 1e-3;

/// Halvings of an eighth of an interval; what is left then is below a step of 16-bit values.
const MAX_HALVINGS: u32 = 13;

/// One opacity of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpacityPoint {
    /// In the map's units.
    pub value: f64,
    /// In [0, 1].
    pub opacity: f64,
    /// Where in the interval up to the next point half of the change is reached, in [0, 1]; no nearer to an end
    /// than 1e-5 counts.
    pub midpoint: f64,
    /// Below 0.01: linear up to the midpoint and from there on; up to 1: ever steeper at the midpoint, never a step.
    pub sharpness: f64,
}

/// A colour map: colours over values, in a space of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorMap {
    /// Its name.
    pub name: String,
    /// The space to interpolate in.
    pub space: ColorSpace,
    /// Values, not falling, and their colours; at least one.
    pub colors: Vec<(f64, [f64; 3])>,
    /// Opacities by value, not falling; none means a ramp from 0 to 1.
    pub opacities: Vec<OpacityPoint>,
}

impl ColorMap {
    /// The transfer function of this map over the value range asked for, or else over its own; opacities
    /// are per `unit_distance` world units.
    ///
    /// Colours and opacities are stretched onto `range` each from their own ends, as ParaView does.
    ///
    /// # Errors
    /// When the map has colours or opacities outside [0, 1], or values that are not finite.
    pub fn transfer_function(
        &self,
        range: Option<[f64; 2]>,
        unit_distance: f64,
    ) -> Result<TransferFunction, transfer::Error> {
        self.check()?;
        let own = ends(self.colors.iter().map(|(value, _)| *value));
        let [low, high] = range.unwrap_or(own);
        let colors = self.color_line(stretch(own, [low, high]));
        let opacities = if self.opacities.is_empty() {
            vec![(low, [0.0]), (high, [1.0])]
        } else {
            let own = ends(self.opacities.iter().map(|point| point.value));
            self.opacity_line(stretch(own, if range.is_some() { [low, high] } else { own }))
        };
        TransferFunction::new(merged(&colors, &opacities), unit_distance)
    }

    /// Whether colours and opacities, before resampling, are those of a transfer function.
    fn check(&self) -> Result<(), transfer::Error> {
        let color = |&(value, color)| ControlPoint { value, color, opacity: 0.0 };
        TransferFunction::new(self.colors.iter().map(color).collect(), 1.0)?;
        if !self.opacities.is_empty() {
            let opacity = |point: &OpacityPoint| ControlPoint {
                value: point.value,
                color: [0.0; 3],
                opacity: point.opacity,
            };
            TransferFunction::new(self.opacities.iter().map(opacity).collect(), 1.0)?;
        }
        Ok(())
    }

    fn color_line(&self, place: impl Fn(f64) -> f64) -> Line<3> {
        let mut line = Line::new();
        for pair in self.colors.windows(2) {
            let [(low, from), (high, to)] = [pair[0], pair[1]];
            line.push((place(low), from));
            if self.space == ColorSpace::Step {
                line.push((place(low), to));
            } else if low < high && self.space != ColorSpace::Rgb {
                let at = |s: f64| self.space.interpolate(from, to, s);
                let inner = refined(MAX_COLOR_ERROR, [0.0, 1.0], at).into_iter();
                line.extend(inner.map(|(s, color)| (place(low + (high - low) * s), color)));
            }
        }
        line.extend(self.colors.last().map(|&(value, color)| (place(value), color)));
        line
    }

    fn opacity_line(&self, place: impl Fn(f64) -> f64) -> Line<1> {
        let mut line = Line::new();
        for pair in self.opacities.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            let value_at = |part: f64| from.value + (to.value - from.value) * from.place_of(part);
            line.push((place(from.value), [from.opacity]));
            if from.value == to.value || from.is_linear() && from.midpoint == 0.5 {
                continue;
            }
            // What has a kink at the midpoint is smooth on either side.
            for half in [[0.0, 0.5], [0.5, 1.0]] {
                if half[0] > 0.0 {
                    line.push((place(value_at(0.5)), [from.halfway(to.opacity)]));
                }
                if !from.is_linear() {
                    let curve = |part: f64| [from.shaped(to.opacity, part)];
                    let inner = refined(MAX_OPACITY_ERROR, half, curve);
                    line.extend(inner.into_iter().map(|(part, opacity)| (place(value_at(part)), opacity)));
                }
            }
        }
        line.extend(self.opacities.last().map(|point| (place(point.value), [point.opacity])));
        line
    }
}

/// Points of a piecewise linear function, values not falling; two of one value make a step.
type Line<const N: usize> = Vec<(f64, [f64; N])>;

fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

/// The linear map of one range onto another; a range without length goes to the lower end.
fn stretch([from_low, from_high]: [f64; 2], [low, high]: [f64; 2]) -> impl Fn(f64) -> f64 {
    move |value| {
        if [from_low, from_high] == [low, high] {
            value
        } else if from_high > from_low {
            let s = (value - from_low) / (from_high - from_low);
            // Exact at both ends, and rising.
            if s >= 1.0 { high } else { (low + (high - low) * s).min(high) }
        } else {
            low
        }
    }
}

/// The curve from a point to the next, as VTK's piecewise function has it. The way there is told in parts of which half
/// is before the midpoint.
impl OpacityPoint {
    /// As VTK keeps it off the ends.
    fn midpoint(&self) -> f64 {
        self.midpoint.clamp(1e-5, 1.0 - 1e-5)
    }

    fn is_linear(&self) -> bool {
        self.sharpness < 0.01
    }

    /// How far along the interval a part of the way is.
    fn place_of(&self, part: f64) -> f64 {
        let midpoint = self.midpoint();
        if part < 0.5 { 2.0 * part * midpoint } else { midpoint + (2.0 * part - 1.0) * (1.0 - midpoint) }
    }

    /// The opacity at the midpoint.
    fn halfway(&self, to: f64) -> f64 {
        0.5 * (self.opacity + to)
    }

    /// The opacity at a part of the way to the opacity `to`, where it is not linear: a Hermite curve of a place that
    /// sharpness draws to the ends.
    fn shaped(&self, to: f64, part: f64) -> f64 {
        let OpacityPoint { opacity, sharpness, .. } = *self;
        let power = 1.0 + 10.0 * sharpness;
        let s = if part < 0.5 {
            0.5 * (2.0 * part).powf(power)
        } else {
            1.0 - 0.5 * (2.0 - 2.0 * part).powf(power)
        };
        let (s2, s3) = (s * s, s * s * s);
        let slope = (1.0 - sharpness) * (to - opacity);
        let ends = (2.0 * s3 - 3.0 * s2 + 1.0) * opacity + (3.0 * s2 - 2.0 * s3) * to;
        let tangents = (s3 - 2.0 * s2 + s + s3 - s2) * slope;
        (ends + tangents).clamp(opacity.min(to), opacity.max(to))
    }
}

/// The inner points of a curve over an interval, so many that straight lines are within `max_error`.
fn refined<const N: usize>(
    max_error: f64,
    [first, last]: [f64; 2],
    curve: impl Fn(f64) -> [f64; N],
) -> Line<N> {
    const PARTS: u32 = 8;
    let mut line = Line::new();
    for part in 0..PARTS {
        let [s0, s1] = [part, part + 1].map(|n| first + (last - first) * f64::from(n) / f64::from(PARTS));
        if part > 0 {
            line.push((s0, curve(s0)));
        }
        // Checked at points, so with a reserve of two.
        halve([s0, s1], (max_error / 2.0, MAX_HALVINGS), &curve, &mut |s| line.push((s, curve(s))));
    }
    line
}

fn halve<const N: usize>(
    [s0, s1]: [f64; 2],
    (aim, halvings): (f64, u32),
    curve: &impl Fn(f64) -> [f64; N],
    add: &mut impl FnMut(f64),
) {
    const CHECKS: u32 = 8;
    let [start, end] = [curve(s0), curve(s1)];
    let is_straight = (1..CHECKS).all(|check| {
        let w = f64::from(check) / f64::from(CHECKS);
        let truth = curve(s0 + (s1 - s0) * w);
        (0..N).all(|i| (start[i] + (end[i] - start[i]) * w - truth[i]).abs() <= aim)
    });
    if is_straight || halvings == 0 {
        return;
    }
    let middle = (s0 + s1) / 2.0;
    halve([s0, middle], (aim, halvings - 1), curve, add);
    add(middle);
    halve([middle, s1], (aim, halvings - 1), curve, add);
}

/// Both lines as one list of control points, exactly: a point wherever one of them has one.
fn merged(colors: &Line<3>, opacities: &Line<1>) -> Vec<ControlPoint> {
    let mut values: Vec<f64> =
        colors.iter().map(|(value, _)| *value).chain(opacities.iter().map(|(value, _)| *value)).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let mut points = Vec::with_capacity(values.len());
    for value in values {
        let [below, above] = sides(colors, value);
        let [[below_opacity], [above_opacity]] = sides(opacities, value);
        points.push(ControlPoint { value, color: below, opacity: below_opacity });
        if below != above || below_opacity != above_opacity {
            points.push(ControlPoint { value, color: above, opacity: above_opacity });
        }
    }
    points
}

/// The limits of a line at a value, from below and from above.
fn sides<const N: usize>(line: &Line<N>, value: f64) -> [[f64; N]; 2] {
    let first = line.partition_point(|(x, _)| *x < value);
    let past = line.partition_point(|(x, _)| *x <= value);
    if first < past {
        // At the first point nothing is below it but its own colour.
        return [line[first].1, line[past - 1].1];
    }
    let [below, above] = [line.get(first.wrapping_sub(1)), line.get(first)];
    let at = match (below, above) {
        (Some((x0, a)), Some((x1, b))) => {
            let w = (value - x0) / (x1 - x0);
            std::array::from_fn(|i| a[i] + (b[i] - a[i]) * w)
        }
        (Some((_, only)), None) | (None, Some((_, only))) => *only,
        (None, None) => [0.0; N],
    };
    [at; 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(space: ColorSpace, colors: &[(f64, [f64; 3])]) -> ColorMap {
        ColorMap { name: "test".to_owned(), space, colors: colors.to_vec(), opacities: Vec::new() }
    }

    #[test]
    fn resampling_keeps_its_bound_in_every_space() {
        let levels = [0.0, 0.3, 1.0];
        let colors: Vec<[f64; 3]> =
            (0..27).map(|i| [levels[i % 3], levels[i / 3 % 3], levels[i / 9]]).collect();
        for space in [ColorSpace::Hsv, ColorSpace::HsvWrapped, ColorSpace::Lab, ColorSpace::Diverging] {
            let mut worst = 0.0_f64;
            let mut most_points = 0;
            for &a in &colors {
                for &b in &colors {
                    let tf = map(space, &[(-3.0, a), (5.0, b)]).transfer_function(None, 1.0).unwrap();
                    most_points = most_points.max(tf.points().len());
                    for i in 1..1000 {
                        let s = f64::from(i) / 1000.0;
                        let (found, _) = tf.classify(-3.0 + 8.0 * s);
                        let truth = space.interpolate(a, b, s);
                        worst = (0..3).map(|c| (found[c] - truth[c]).abs()).fold(worst, f64::max);
                    }
                }
            }
            println!(
                "{space:?}: worst error {worst:.6} of {MAX_COLOR_ERROR:.6}, at most {most_points} points"
            );
            assert!(worst <= MAX_COLOR_ERROR, "{space:?}: {worst}");
            assert!(most_points < 1000, "{space:?}: {most_points} points");
        }
    }

    #[test]
    fn rgb_maps_are_exact_and_small() {
        let colors = [(0.0, [0.0; 3]), (0.25, [1.0, 0.5, 0.0]), (1.0, [1.0; 3])];
        let tf = map(ColorSpace::Rgb, &colors).transfer_function(Some([100.0, 500.0]), 2.0).unwrap();
        let points = tf.points();
        assert_eq!(points.len(), 3);
        assert_eq!(points[1], ControlPoint { value: 200.0, color: [1.0, 0.5, 0.0], opacity: 0.25 });
        assert_eq!((points[0].opacity, points[2].opacity, tf.unit_distance()), (0.0, 1.0, 2.0));
    }

    #[test]
    fn steps_take_the_upper_colour() {
        let colors = [(0.0, [0.1; 3]), (1.0, [0.5; 3]), (2.0, [0.9; 3])];
        let tf = map(ColorSpace::Step, &colors).transfer_function(None, 1.0).unwrap();
        for (value, gray) in [(-1.0, 0.1), (0.0, 0.5), (0.7, 0.5), (1.0, 0.9), (1.5, 0.9), (3.0, 0.9)] {
            assert_eq!(tf.classify(value).0, [gray; 3], "at {value}");
        }
    }

    /// `[from, to, midpoint, sharpness]` of an interval, and what `vtkPiecewiseFunction` of VTK 9.7.2 returns at
    /// [`PLACES`] of it.
    const VTK: [([f64; 4], [f64; 7]); 16] = [
        ([0.0, 1.0, 0.5, 1.0], [0.0000000, 0.0000000, 0.0009837, 0.5000000, 0.9982387, 1.0000000, 1.0000000]),
        ([0.2, 0.9, 0.3, 0.5], [0.2000002, 0.2173275, 0.7459934, 0.8723330, 0.8953508, 0.8999047, 0.9000000]),
        (
            [0.9, 0.1, 0.7, 0.995],
            [0.9000000, 0.9000000, 0.8999976, 0.8995764, 0.8613131, 0.1001064, 0.1000000],
        ),
        ([0.0, 1.0, 0.5, 0.9], [0.0000000, 0.0000053, 0.0040717, 0.5000000, 0.9940555, 0.9999947, 1.0000000]),
        ([0.1, 0.6, 0.0, 0.4], [0.3922261, 0.5364973, 0.5836840, 0.5951673, 0.5988020, 0.5999520, 0.6000000]),
        ([0.1, 0.6, 1.0, 0.4], [0.1000000, 0.1000480, 0.1010474, 0.1048327, 0.1149633, 0.1635027, 0.2949385]),
        (
            [1.0, 0.0, 0.25, 0.01],
            [0.9518804, 0.6093452, 0.4123176, 0.3193051, 0.2357302, 0.1160343, 0.0197043],
        ),
        (
            [0.3, 0.8, 0.6, 0.0099],
            [0.3125000, 0.3833333, 0.4541667, 0.5083333, 0.5625000, 0.6750000, 0.7750000],
        ),
        (
            [0.324, 0.151, 0.651, 0.072],
            [0.3235963, 0.3133026, 0.2924564, 0.2700454, 0.2447118, 0.1830090, 0.1529393],
        ),
        (
            [0.536, 0.366, 0.058, 0.507],
            [0.5352122, 0.3893365, 0.3701207, 0.3669258, 0.3661705, 0.3660034, 0.3660000],
        ),
        (
            [0.037, 0.434, 0.07, 0.091],
            [0.0737618, 0.2872282, 0.3430938, 0.3765754, 0.4005143, 0.4243422, 0.4335568],
        ),
        (
            [0.425, 0.827, 0.124, 0.223],
            [0.4266028, 0.6823967, 0.7660733, 0.7997745, 0.8161814, 0.8256719, 0.8269927],
        ),
        (
            [0.627, 0.948, 0.577, 0.397],
            [0.6270000, 0.6275024, 0.6387461, 0.6937442, 0.8647061, 0.9456058, 0.9479992],
        ),
        (
            [0.976, 0.047, 0.858, 0.29],
            [0.9759993, 0.9748713, 0.9633117, 0.9329830, 0.8685847, 0.6376332, 0.0493673],
        ),
        (
            [0.144, 0.118, 0.308, 0.816],
            [0.1440000, 0.1439484, 0.1214606, 0.1181625, 0.1180101, 0.1180000, 0.1180000],
        ),
        (
            [0.181, 0.582, 0.639, 0.372],
            [0.1810001, 0.1815255, 0.1911778, 0.2304460, 0.3500110, 0.5738309, 0.5819961],
        ),
    ];

    const PLACES: [f64; 7] = [0.03, 0.2, 0.37, 0.5, 0.62, 0.8, 0.96];

    /// A map of one interval of values from -2 to 6, and its first point.
    fn interval([from, to, midpoint, sharpness]: [f64; 4]) -> (ColorMap, OpacityPoint) {
        let first = OpacityPoint { value: -2.0, opacity: from, midpoint, sharpness };
        let last = OpacityPoint { value: 6.0, opacity: to, midpoint: 0.5, sharpness: 0.0 };
        let map = map(ColorSpace::Rgb, &[(-2.0, [0.0; 3]), (6.0, [1.0; 3])]);
        (ColorMap { opacities: vec![first, last], ..map }, first)
    }

    /// The curve at a place of the interval, none of it resampled.
    fn curve(point: OpacityPoint, to: f64, place: f64) -> f64 {
        let midpoint = point.midpoint();
        let part = if place < midpoint {
            0.5 * place / midpoint
        } else {
            0.5 + 0.5 * (place - midpoint) / (1.0 - midpoint)
        };
        assert!((point.place_of(part) - place).abs() < 1e-12, "{point:?}: {place}");
        if point.is_linear() { point.opacity + (to - point.opacity) * part } else { point.shaped(to, part) }
    }

    #[test]
    fn opacities_are_those_of_vtk() {
        let (mut worst, mut resampled) = (0.0_f64, 0.0_f64);
        for (case, expected) in VTK {
            let (map, first) = interval(case);
            let transfer = map.transfer_function(None, 1.0).unwrap();
            for (place, expected) in PLACES.into_iter().zip(expected) {
                worst = worst.max((curve(first, case[1], place) - expected).abs());
                resampled = resampled.max((transfer.classify(-2.0 + 8.0 * place).1 - expected).abs());
            }
        }
        println!("off VTK by {worst:.1e} (threshold 1e-6), resampled by {resampled:.1e} (1e-3)");
        assert!(worst <= 1e-6 && resampled <= MAX_OPACITY_ERROR, "{worst} {resampled}");
    }

    #[test]
    fn resampled_opacities_keep_their_bound_with_few_points() {
        let steps = [0.0, 1e-7, 0.004, 0.01, 0.1, 0.37, 0.5, 0.8, 0.99, 0.992, 1.0];
        let (mut worst, mut most_points) = (0.0_f64, 0);
        for (midpoint, sharpness) in steps.iter().flat_map(|&m| steps.map(|s| (m, s))) {
            let (map, first) = interval([0.0, 1.0, midpoint, sharpness]);
            let transfer = map.transfer_function(None, 1.0).unwrap();
            most_points = most_points.max(transfer.points().len());
            // Evenly over the interval, and evenly on either side of the midpoint.
            let even = (0..=5000).map(|i| f64::from(i) / 5000.0);
            for place in even.clone().chain(even.map(|part| first.place_of(part))) {
                let found = transfer.classify(-2.0 + 8.0 * place).1;
                let expected = curve(first, 1.0, place);
                worst = worst.max((found - expected).abs());
            }
        }
        println!(
            "resampled: worst {worst:.2e} of {MAX_OPACITY_ERROR:.0e}, at most {most_points} points of 150"
        );
        assert!(worst <= MAX_OPACITY_ERROR, "{worst}");
        assert!(most_points <= 150, "{most_points} points");
    }

    #[test]
    fn opacities_keep_midpoint_and_sharpness() {
        let point =
            |value, opacity, midpoint, sharpness| OpacityPoint { value, opacity, midpoint, sharpness };
        let opacities = vec![
            point(0.0, 0.0, 0.25, 0.0),
            point(1.0, 1.0, 0.8, 0.0),
            point(2.0, 0.2, 0.3, 0.5),
            point(3.0, 0.8, 0.5, 0.0),
        ];
        let map = ColorMap {
            opacities: opacities.clone(),
            ..map(ColorSpace::Rgb, &[(0.0, [0.0; 3]), (3.0, [1.0; 3])])
        };
        let tf = map.transfer_function(None, 1.0).unwrap();
        for (value, opacity) in
            [(0.25, 0.5), (0.5, 2.0 / 3.0), (1.4, 0.8), (1.8, 0.6), (1.9, 0.4), (2.0, 0.2), (4.0, 0.8)]
        {
            assert!((tf.classify(value).1 - opacity).abs() < 1e-12, "at {value}: {:?}", tf.classify(value));
        }
        assert!((tf.classify(2.3).1 - 0.5).abs() < 1e-12, "half the change at the midpoint");
    }
}
