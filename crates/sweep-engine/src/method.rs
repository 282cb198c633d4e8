//! The table of a model's integration methods, from which the grid file's keys, the schema, the
//! reference page and the plan's JSON are made.

use std::fmt;

use serde_json::{Value, json};
use sweep_parameter::Range;

/// A setting of a method: a number under a key of `[integrator]`.
pub struct Setting {
    /// The key in grid files.
    pub key: &'static str,
    /// The range of accepted values.
    pub range: Range,
    /// The value where the grid file leaves it out.
    pub default: f64,
    /// The description in one line, with the unit.
    pub description: &'static str,
    /// The help beside a value that is refused, or nothing.
    pub help: &'static str,
}

/// The step of methods with fixed steps.
pub const STEP_S: Setting = Setting {
    key: "step_s",
    range: Range::Positive,
    default: 2e-4,
    description: "fixed step, s",
    help: "",
};
/// The relative tolerance of adaptive methods.
pub const RTOL: Setting = Setting {
    key: "rtol",
    range: Range::Within(1e-14, 1e-1),
    default: 1e-6,
    description: "relative tolerance per component",
    help: "",
};
/// The absolute tolerance of adaptive methods.
pub const ATOL: Setting = Setting {
    key: "atol",
    range: Range::Within(1e-18, 1e-1),
    default: 1e-9,
    description: "absolute tolerance per component",
    help: "",
};
/// The accuracy of methods that estimate their error by refinement.
pub const ACCURACY: Setting = Setting {
    key: "accuracy",
    range: Range::Within(1e-9, 1e-1),
    default: 1e-3,
    description: "relative error of the amplitudes",
    help: "",
};

/// A row of the table of methods.
pub struct Entry<I: 'static> {
    /// The name in grid files, results and messages.
    pub name: &'static str,
    /// The description in one line.
    pub description: &'static str,
    /// The settings.
    pub settings: &'static [Setting],
    /// The constructor, which requests the value of each setting once.
    pub with: fn(&mut dyn FnMut(&Setting) -> f64) -> I,
}

/// The step control of a method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steps {
    /// Fixed steps of this length (s), except those that end at an edge of the window.
    Fixed(f64),
    /// Steps that follow the error estimate.
    ByError,
    /// Fixed steps, refined until two levels agree to this relative accuracy.
    Checked(f64),
}

/// An integration method with its settings. [`crate::methods!`] declares a model's methods.
pub trait Integrator: Copy + PartialEq + fmt::Debug + fmt::Display + Send + Sync + 'static {
    /// Returns every method, in the order of messages and pages; the last is the default.
    fn methods() -> &'static [Entry<Self>];

    /// Returns the name in grid files.
    fn name(&self) -> &'static str;

    /// Returns each setting's key and value, in the order of the table.
    fn settings(&self) -> Vec<(&'static str, f64)>;

    /// Returns the step control.
    fn steps(&self) -> Steps;

    /// Returns the method as plans write it in JSON.
    fn to_json(self) -> Value {
        let mut json = json!({ "method": self.name() });
        for (key, value) in self.settings() {
            json[key] = value.into();
        }
        json
    }
}

/// Declares the methods of a model: an enum with a variant for each method, and a table with names,
/// descriptions and settings. A row ends with the method's [`Steps`].
#[macro_export]
macro_rules! methods {
    ($($method:ident = $name:literal, $description:literal {
        $($key:ident: $setting:expr),+
    } $steps:expr;)+) => {
        /// An integration method with its settings.
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

        /// Formats name and settings: `dopri5, rtol 1e-6, atol 1e-9`.
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

/// Returns the method of grid files that name none.
pub fn default_method<I: Integrator>() -> &'static Entry<I> {
    &I::methods()[I::methods().len() - 1]
}

impl<I> Entry<I> {
    /// Returns whether the method has a setting.
    pub fn has(&self, key: &str) -> bool {
        self.settings.iter().any(|setting| setting.key == key)
    }

    /// Returns the method with every setting at its default.
    pub fn with_defaults(&self) -> I {
        (self.with)(&mut |setting| setting.default)
    }
}
