//! Colour maps as ParaView saves them, turned into transfer functions.
//!
//! A map is a list of colours with a space to interpolate in, and maybe a list of opacities. A
//! [`TransferFunction`] is linear in RGB, so the map is resampled: each interval is halved until the straight
//! line is within [`MAX_COLOR_ERROR`] of the true colour in every channel, and of the true opacity.

use volery_scene::{ControlPoint, TransferFunction, transfer};

use super::color::ColorSpace;

/// The largest difference of a resampled channel from the map's own interpolation.
pub const MAX_COLOR_ERROR: f64 = 1.0 / 512.0;

/// What halving aims at: checked at points, so with a reserve of two.
const AIM: f64 = MAX_COLOR_ERROR / 2.0;

/// Halvings of an eighth of an interval; what is left then is below a step of 16-bit values.
const MAX_HALVINGS: u32 = 13;

/// One opacity of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpacityPoint {
    /// In the map's units.
    pub value: f64,
    /// In [0, 1].
    pub opacity: f64,
    /// Where in the interval up to the next point half of the change is reached, in (0, 1).
    pub midpoint: f64,
    /// 0: linear; 1: a step at the midpoint; between: ever steeper.
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
                refine([low, high], &at, &place, &mut line);
            }
        }
        line.extend(self.colors.last().map(|&(value, color)| (place(value), color)));
        line
    }

    fn opacity_line(&self, place: impl Fn(f64) -> f64) -> Line<1> {
        let mut line = Line::new();
        for pair in self.opacities.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            let value_at = |s: f64| from.value + (to.value - from.value) * s;
            line.push((place(from.value), [from.opacity]));
            if from.sharpness > 0.99 {
                let middle = place(value_at(from.midpoint));
                line.extend([(middle, [from.opacity]), (middle, [to.opacity])]);
            } else if from.sharpness >= 0.01 {
                refine([from.value, to.value], &|s| [shaped(from, to.opacity, s)], &place, &mut line);
            } else if from.midpoint != 0.5 {
                line.push((place(value_at(from.midpoint)), [(from.opacity + to.opacity) / 2.0]));
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

/// The opacity at `s` of the way to the next point, by the Hermite curve with sharpness of VTK's piecewise
/// function.
fn shaped(from: OpacityPoint, to: f64, s: f64) -> f64 {
    let OpacityPoint { opacity, midpoint, sharpness, value: _ } = from;
    let s = if s < midpoint { 0.5 * s / midpoint } else { 0.5 + 0.5 * (s - midpoint) / (1.0 - midpoint) };
    let power = 1.0 + 10.0 * sharpness;
    let s = if s < 0.5 { 0.5 * (2.0 * s).powf(power) } else { 1.0 - 0.5 * (2.0 - 2.0 * s).powf(power) };
    let (s2, s3) = (s * s, s * s * s);
    let slope = (1.0 - sharpness) * (to - opacity);
    let ends = (2.0 * s3 - 3.0 * s2 + 1.0) * opacity + (3.0 * s2 - 2.0 * s3) * to;
    let tangents = (s3 - 2.0 * s2 + s + s3 - s2) * slope;
    (ends + tangents).clamp(opacity.min(to), opacity.max(to))
}

/// Appends the inner points of a curve over an interval, so many that straight lines are near enough.
fn refine<const N: usize>(
    [low, high]: [f64; 2],
    curve: &impl Fn(f64) -> [f64; N],
    place: &impl Fn(f64) -> f64,
    line: &mut Line<N>,
) {
    const PARTS: u32 = 8;
    for part in 0..PARTS {
        let [s0, s1] = [part, part + 1].map(|n| f64::from(n) / f64::from(PARTS));
        if part > 0 {
            line.push((place(low + (high - low) * s0), curve(s0)));
        }
        halve([s0, s1], MAX_HALVINGS, curve, &mut |s| {
            line.push((place(low + (high - low) * s), curve(s)));
        });
    }
}

fn halve<const N: usize>(
    [s0, s1]: [f64; 2],
    halvings: u32,
    curve: &impl Fn(f64) -> [f64; N],
    add: &mut impl FnMut(f64),
) {
    const CHECKS: u32 = 8;
    let [start, end] = [curve(s0), curve(s1)];
    let is_straight = (1..CHECKS).all(|check| {
        let w = f64::from(check) / f64::from(CHECKS);
        let truth = curve(s0 + (s1 - s0) * w);
        (0..N).all(|i| (start[i] + (end[i] - start[i]) * w - truth[i]).abs() <= AIM)
    });
    if is_straight || halvings == 0 {
        return;
    }
    let middle = (s0 + s1) / 2.0;
    halve([s0, middle], halvings - 1, curve, add);
    add(middle);
    halve([middle, s1], halvings - 1, curve, add);
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

    #[test]
    fn opacities_keep_midpoint_and_sharpness() {
        let point =
            |value, opacity, midpoint, sharpness| OpacityPoint { value, opacity, midpoint, sharpness };
        let opacities = vec![
            point(0.0, 0.0, 0.25, 0.0),
            point(1.0, 1.0, 0.5, 1.0),
            point(2.0, 0.2, 0.3, 0.5),
            point(3.0, 0.8, 0.5, 0.0),
        ];
        let map = ColorMap {
            opacities: opacities.clone(),
            ..map(ColorSpace::Rgb, &[(0.0, [0.0; 3]), (3.0, [1.0; 3])])
        };
        let tf = map.transfer_function(None, 1.0).unwrap();
        for (value, opacity) in
            [(0.25, 0.5), (0.5, 2.0 / 3.0), (1.25, 1.0), (1.5, 0.2), (1.75, 0.2), (4.0, 0.8)]
        {
            assert!((tf.classify(value).1 - opacity).abs() < 1e-12, "at {value}: {:?}", tf.classify(value));
        }
        let worst = (0..=1000).map(|i| f64::from(i) / 1000.0);
        let worst =
            worst.map(|s| (tf.classify(2.0 + s).1 - shaped(opacities[2], 0.8, s)).abs()).fold(0.0, f64::max);
        assert!(worst <= MAX_COLOR_ERROR, "{worst}");
        assert_eq!(shaped(opacities[2], 0.8, 0.3), 0.5, "half the change at the midpoint");
    }
}
