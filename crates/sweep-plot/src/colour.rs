//! Colours that people with any colour vision can tell apart, and the scales that put values to
//! them.

use super::axis::{Scale, Tick, extremes};
use super::label::significant;
use super::scene::Colour;

/// The calm side of a limit, from its end to the limit: after the light blues of ColorBrewer's
/// Blues (colorbrewer2.org, C. Brewer, Apache-2.0), none as light as paper.
const BELOW: [u32; 5] = [0xe1_ed_f8, 0xcf_e1_f2, 0xb5_d4_e9, 0x93_c3_df, 0x6b_ae_d6];

/// The other side, from the limit to its end: the reds of ColorBrewer's RdBu, from where they are
/// darker than [`BELOW`] on. Lightness falls from one end of both to the other, so that prints
/// without colour show which side a cell is on; blue against red is safe for the colour-blind.
const ABOVE: [u32; 5] = [0xe8_86_66, 0xd6_60_4d, 0xc4_3c_3c, 0xb2_18_2b, 0x67_00_1f];

/// From the middle of a scale without a limit to either end: nothing is light grey, and both sides
/// get darker alike (the blues and reds of ColorBrewer's RdBu).
const LESS: [u32; 5] = [0x05_30_61, 0x21_66_ac, 0x43_93_c3, 0x92_c5_de, 0xf2_f2_f2];
const MORE: [u32; 5] = [0xf2_f2_f2, 0xf4_a5_82, 0xd6_60_4d, 0xb2_18_2b, 0x67_00_1f];

/// Changes by less than this factor have next to no colour, even where all are smaller.
const LEAST_CHANGE: f64 = 1.02;

/// Every ninth or so colour of viridis (matplotlib, CC0).
const SEQUENTIAL: [u32; 10] = [
    0x44_01_54, 0x48_28_78, 0x3e_49_89, 0x31_68_8e, 0x26_82_8e, 0x1f_9e_89, 0x35_b7_79, 0x6e_ce_58,
    0xb5_de_2b, 0xfd_e7_25,
];

/// Okabe and Ito's palette without yellow and black (jfly.uni-koeln.de/color), darkest contrasts
/// first.
pub const DISTINCT: [Colour; 6] = [
    Colour::hex(0x0072b2),
    Colour::hex(0xd55e00),
    Colour::hex(0x009e73),
    Colour::hex(0xcc79a7),
    Colour::hex(0xe69f00),
    Colour::hex(0x56b4e9),
];

/// The nonlinear model, in every figure.
pub const NONLINEAR: Colour = DISTINCT[0];
/// The linear model, in every figure.
pub const LINEAR: Colour = DISTINCT[1];
/// Cells with points on both sides of a limit: Okabe and Ito's yellow, which no scale here has.
pub(crate) const BOTH: Colour = Colour::hex(0xf0e442);
/// Points on the calm side of a limit: the blue of [`BELOW`]'s family that a dot needs on paper.
pub(crate) const CALM: Colour = Colour::hex(0x3182bd);
/// Points on the other side.
pub(crate) const HARSH: Colour = Colour::hex(ABOVE[3]);
/// Ranges in which a dwell is unstable, behind curves of any colour.
pub(crate) const SHADE: Colour = Colour::hex(0xcc79a7).with_alpha(70);
/// Points that failed.
pub const FAILED: Colour = Colour::hex(0xbfc5cc);

/// Steps of a colour scale: few enough that neighbours merge to one shape, enough to look smooth.
pub(crate) const LEVELS: usize = 64;

/// Values to colours.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ColourScale {
    /// From the value of the first colour to that of the last.
    pub(crate) scale: Scale,
    /// Both sides of this value have half the colours each, whatever their extent. None where there
    /// is one run of colours, dark to light.
    pub(crate) centre: Option<f64>,
    /// The red side is the low one.
    reversed: bool,
    /// The middle is no limit: values near it have no colour.
    neutral: bool,
}

impl ColourScale {
    /// One run of colours.
    const fn sequential(scale: Scale) -> Self {
        Self { scale, centre: None, reversed: false, neutral: false }
    }

    /// Colours on both sides of a limit.
    const fn diverging(scale: Scale, limit: f64, reversed: bool) -> Self {
        Self { scale, centre: Some(limit), reversed, neutral: false }
    }

