//! Colours that people with any colour vision can tell apart, and scales from values to colours.

use super::axis::{AxisScale, Tick, extremes};
use super::label::format_significant;
use super::scene::Colour;

/// The colours of the good side of a limit, from the end of the scale to the limit. Basis: the
/// light blues of ColorBrewer's Blues (colorbrewer2.org, C. Brewer, Apache-2.0), all darker than
/// paper.
const GOOD_COLOURS: [u32; 5] = [0xe1_ed_f8, 0xcf_e1_f2, 0xb5_d4_e9, 0x93_c3_df, 0x6b_ae_d6];

/// The colours of the bad side, from the limit to the end of the scale. Basis: the reds of
/// ColorBrewer's RdBu that are darker than [`GOOD_COLOURS`]. Lightness falls from one end of the
/// scale to the other, so that a print without colour shows the sides; blue against red is safe for
/// colour-blind readers.
const BAD_COLOURS: [u32; 5] = [0xe8_86_66, 0xd6_60_4d, 0xc4_3c_3c, 0xb2_18_2b, 0x67_00_1f];

/// The colours below the centre of a scale without a limit, from its end to the centre. Basis: the
/// blues of ColorBrewer's RdBu; the centre is light grey and both sides darken equally.
const LOW_COLOURS: [u32; 5] = [0x05_30_61, 0x21_66_ac, 0x43_93_c3, 0x92_c5_de, 0xf2_f2_f2];
/// The colours above the centre of a scale without a limit: the reds of ColorBrewer's RdBu.
const HIGH_COLOURS: [u32; 5] = [0xf2_f2_f2, 0xf4_a5_82, 0xd6_60_4d, 0xb2_18_2b, 0x67_00_1f];

/// Minimum end of a scale of factors. Basis: changes below 2 % stay next to colourless, even if all
/// are smaller. Doubling the excess over 1 hides changes below 4 %.
const MIN_FACTOR_END: f64 = 1.02;

/// Anchors of a sequential scale: about every ninth colour of viridis (matplotlib, CC0).
const VIRIDIS: [u32; 10] = [
    0x44_01_54, 0x48_28_78, 0x3e_49_89, 0x31_68_8e, 0x26_82_8e, 0x1f_9e_89, 0x35_b7_79, 0x6e_ce_58,
    0xb5_de_2b, 0xfd_e7_25,
];

/// Distinct colours of curves, in order of contrast: the palette of Okabe and Ito without yellow
/// and black (jfly.uni-koeln.de/color).
pub const DISTINCT_COLOURS: [Colour; 6] = [
    Colour::hex(0x0072b2),
    Colour::hex(0xd55e00),
    Colour::hex(0x009e73),
    Colour::hex(0xcc79a7),
    Colour::hex(0xe69f00),
    Colour::hex(0x56b4e9),
];

/// The colour of the nonlinear model in every figure.
pub const NONLINEAR_COLOUR: Colour = DISTINCT_COLOURS[0];
/// The colour of the linear model in every figure.
pub const LINEAR_COLOUR: Colour = DISTINCT_COLOURS[1];
/// The colour of cells with points on both sides of a limit: Okabe and Ito's yellow, which no scale
/// here has.
pub(crate) const BOTH_SIDES_COLOUR: Colour = Colour::hex(0xf0e442);
/// The colour of dots on the good side of a limit: a blue that is dark enough for a dot on paper.
pub(crate) const GOOD_SIDE_COLOUR: Colour = Colour::hex(0x3182bd);
/// The colour of dots on the bad side of a limit.
pub(crate) const BAD_SIDE_COLOUR: Colour = Colour::hex(BAD_COLOURS[3]);
/// The colour of speed ranges with an unstable response, translucent behind curves.
pub(crate) const UNSTABLE_SHADE: Colour = Colour::hex(0xcc79a7).with_alpha(70);
/// The colour of points that failed.
pub const FAILED_COLOUR: Colour = Colour::hex(0xbfc5cc);

/// Number of steps of a colour scale. Basis: few enough that neighbouring cells merge to one shape,
/// and enough to look continuous. Doubling it nearly doubles the size of an SVG map.
pub(crate) const COLOUR_STEPS: usize = 64;

/// A scale from values to colours.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ColourScale {
    /// The range of values from the first colour to the last.
    pub(crate) axis_scale: AxisScale,
    /// The value in the middle of a diverging scale; each of its sides has half of the colours,
    /// even if the sides differ in extent. `None` for a sequential scale, from dark to light.
    pub(crate) centre: Option<f64>,
    /// Whether low values are the bad ones, which are red.
    is_reversed: bool,
    /// Whether the centre is not a limit, so that values near it are grey.
    is_neutral: bool,
}

impl ColourScale {
    const fn sequential(axis_scale: AxisScale) -> Self {
        Self { axis_scale, centre: None, is_reversed: false, is_neutral: false }
    }

