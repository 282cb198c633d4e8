//! The methods of integration, in one table: what a grid file may write, what the schema and the
//! reference page say, what a plan's JSON carries. Beneath the table is what each method does. The
//! compiler asks for every method there, so that none can be forgotten.

use std::fmt;

use lane_ode::Tolerance;
use serde_json::{Value, json};
use washer_model::{Method, Range};
use washer_row::Level;

/// Steps that one leg of an adaptive trajectory may take.
const MAX_ADAPTIVE_STEPS: u64 = 100_000_000;

/// Share of the longest stable step that plain RK4 uses as the fast method's reference.
pub(crate) const REFERENCE_SHARE: f64 = 0.75;

/// The shortest step of RK4 where forces have corners, as a share of the reference's.
pub(crate) const SHORTEST_AT_CORNERS: f64 = 0.25;

/// A number that a method takes, under a key of `[integrator]`.
pub(crate) struct Setting {
    /// As in grid files.
    pub(crate) key: &'static str,
    /// Values that are accepted.
    pub(crate) range: Range,
    /// Where the grid file leaves it out.
    pub(crate) default: f64,
    /// One line, with the unit.
    pub(crate) description: &'static str,
}

const STEP_S: Setting =
    Setting { key: "step_s", range: Range::Positive, default: 2e-4, description: "fixed step, s" };
const RTOL: Setting = Setting {
    key: "rtol",
    range: Range::Within(1e-14, 1e-1),
    default: 1e-6,
    description: "relative tolerance per component",
};
const ATOL: Setting = Setting {
    key: "atol",
    range: Range::Within(1e-18, 1e-1),
    default: 1e-9,
    description: "absolute tolerance per component",
};
/// Of the fast method.
pub(crate) const ACCURACY: Setting = Setting {
    key: "accuracy",
    range: Range::Within(1e-9, 1e-1),
    default: 1e-3,
    description: "relative error of the amplitudes",
};

/// A row of the table.
pub(crate) struct Entry {
    /// As in grid files, in results and in messages.
    pub(crate) name: &'static str,
    /// One line.
    pub(crate) description: &'static str,
    /// What it takes.
    pub(crate) settings: &'static [Setting],
    /// The method with its settings' values, each asked for once.
    pub(crate) with: fn(&mut dyn FnMut(&Setting) -> f64) -> Integrator,
}

macro_rules! methods {
    ($($method:ident = $name:literal, $description:literal {
        $($key:ident: $setting:ident),+
    })+) => {
        /// How a trajectory is integrated.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Integrator {
            $(
                #[doc = concat!("`", $name, "`: ", $description, ".")]
                $method {
                    $(
                        #[doc = concat!("The setting `", stringify!($key), "` of grid files.")]
                        $key: f64
                    ),+
                }
            ),+
        }

        /// Every method, in the order of messages and pages; the last is the default.
        pub(crate) static METHODS: [Entry; [$($name),+].len()] = [$(
            Entry {
                name: $name,
                description: $description,
                settings: &[$($setting),+],
                with: |number| Integrator::$method { $($key: number(&$setting)),+ },
            }
        ),+];

        impl Integrator {
            /// Name in grid files.
            #[must_use]
            pub const fn name(&self) -> &'static str {
                match self { $(Self::$method { .. } => $name),+ }
            }

            /// Each setting's key and value, in the order of the table.
            fn settings(&self) -> Vec<(&'static str, f64)> {
                match *self {
                    $(Self::$method { $($key),+ } => vec![$((stringify!($key), $key)),+]),+
                }
            }
        }
    };
}

methods! {
    Rk4 = "rk4", "classical Runge-Kutta of order 4, in fixed steps" { step_s: STEP_S }
    Dopri5 = "dopri5", "Dormand-Prince 5(4), adaptive" { rtol: RTOL, atol: ATOL }
    Rodas5p = "rodas5p", "Rodas5P, adaptive and linearly implicit: for machines too stiff for the \
                          others" { rtol: RTOL, atol: ATOL }
    Rk4MassScaled = "rk4-mass-scaled", "the fast method: capped modes of bearings and hinge, in \
                                        finer and finer runs until two agree" { accuracy: ACCURACY }
}

impl Entry {
    /// The method that is taken where a grid file names none.
    pub(crate) fn default_method() -> &'static Self {
        &METHODS[METHODS.len() - 1]
    }

    /// The method with every setting at its default.
    pub(crate) fn with_defaults(&self) -> Integrator {
        (self.with)(&mut |setting| setting.default)
    }
}

