//! The parameters of models: numbers that can be set and swept, with their ranges, their form in
//! messages, and the unit at the end of their names; also the direction in which a column of a
//! result is bad. Models, the engine and the readers of results use them.

mod named;

use std::borrow::Cow;
use std::fmt;

/// A number that can be set and swept. `H` is the model's handle of it. Parameters of one name are
/// equal.
#[derive(Clone, Debug)]
pub struct Parameter<H> {
    /// The name in grid files, on the command line and of the result's column.
    pub name: Cow<'static, str>,
    /// The unit, as in the name's suffix but readable.
    pub unit: &'static str,
    /// The meaning, in a phrase.
    pub description: &'static str,
    /// The values that the parameter may take.
    pub range: Range,
    /// The source of the model's own value, in words.
    pub source: &'static str,
    /// The model's own value, if it has one number for the parameter.
    pub value: Option<f64>,
    /// The names of the single numbers that the parameter writes; usually its own name alone.
    pub number_names: Vec<Cow<'static, str>>,
    /// The edge of the window that this parameter sets (0: the beginning, 1: the end), if it sets
    /// one. The window is part of the plan, not of the model.
    pub window_edge: Option<usize>,
    /// Whether a section of the grid file gives the value, so that there is none without a file.
    pub is_from_grid_file: bool,
    /// The model's handle, by which it writes a value.
    pub handle: H,
}

impl<H> PartialEq for Parameter<H> {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

/// A motion that is compared between two models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// The name in grid files and column names.
    pub name: &'static str,
    /// The unit.
    pub unit: &'static str,
    /// The description in a line, for column dictionaries and pages.
    pub description: &'static str,
}

/// The reason why a name is not that of a parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownParameter {
    /// The reason, in words.
    pub reason: String,
    /// Whether no model has a parameter of this name, so that it may be a typing error.
    pub is_in_no_model: bool,
}

impl UnknownParameter {
    /// Returns the reason for a name that no model has.
    pub fn in_no_model() -> Self {
        Self { reason: "no parameter has this name".to_owned(), is_in_no_model: true }
    }

    /// Returns the reason for a name that other models have, but not this one.
    pub fn in_other_models(reason: impl Into<String>) -> Self {
        Self { reason: reason.into(), is_in_no_model: false }
    }
}

impl fmt::Display for UnknownParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.reason)
    }
}

/// Values that a parameter may take. No number above [`Range::MAX_MAGNITUDE`] in magnitude is
/// accepted, so that products of a few parameters stay finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Any finite number.
    Any,
    /// Greater than 0.
    Positive,
    /// 0 or greater.
    NonNegative,
    /// Less than 0.
    Negative,
    /// Within these bounds, both included.
    Within(f64, f64),
}

impl Range {
    /// Greatest magnitude of any parameter, in its own unit. Basis: products of a few of them, and
    /// the squares of such products, stay finite. Doubling it makes no difference.
    pub const MAX_MAGNITUDE: f64 = 1e12;

    /// Returns whether `value` is allowed; NaN and infinity never are.
    pub fn contains(self, value: f64) -> bool {
        let [least, greatest] = self.bounds();
        value.abs() <= Self::MAX_MAGNITUDE
            && (least..=greatest).contains(&value)
            && !(value == 0.0 && self.excludes_zero())
    }

    /// Returns the least and the greatest value. They are infinite where only
    /// [`Self::MAX_MAGNITUDE`] limits them.
    pub const fn bounds(self) -> [f64; 2] {
        match self {
            Self::Any => [f64::NEG_INFINITY, f64::INFINITY],
            Self::Positive | Self::NonNegative => [0.0, f64::INFINITY],
            Self::Negative => [f64::NEG_INFINITY, 0.0],
            Self::Within(least, greatest) => [least, greatest],
        }
    }

    /// Returns whether 0 is a bound that is itself not allowed.
    pub const fn excludes_zero(self) -> bool {
        matches!(self, Self::Positive | Self::Negative)
    }

    /// Describes the allowed values, for the message about a refused `value`.
    pub fn describe_for(self, value: f64) -> String {
        if value.is_finite()
            && value.abs() > Self::MAX_MAGNITUDE
            && !matches!(self, Self::Within(..))
        {
            format!("{self}, at most {:e} in magnitude", Self::MAX_MAGNITUDE)
        } else {
            self.to_string()
        }
    }
}

named! {
    /// The direction in which a number gets worse, with its name in column dictionaries.
    pub enum Worse {
        /// A greater number is worse.
        Greater = "greater",
        /// A smaller number is worse.
        Less = "less",
    }
}

