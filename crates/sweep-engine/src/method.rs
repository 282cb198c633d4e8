//! The methods of integration of a model, in one table: what a grid file may write, what the schema
//! and the reference page say, what a plan's JSON carries.

use std::fmt;

use serde_json::{Value, json};
use sweep_parameter::Range;

/// A number that a method takes, under a key of `[integrator]`.
pub struct Setting {
    /// As in grid files.
    pub key: &'static str,
    /// Values that are accepted.
    pub range: Range,
    /// Where the grid file leaves it out.
    pub default: f64,
    /// One line, with the unit.
    pub description: &'static str,
}

/// Fixed steps (s).
pub const STEP_S: Setting =
    Setting { key: "step_s", range: Range::Positive, default: 2e-4, description: "fixed step, s" };
/// The relative tolerance of adaptive methods.
pub const RTOL: Setting = Setting {
    key: "rtol",
    range: Range::Within(1e-14, 1e-1),
    default: 1e-6,
    description: "relative tolerance per component",
};
/// The absolute tolerance of adaptive methods.
pub const ATOL: Setting = Setting {
    key: "atol",
    range: Range::Within(1e-18, 1e-1),
    default: 1e-9,
    description: "absolute tolerance per component",
};
/// The accuracy of methods whose rungs check one another.
pub const ACCURACY: Setting = Setting {
    key: "accuracy",
    range: Range::Within(1e-9, 1e-1),
    default: 1e-3,
    description: "relative error of the amplitudes",
};

/// A row of the table.
pub struct Entry<I: 'static> {
    /// As in grid files, in results and in messages.
    pub name: &'static str,
    /// One line.
    pub description: &'static str,
    /// What it takes.
    pub settings: &'static [Setting],
    /// The method with its settings' values, each asked for once.
    pub with: fn(&mut dyn FnMut(&Setting) -> f64) -> I,
}

/// How a method chooses its steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steps {
    /// All of this length, but for those that end at an edge of the window (s).
    Fixed(f64),
    /// Chosen by the error; stability bounds them.
    Explicit,
    /// Chosen by the error alone; one trajectory at a time, not in lanes.
    Implicit,
    /// Taken by rungs that check one another, until two agree to this relative accuracy.
    Checked(f64),
}

/// How a trajectory is integrated: one of a model's methods with its settings. [`crate::methods!`]
/// declares them.
pub trait Integrator: Copy + PartialEq + fmt::Debug + fmt::Display + Send + Sync + 'static {
    /// Every method, in the order of messages and pages; the last is the default.
    fn methods() -> &'static [Entry<Self>];

    /// Name in grid files.
    fn name(&self) -> &'static str;

    /// Each setting's key and value, in the order of the table.
    fn settings(&self) -> Vec<(&'static str, f64)>;

    /// How it chooses its steps.
    fn steps(&self) -> Steps;

    /// As grid files and plans write it.
    fn to_json(self) -> Value {
        let mut json = json!({ "method": self.name() });
        for (key, value) in self.settings() {
            json[key] = value.into();
        }
        json
    }
}

/// Declares the methods of a model: an enum with a variant a method, and a table with their names,
/// descriptions and settings. A row ends with the method's [`Steps`].
#[macro_export]
macro_rules! methods {
    ($($method:ident = $name:literal, $description:literal {
        $($key:ident: $setting:expr),+
    } $steps:expr;)+) => {
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

        impl $crate::method::Integrator for Integrator {
            fn methods() -> &'static [$crate::method::Entry<Self>] {
                static METHODS: &[$crate::method::Entry<Integrator>] = &[$(
                    $crate::method::Entry {
                        name: $name,
                        description: $description,
                        settings: &[$($setting),+],
                        with: |number| Integrator::$method { $($key: number(&$setting)),+ },
                    }
                ),+];
                METHODS
            }

            fn name(&self) -> &'static str {
                match self { $(Self::$method { .. } => $name),+ }
            }

            fn settings(&self) -> Vec<(&'static str, f64)> {
                match *self {
                    $(Self::$method { $($key),+ } => vec![$((stringify!($key), $key)),+]),+
                }
            }

            #[allow(unused_variables, reason = "few methods' steps are by all of their settings")]
            fn steps(&self) -> $crate::method::Steps {
                match *self {
                    $(Self::$method { $($key),+ } => $steps),+
                }
            }
        }

        /// Name and settings: `dopri5, rtol 1e-6, atol 1e-9`.
        impl std::fmt::Display for Integrator {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                use $crate::method::Integrator as _;
                f.write_str(self.name())?;
                let mut settings = self.settings().into_iter();
                settings.try_for_each(|(key, value)| write!(f, ", {key} {value:e}"))
            }
        }
    };
}

/// The method that is taken where a grid file names none.
pub fn default_method<I: Integrator>() -> &'static Entry<I> {
    &I::methods()[I::methods().len() - 1]
}

impl<I> Entry<I> {
    /// Whether it takes a setting.
    pub fn has(&self, key: &str) -> bool {
        self.settings.iter().any(|setting| setting.key == key)
    }

    /// The method with every setting at its default.
    pub fn with_defaults(&self) -> I {
        (self.with)(&mut |setting| setting.default)
    }
}