/// Every setting once, each with the names of the methods that take it.
pub(crate) fn settings() -> Vec<(&'static Setting, Vec<&'static str>)> {
    let mut settings: Vec<(&Setting, Vec<&str>)> = Vec::new();
    for entry in &METHODS {
        for setting in entry.settings {
            match settings.iter_mut().find(|(known, _)| known.key == setting.key) {
                Some((_, methods)) => methods.push(entry.name),
                None => settings.push((setting, vec![entry.name])),
            }
        }
    }
    settings
}

/// How a method chooses its steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Steps {
    /// All of this length, but for those that end at an edge of the window (s).
    Fixed(f64),
    /// By the error; stability bounds them.
    Explicit,
    /// By the error alone; one trajectory at a time, not in lanes.
    Implicit,
    /// By rungs that check one another, until two agree to this relative accuracy.
    Checked(f64),
}

impl Integrator {
    /// How it chooses its steps.
    pub(crate) const fn steps(&self) -> Steps {
        match *self {
            Self::Rk4 { step_s } => Steps::Fixed(step_s),
            Self::Dopri5 { .. } => Steps::Explicit,
            Self::Rodas5p { .. } => Steps::Implicit,
            Self::Rk4MassScaled { accuracy } => Steps::Checked(accuracy),
        }
    }

    /// What integrates a trajectory, and what a row says of it; `None` where rungs of other methods
    /// check one another. Of those a trace takes the reference, `rk4`.
    pub(crate) fn direct(&self) -> Option<(Level, Method)> {
        let tolerance =
            |relative, absolute| Tolerance { relative, absolute, max_steps: MAX_ADAPTIVE_STEPS };
        match *self {
            Self::Rk4 { step_s } => Some((Level::Rk4, Method::Rk4 { step_s })),
            Self::Dopri5 { rtol, atol } => {
                Some((Level::Dopri5, Method::Dopri5(tolerance(rtol, atol))))
            }
            Self::Rodas5p { rtol, atol } => {
                Some((Level::Rodas5p, Method::Rodas5p(tolerance(rtol, atol))))
            }
            Self::Rk4MassScaled { .. } => None,
        }
    }

    /// As grid files and plans write it.
    pub(crate) fn to_json(self) -> Value {
        let mut json = json!({ "method": self.name() });
        for (key, value) in self.settings() {
            json[key] = value.into();
        }
        json
    }
}

/// Name and settings: `dopri5, rtol 1e-6, atol 1e-9`.
impl fmt::Display for Integrator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        self.settings().iter().try_for_each(|(key, value)| write!(f, ", {key} {value:e}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_the_table_says_what_its_method_does() {
        for entry in &METHODS {
            let method = entry.with_defaults();
            assert_eq!(method.name(), entry.name);
            let keys: Vec<_> = entry.settings.iter().map(|setting| setting.key).collect();
            let written = method.settings();
            assert_eq!(written.iter().map(|(key, _)| *key).collect::<Vec<_>>(), keys);
            for (setting, (key, value)) in entry.settings.iter().zip(written) {
                assert!(setting.range.contains(value), "{key} = {value}");
                assert_eq!(method.to_json()[key], value);
            }
            if let Some((level, _)) = method.direct() {
                assert_eq!(level.name(), entry.name, "a row names its method");
            }
        }
    }

    #[test]
    fn a_key_means_the_same_to_every_method() {
        let all = || METHODS.iter().flat_map(|entry| entry.settings);
        for (one, other) in all().flat_map(|one| all().map(move |other| (one, other))) {
            let same = (one.range, one.default) == (other.range, other.default);
            assert!(one.key != other.key || same, "{}", one.key);
        }
    }

    #[test]
    fn the_default_is_the_fast_method() {
        let method = Entry::default_method().with_defaults();
        assert_eq!(method, Integrator::Rk4MassScaled { accuracy: 1e-3 });
    }

    #[test]
    fn methods_are_shown_and_written_as_ever() {
        let method = Integrator::Dopri5 { rtol: 1e-5, atol: 1e-8 };
        assert_eq!(method.to_string(), "dopri5, rtol 1e-5, atol 1e-8");
        assert_eq!(method.to_json(), json!({ "method": "dopri5", "rtol": 1e-5, "atol": 1e-8 }));
    }
}
