//! Numbers that can be set and swept: their ranges, their form in messages, the unit at the end of
//! their names; and which way a number of a result is bad. Models, the engine and whoever reads
//! results share them.

mod named;

use std::fmt;

/// A number that can be set and swept.
pub trait Parameter: Clone + PartialEq + fmt::Debug + Send + Sync {
    /// Name in grid files, on the command line and of the result's column.
    fn name(&self) -> &str;
    /// Unit, as in the name's suffix but readable.
    fn unit(&self) -> &'static str;
    /// What it is, in a phrase.
    fn description(&self) -> &'static str;
    /// Values it may take.
    fn range(&self) -> Range;
    /// The edge of the window that it is (0: the beginning, 1: the end), if any. The window belongs
    /// to no model.
    fn window_edge(&self) -> Option<usize>;
}

/// A motion that is compared between two models.
pub trait Channel: Copy + PartialEq + fmt::Debug + Send + Sync + 'static {
    /// Name in grid files and column names.
    fn name(self) -> &'static str;
    /// Unit.
    fn unit(self) -> &'static str;
    /// One line for column dictionaries and pages.
    fn description(self) -> &'static str;
}

/// Why a name is no parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownParameter {
    /// In words.
    pub reason: String,
    /// No model has a parameter of this name: there may be one of a name near to it.
    pub is_strange: bool,
}

impl UnknownParameter {
    /// Of a name that no model has.
    pub fn strange() -> Self {
        Self { reason: "no parameter has this name".to_owned(), is_strange: true }
    }

    /// Of a name that this very model lacks.
    pub fn not_here(reason: impl Into<String>) -> Self {
        Self { reason: reason.into(), is_strange: false }
    }
}

impl fmt::Display for UnknownParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.reason)
    }
}

/// Values that a parameter may take. No number above [`Range::LARGEST`] in magnitude is accepted,
/// so that products of a few parameters stay finite.
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
    /// Greatest magnitude accepted of any number.
    pub const LARGEST: f64 = 1e12;

    /// Whether `value` is allowed; never for NaN or infinity.
    pub fn contains(self, value: f64) -> bool {
        let [least, greatest] = self.bounds();
        value.abs() <= Self::LARGEST
            && (least..=greatest).contains(&value)
            && !(value == 0.0 && self.excludes_zero())
    }

    /// The least and the greatest value; infinite where there is no bound but [`Self::LARGEST`].
    pub const fn bounds(self) -> [f64; 2] {
        match self {
            Self::Any => [f64::NEG_INFINITY, f64::INFINITY],
            Self::Positive | Self::NonNegative => [0.0, f64::INFINITY],
            Self::Negative => [f64::NEG_INFINITY, 0.0],
            Self::Within(least, greatest) => [least, greatest],
        }
    }

    /// Whether 0 bounds it and is not allowed.
    pub const fn excludes_zero(self) -> bool {
        matches!(self, Self::Positive | Self::Negative)
    }

    /// The accepted values, for the message about a refused one.
    pub fn instead_of(self, value: f64) -> String {
        if value.is_finite() && value.abs() > Self::LARGEST && !matches!(self, Self::Within(..)) {
            format!("{self}, at most {:e} in magnitude", Self::LARGEST)
        } else {
            self.to_string()
        }
    }
}

named! {
    /// Which way a number is bad; named as column dictionaries say it.
    pub enum Worse {
        /// The greater it is.
        Greater = "greater",
        /// The less it is.
        Less = "less",
    }
}

impl Worse {
    /// The worst value: the greatest or the least.
    pub const fn extreme(self) -> &'static str {
        match self {
            Self::Greater => "greatest",
            Self::Less => "least",
        }
    }

    /// How much worse `a` is than `b`; at most 0 where it is not.
    pub fn by(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Greater => a - b,
            Self::Less => b - a,
        }
    }
}

/// The value up to which a number is good, which has a meaning of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// In the number's unit.
    pub value: f64,
    /// A difference from the limit that counts as much as a factor of e counts of a ratio, in the
    /// number's unit.
    pub scale: f64,
}

/// The ratios, nonlinear over linear, between which a linear model is trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RatioLimits {
    /// The greatest ratio must be below this.
    pub most: f64,
    /// The least ratio must be above this, if it is asked for.
    pub least: Option<f64>,
}

impl From<f64> for RatioLimits {
    /// No lower limit.
    fn from(most: f64) -> Self {
        Self { most, least: None }
    }
}

impl RatioLimits {
    /// Whether a point with these least and greatest ratios is trusted.
    pub fn trust(self, least: f64, greatest: f64) -> bool {
        greatest < self.most && self.least.is_none_or(|limit| least > limit)
    }

    /// How far such a point is from turning its verdict, as a share of the limit.
    pub fn margin(self, least: f64, greatest: f64) -> f64 {
        let from = |ratio: f64, limit: f64| (ratio / limit - 1.0).abs();
        let of_least = self.least.map_or(f64::INFINITY, |limit| from(least, limit));
        from(greatest, self.most).min(of_least)
    }

    /// Below this ratio the linear model over-estimates as much as it may under-estimate.
    pub fn over_estimate(self) -> f64 {
        self.least.unwrap_or(1.0 / self.most)
    }
}

/// A number as a message shows it: the shortest decimal that reads back the same, in powers of ten
/// where it would be long.
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

/// The ending of names of numbers in this unit; `None` where names do not show it.
pub fn unit_suffix(unit: &str) -> Option<&'static str> {
    Some(match unit {
        "m" => "_m",
        "kg" => "_kg",
        "s" => "_s",
        "rpm" => "_rpm",
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