    const fn diverging(axis_scale: AxisScale, limit: f64, is_reversed: bool) -> Self {
        Self { axis_scale, centre: Some(limit), is_reversed, is_neutral: false }
    }

    /// Returns the scale of ratios around a limit, logarithmic.
    pub(crate) fn for_ratios(
        values: impl Iterator<Item = f64>,
        limit: f64,
        is_reversed: bool,
    ) -> Self {
        let (low, high) = extremes(values.filter(|value| *value > 0.0)).unwrap_or((limit, limit));
        let axis_scale = AxisScale::logarithmic(low.min(limit / 2.0), high.max(limit * 2.0));
        Self::diverging(axis_scale, limit, is_reversed)
    }

    /// Returns the scale of factors, which reaches as far below 1 as above it.
    pub(crate) fn for_factors(values: impl Iterator<Item = f64>) -> Self {
        let greater_factor =
            |greatest_so_far: f64, value: f64| greatest_so_far.max(value).max(1.0 / value);
        let scale_end = values.filter(|value| *value > 0.0).fold(MIN_FACTOR_END, greater_factor);
        Self {
            is_neutral: true,
            ..Self::diverging(AxisScale::logarithmic(1.0 / scale_end, scale_end), 1.0, false)
        }
    }

    /// Returns the scale of differences, which reaches as far below 0 as above it. `is_reversed` if
    /// less is worse.
    pub(crate) fn for_differences(values: impl Iterator<Item = f64>, is_reversed: bool) -> Self {
        let greater_magnitude = |greatest_so_far: f64, value: f64| greatest_so_far.max(value.abs());
        let scale_end = values.filter(|value| value.is_finite()).fold(0.0, greater_magnitude);
        let scale_end = if scale_end > 0.0 { scale_end } else { 1.0 };
        Self {
            is_neutral: true,
            ..Self::diverging(AxisScale::linear(-scale_end, scale_end), 0.0, is_reversed)
        }
    }

    /// Returns the scale of values with a limit, which is in the middle. Values that lie on one
    /// side of it have all colours of a sequential scale. `is_reversed` if less is worse.
    pub(crate) fn with_limit(
        values: impl Iterator<Item = f64>,
        limit: f64,
        is_reversed: bool,
    ) -> Self {
        match extremes(values) {
            Some((low, high)) if low < limit && high > limit => {
                Self::diverging(AxisScale::linear(low, high), limit, is_reversed)
            }
            extremes => Self::sequential_over(extremes.unwrap_or((0.0, 1.0))),
        }
    }

    /// Returns the sequential scale from the least value to the greatest.
    fn sequential_over((low, high): (f64, f64)) -> Self {
        let high = if high > low { high } else { low + (0.1 * low.abs()).max(f64::EPSILON) };
        Self::sequential(AxisScale::linear(low, high))
    }

    /// Returns the scale of values without a limit: logarithmic if all are positive and span more
    /// than a factor of ten.
    pub(crate) fn without_limit(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = extremes(values).unwrap_or((0.5, 1.0));
        if low <= 0.0 {
            return Self::sequential_over((low, high));
        }
        let (low, high) = if high > low { (low, high) } else { (0.9 * low, 1.1 * low) };
        Self::sequential(if high > 10.0 * low {
            AxisScale::logarithmic(low, high)
        } else {
            AxisScale::linear(low, high)
        })
    }

    /// Returns the position of a value among the colours, from 0 to 1; values off the scale have
    /// that of its end.
    pub(crate) fn position(&self, value: f64) -> f64 {
        let position = match self.centre {
            Some(centre) => {
                let offset = self.axis_scale.coordinate(value) - self.axis_scale.coordinate(centre);
                let [low, centre, high] = [self.axis_scale.from, centre, self.axis_scale.to]
                    .map(|value| self.axis_scale.coordinate(value));
                let half_length = if offset < 0.0 { centre - low } else { high - centre };
                0.5 + 0.5 * offset / half_length
            }
            None => self.axis_scale.position(value),
        };
        position.clamp(0.0, 1.0)
    }

    /// Returns the colour step of a value.
    pub(crate) fn step_index(&self, value: f64) -> usize {
        ((self.position(value) * COLOUR_STEPS as f64) as usize).min(COLOUR_STEPS - 1)
    }

    /// Returns the colour of a step.
    pub(crate) fn colour(&self, step_index: usize) -> Colour {
        let position = (step_index as f64 + 0.5) / COLOUR_STEPS as f64;
        if self.centre.is_none() {
            return blend(&VIRIDIS, position);
        }
        let position = if self.is_reversed { 1.0 - position } else { position };
        let [below, above] = if self.is_neutral {
            [&LOW_COLOURS, &HIGH_COLOURS]
        } else {
            [&GOOD_COLOURS, &BAD_COLOURS]
        };
        if position < 0.5 {
            blend(below, 2.0 * position)
        } else {
            blend(above, 2.0 * position - 1.0)
        }
    }