    /// For ratios around a limit.
    pub(crate) fn ratio(values: impl Iterator<Item = f64>, limit: f64, reversed: bool) -> Self {
        let (low, high) = extremes(values.filter(|value| *value > 0.0)).unwrap_or((limit, limit));
        let scale = Scale::log(low.min(limit / 2.0), high.max(limit * 2.0));
        Self::diverging(scale, limit, reversed)
    }

    /// For factors: the scale reaches as far below 1 as above it.
    pub(crate) fn factor(values: impl Iterator<Item = f64>) -> Self {
        let farthest = |so_far: f64, value: f64| so_far.max(value).max(1.0 / value);
        let most = values.filter(|value| *value > 0.0).fold(LEAST_CHANGE, farthest);
        Self { neutral: true, ..Self::diverging(Scale::log(1.0 / most, most), 1.0, false) }
    }

    /// For differences: the scale reaches as far below 0 as above it. `reversed` where less is
    /// worse.
    pub(crate) fn difference(values: impl Iterator<Item = f64>, reversed: bool) -> Self {
        let farthest = |so_far: f64, value: f64| so_far.max(value.abs());
        let most = values.filter(|value| value.is_finite()).fold(0.0, farthest);
        let most = if most > 0.0 { most } else { 1.0 };
        Self { neutral: true, ..Self::diverging(Scale::linear(-most, most), 0.0, reversed) }
    }

    /// For what has a limit, which is the middle. Values that are all on one side of it have all
    /// the colours for themselves. `reversed` where less is worse.
    pub(crate) fn about(values: impl Iterator<Item = f64>, limit: f64, reversed: bool) -> Self {
        match extremes(values) {
            Some((low, high)) if low < limit && high > limit => {
                Self::diverging(Scale::linear(low, high), limit, reversed)
            }
            found => Self::even(found.unwrap_or((0.0, 1.0))),
        }
    }

    /// From the least value to the greatest.
    fn even((low, high): (f64, f64)) -> Self {
        let high = if high > low { high } else { low + (0.1 * low.abs()).max(f64::EPSILON) };
        Self::sequential(Scale::linear(low, high))
    }

    /// For what has no limit: by the logarithm where all is above zero and spans more than a factor
    /// of ten.
    pub(crate) fn amplitude(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = extremes(values).unwrap_or((0.5, 1.0));
        if low <= 0.0 {
            return Self::even((low, high));
        }
        let (low, high) = if high > low { (low, high) } else { (0.9 * low, 1.1 * low) };
        Self::sequential(if high > 10.0 * low {
            Scale::log(low, high)
        } else {
            Scale::linear(low, high)
        })
    }

    /// Place of a value among the colours, 0 to 1; values off the scale take its ends.
    pub(crate) fn position(&self, value: f64) -> f64 {
        let position = match self.centre {
            Some(centre) => {
                let offset = self.scale.even(value) - self.scale.even(centre);
                let [low, centre, high] =
                    [self.scale.from, centre, self.scale.to].map(|value| self.scale.even(value));
                let half = if offset < 0.0 { centre - low } else { high - centre };
                0.5 + 0.5 * offset / half
            }
            None => self.scale.position(value),
        };
        position.clamp(0.0, 1.0)
    }

    /// The step of the scale that holds a value.
    pub(crate) fn level(&self, value: f64) -> usize {
        ((self.position(value) * LEVELS as f64) as usize).min(LEVELS - 1)
    }

    /// Colour of a step of the scale.
    pub(crate) fn colour(&self, level: usize) -> Colour {
        let place = (level as f64 + 0.5) / LEVELS as f64;
        if self.centre.is_none() {
            return blend(&SEQUENTIAL, place);
        }
        let place = if self.reversed { 1.0 - place } else { place };
        let [below, above] = if self.neutral { [&LESS, &MORE] } else { [&BELOW, &ABOVE] };
        if place < 0.5 { blend(below, 2.0 * place) } else { blend(above, 2.0 * place - 1.0) }
    }

    /// Round values to mark on the colour bar.
    pub(crate) fn ticks(&self) -> Vec<Tick> {
        let Some(centre) = self.centre else { return self.scale.ticks(6) };
        let mut ticks = Scale { to: centre, ..self.scale }.ticks(3);
        ticks.extend(Scale { from: centre, ..self.scale }.ticks(4));
        ticks.retain(|tick| (self.position(tick.value) - 0.5).abs() > 0.04);
        ticks.push(Tick { value: centre, label: significant(centre, 3) });
        ticks
    }
}