impl Worse {
    /// Returns the word for the worst value: greatest or least.
    pub const fn worst_value_word(self) -> &'static str {
        match self {
            Self::Greater => "greatest",
            Self::Less => "least",
        }
    }

    /// Returns the word for the bad side of a limit: above or below.
    pub const fn bad_side_word(self) -> &'static str {
        match self {
            Self::Greater => "above",
            Self::Less => "below",
        }
    }

    /// Returns by how much `a` is worse than `b`; negative if `a` is better.
    pub fn excess(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Greater => a - b,
            Self::Less => b - a,
        }
    }
}

/// The limit between the good and the bad values of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// The limit, in the number's unit.
    pub value: f64,
    /// The difference from the limit that is as important as a factor of e is for a ratio, in the
    /// number's unit.
    pub scale: f64,
}

/// The limits of the ratios, nonlinear over linear amplitude, between which the linear model is
/// trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RatioLimits {
    /// The greatest ratio must be below this.
    pub upper: f64,
    /// The least ratio must be above this, if there is a lower limit.
    pub lower: Option<f64>,
}

impl From<f64> for RatioLimits {
    /// Returns limits without a lower one.
    fn from(upper: f64) -> Self {
        Self { upper, lower: None }
    }
}

impl RatioLimits {
    /// Returns whether these least and greatest ratios of a point are within the limits.
    pub fn contain_ratios(self, least: f64, greatest: f64) -> bool {
        greatest < self.upper && self.lower.is_none_or(|limit| least > limit)
    }

    /// Returns how far a point with these least and greatest ratios is from the other verdict,
    /// relative to the limit.
    fn margin(self, least: f64, greatest: f64) -> f64 {
        let distance = |ratio: f64, limit: f64| (ratio / limit - 1.0).abs();
        let lower_margin = self.lower.map_or(f64::INFINITY, |limit| distance(least, limit));
        distance(greatest, self.upper).min(lower_margin)
    }

    /// Returns the ratio below which the linear model over-estimates too much: the lower limit, or
    /// without one the reciprocal of the upper limit.
    pub fn over_estimate_limit(self) -> f64 {
        self.lower.unwrap_or(1.0 / self.upper)
    }
}

/// The comparison of the two models at one point by their ratios, nonlinear over linear amplitude.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// The ratio of each channel of the plan; `None` where it is not defined.
    pub ratios: Vec<Option<f64>>,
    /// The channel's position and the value of the greatest defined ratio; of equal ones, the first
    /// channel's.
    pub greatest: Option<(usize, f64)>,
    /// The channel's position and the value of the least defined ratio; of equal ones, the first
    /// channel's.
    pub least: Option<(usize, f64)>,
    /// Whether the ratios are between the limits; `None` where no ratio is defined.
    pub reliable: Option<bool>,
    /// The distance from the other verdict, relative to the limit; `None` where no ratio is
    /// defined.
    pub margin: Option<f64>,
}

impl Verdict {
    /// Compares ratios with their limits.
    pub fn new(ratios: Vec<Option<f64>>, limits: RatioLimits) -> Self {
        let extreme = |is_further: fn(f64, f64) -> bool| {
            let defined = ratios.iter().enumerate().filter_map(|(i, ratio)| Some((i, (*ratio)?)));
            defined.reduce(|so_far, next| if is_further(next.1, so_far.1) { next } else { so_far })
        };
        let greatest = extreme(|a, b| a > b);
        let least = extreme(|a, b| a < b);
        let extremes = least.zip(greatest).map(|((_, least), (_, greatest))| (least, greatest));
        let reliable = extremes.map(|(least, greatest)| limits.contain_ratios(least, greatest));
        let margin = extremes.map(|(least, greatest)| limits.margin(least, greatest));
        Self { ratios, greatest, least, reliable, margin }
    }
}

/// Returns a number as text for a message: the shortest decimal that parses to the same number,
/// with an exponent if it would be long.
pub fn decimal(value: f64) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Any => f.write_str("a finite number"),
            Self::Positive => f.write_str("a number greater than 0"),
            Self::NonNegative => f.write_str("a number, 0 or greater"),
            Self::Negative => f.write_str("a number less than 0"),
            Self::Within(least, greatest) => {
                write!(f, "a number from {} to {}", decimal(*least), decimal(*greatest))
            }
        }
    }
}

/// Returns the suffix of parameters' names for this unit; `None` if names do not show the unit.
pub fn unit_suffix(unit: &str) -> Option<&'static str> {
    Some(match unit {
        "m" => "_m",
        "kg" => "_kg",
        "s" => "_s",
        "rpm" => "_rpm",
        "deg" => "_deg",
        "" | "1" => "",
        "rad/s" => "_rad_per_s",
        "N" => "_n",
        "N/m" => "_n_per_m",
        "N/m^3" => "_n_per_m3",
        "N s/m" => "_n_s_per_m",
        "N m/rad" => "_n_m_per_rad",
        "kg m^2" => "_kg_m2",
        "m/s" => "_m_per_s",
        "m/s^2" => "_m_per_s2",
        _ => return None,
    })
}