    /// Returns the ticks of the colour bar.
    pub(crate) fn ticks(&self) -> Vec<Tick> {
        let Some(centre) = self.centre else { return self.axis_scale.ticks(6) };
        let mut ticks = AxisScale { to: centre, ..self.axis_scale }.ticks(3);
        ticks.extend(AxisScale { from: centre, ..self.axis_scale }.ticks(4));
        ticks.retain(|tick| (self.position(tick.value) - 0.5).abs() > 0.04);
        ticks.push(Tick { value: centre, label: format_significant(centre, 3) });
        ticks
    }
}

/// Returns the colour at `fraction` (0 to 1) of the range between evenly spaced anchors.
fn blend(anchors: &[u32], fraction: f64) -> Colour {
    let position = fraction.clamp(0.0, 1.0) * (anchors.len() - 1) as f64;
    let lower_index = (position as usize).min(anchors.len() - 2);
    let upper_weight = position - lower_index as f64;
    let lower_colour = Colour::hex(anchors[lower_index]).rgb;
    let upper_colour = Colour::hex(anchors[lower_index + 1]).rgb;
    let rgb = std::array::from_fn(|k| {
        (f64::from(lower_colour[k]) * (1.0 - upper_weight)
            + f64::from(upper_colour[k]) * upper_weight)
            .round() as u8
    });
    Colour { rgb, alpha: 255 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_the_middle_of_the_scale() {
        let scale = ColourScale::for_ratios([1.0, 1.3, 50.0].into_iter(), 2.0, false);
        assert_eq!(scale.position(1.0), 0.0);
        assert_eq!(scale.position(2.0), 0.5);
        assert_eq!(scale.position(50.0), 1.0);
        assert!(
            (scale.position(10.0) - 0.75).abs() < 1e-12,
            "halfway between 2 and 50 by the logarithm"
        );
        assert_eq!(scale.step_index(1e9), COLOUR_STEPS - 1);
        let [red, _, blue] = scale.colour(COLOUR_STEPS - 1).rgb;
        assert!(red > blue, "the unreliable side is red");
    }

    #[test]
    fn lightness_falls_along_a_scale_and_jumps_at_the_limit() {
        let scale = ColourScale::for_ratios([1.0, 9.0].into_iter(), 2.0, false);
        let luminance = |step_index| {
            let [red, green, blue] = scale.colour(step_index).rgb.map(f64::from);
            0.2126 * red + 0.7152 * green + 0.0722 * blue
        };
        assert!(
            (1..COLOUR_STEPS).all(|step_index| luminance(step_index) < luminance(step_index - 1))
        );
        assert!(
            luminance(COLOUR_STEPS / 2 - 1) - luminance(COLOUR_STEPS / 2) > 8.0,
            "a step at the limit"
        );
    }

    #[test]
    fn values_on_one_side_of_the_limit_have_all_colours() {
        let scale = ColourScale::with_limit([0.004, 0.012].into_iter(), 0.0, true);
        assert_eq!([0.004, 0.012].map(|gap| scale.position(gap)), [0.0, 1.0]);
        let mixed_scale = ColourScale::with_limit([-0.001, 0.012].into_iter(), 0.0, true);
        assert_eq!([-0.001, 0.0, 0.012].map(|gap| mixed_scale.position(gap)), [0.0, 0.5, 1.0]);
        assert!(ColourScale::without_limit([3.0, 3.0].into_iter()).position(3.0).is_finite());
    }

    #[test]
    fn small_changes_are_nearly_grey() {
        let saturation = |scale: &ColourScale, value: f64| {
            let rgb = scale.colour(scale.step_index(value)).rgb;
            rgb.iter().max().unwrap() - rgb.iter().min().unwrap()
        };
        let factors = ColourScale::for_factors([0.9995, 1.0005].into_iter());
        assert!([0.9995, 1.0, 1.0005].iter().all(|factor| saturation(&factors, *factor) < 24));
        let factors = ColourScale::for_factors([0.5, 1.1].into_iter());
        assert!(saturation(&factors, 1.0) < 24 && saturation(&factors, 0.5) > 70);
        assert_eq!(factors.position(2.0), 1.0, "as far above 1 as below it");
        let gap_scale = ColourScale::for_differences([-0.001, 0.004].into_iter(), true);
        assert!(saturation(&gap_scale, 0.0) < 24);
        assert_eq!([-0.004, 0.0, 0.004].map(|gap| gap_scale.position(gap)), [0.0, 0.5, 1.0]);
        let [red, _, blue] = gap_scale.colour(gap_scale.step_index(-0.003)).rgb;
        assert!(red > blue, "a gap that got smaller is worse");
        let constant_scale = ColourScale::for_differences([0.0, 0.0].into_iter(), true);
        assert!(constant_scale.position(0.0).is_finite());
    }

    #[test]
    fn values_beyond_a_lower_limit_are_red() {
        let [red, _, blue] =
            ColourScale::with_limit([-0.004, 0.008].into_iter(), 0.0, true).colour(0).rgb;
        assert!(red > blue);
    }
}