/// Colour at `place` (0 to 1) of evenly spaced anchors.
fn blend(anchors: &[u32], place: f64) -> Colour {
    let along = place.clamp(0.0, 1.0) * (anchors.len() - 1) as f64;
    let first = (along as usize).min(anchors.len() - 2);
    let part = along - first as f64;
    let (from, to) = (Colour::hex(anchors[first]).rgb, Colour::hex(anchors[first + 1]).rgb);
    let rgb = std::array::from_fn(|k| {
        (f64::from(from[k]) * (1.0 - part) + f64::from(to[k]) * part).round() as u8
    });
    Colour { rgb, alpha: 255 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_the_middle_of_the_scale() {
        let scale = ColourScale::ratio([1.0, 1.3, 50.0].into_iter(), 2.0, false);
        assert_eq!(scale.position(1.0), 0.0);
        assert_eq!(scale.position(2.0), 0.5);
        assert_eq!(scale.position(50.0), 1.0);
        assert!(
            (scale.position(10.0) - 0.75).abs() < 1e-12,
            "halfway between 2 and 50 by the logarithm"
        );
        assert_eq!(scale.level(1e9), LEVELS - 1);
        let [red, _, blue] = scale.colour(LEVELS - 1).rgb;
        assert!(red > blue, "the unreliable side is red");
    }

    #[test]
    fn without_colour_a_scale_is_still_a_scale() {
        let limit = ColourScale::ratio([1.0, 9.0].into_iter(), 2.0, false);
        let light = |level| {
            let [red, green, blue] = limit.colour(level).rgb.map(f64::from);
            0.2126 * red + 0.7152 * green + 0.0722 * blue
        };
        assert!((1..LEVELS).all(|level| light(level) < light(level - 1)));
        assert!(light(LEVELS / 2 - 1) - light(LEVELS / 2) > 8.0, "a step at the limit");
    }

    #[test]
    fn gaps_without_contact_have_all_the_colours() {
        let scale = ColourScale::about([0.004, 0.012].into_iter(), 0.0, true);
        assert_eq!([0.004, 0.012].map(|gap| scale.position(gap)), [0.0, 1.0]);
        let mixed = ColourScale::about([-0.001, 0.012].into_iter(), 0.0, true);
        assert_eq!([-0.001, 0.0, 0.012].map(|gap| mixed.position(gap)), [0.0, 0.5, 1.0]);
        assert!(ColourScale::amplitude([3.0, 3.0].into_iter()).position(3.0).is_finite());
    }

    #[test]
    fn a_change_of_next_to_nothing_has_no_colour() {
        let spread = |scale: &ColourScale, value: f64| {
            let rgb = scale.colour(scale.level(value)).rgb;
            rgb.iter().max().unwrap() - rgb.iter().min().unwrap()
        };
        let factors = ColourScale::factor([0.9995, 1.0005].into_iter());
        assert!([0.9995, 1.0, 1.0005].iter().all(|factor| spread(&factors, *factor) < 24));
        let factors = ColourScale::factor([0.5, 1.1].into_iter());
        assert!(spread(&factors, 1.0) < 24 && spread(&factors, 0.5) > 70);
        assert_eq!(factors.position(2.0), 1.0, "as far above 1 as below it");
        let gaps = ColourScale::difference([-0.001, 0.004].into_iter(), true);
        assert!(spread(&gaps, 0.0) < 24);
        assert_eq!([-0.004, 0.0, 0.004].map(|gap| gaps.position(gap)), [0.0, 0.5, 1.0]);
        let [red, _, blue] = gaps.colour(gaps.level(-0.003)).rgb;
        assert!(red > blue, "a gap that got smaller is worse");
        let same = ColourScale::difference([0.0, 0.0].into_iter(), true);
        assert!(same.position(0.0).is_finite());
    }

    #[test]
    fn contact_is_red() {
        let [red, _, blue] =
            ColourScale::about([-0.004, 0.008].into_iter(), 0.0, true).colour(0).rgb;
        assert!(red > blue);
    }
}
