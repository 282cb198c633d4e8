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
    /// The value if the grid file does not give one.
    pub default: f64,
    /// The description in one line, with the unit.
    pub description: &'static str,
    /// The help in the message about a refused value; empty if there is none.
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

/// The step control of a method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepRule {
    /// Fixed steps of the first setting's length (s), except those that end at an edge of the
    /// window.
    Fixed,
    /// Steps that follow the error estimate.
    ByError,
    /// Fixed steps, refined until two levels agree to a relative accuracy, which is the method's
    /// first setting.
    Checked,
}

/// A method of integration: a row of a model's table, the last row of which is the default.
pub struct IntegrationMethod {
    /// The name in grid files, results and messages.
    pub name: &'static str,
    /// The description in one line.
    pub description: &'static str,
    /// The settings.
    pub settings: &'static [Setting],
    /// The step control.
    pub step_rule: StepRule,
}

/// The classical method with fixed steps. A model may list it under another name.
pub const RK4: IntegrationMethod = IntegrationMethod {
    name: "rk4",
    description: "classical Runge-Kutta of order 4, in fixed steps",
    settings: &[STEP_S],
    step_rule: StepRule::Fixed,
};
/// The adaptive method of Dormand and Prince. A model may list it under another name.
pub const DOPRI5: IntegrationMethod = IntegrationMethod {
    name: "dopri5",
    description: "Dormand-Prince 5(4), adaptive",
    settings: &[RTOL, ATOL],
    step_rule: StepRule::ByError,
};

/// The steps of a method with its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steps {
    /// Fixed steps of this length (s), except those that end at an edge of the window.
    Fixed(f64),
    /// Steps that follow the error estimate.
    ByError,
    /// Fixed steps, refined until two levels agree to this relative accuracy.
    Checked(f64),
}

/// A method of integration with the values of its settings.
#[derive(Clone)]
pub struct Integrator {
    method: &'static IntegrationMethod,
    /// The values, in the order of the method's settings.
    values: Vec<f64>,
}

impl IntegrationMethod {
    /// Returns the method with every setting at its default.
    pub fn with_defaults(&'static self) -> Integrator {
        self.with_settings(|setting| setting.default)
    }

    /// Returns the method with the value that a function gives each setting.
    pub fn with_settings(&'static self, value: impl FnMut(&Setting) -> f64) -> Integrator {
        Integrator { method: self, values: self.settings.iter().map(value).collect() }
    }

    /// Returns whether the method has a setting.
    pub fn has_setting(&self, key: &str) -> bool {
        self.settings.iter().any(|setting| setting.key == key)
    }
}

impl Integrator {
    /// Returns the name in grid files.
    pub const fn name(&self) -> &'static str {
        self.method.name
    }

    /// Returns each setting's key and value, in the order of the table.
    pub fn settings(&self) -> Vec<(&'static str, f64)> {
        let keys = self.method.settings.iter().map(|setting| setting.key);
        keys.zip(self.values.iter().copied()).collect()
    }

    /// Returns the steps of the method, with the length or the accuracy from its settings.
    pub fn steps(&self) -> Steps {
        let first_value = self.values.first().copied().unwrap_or_default();
        match self.method.step_rule {
            StepRule::Fixed => Steps::Fixed(first_value),
            StepRule::ByError => Steps::ByError,
            StepRule::Checked => Steps::Checked(first_value),
        }
    }

    /// Returns the method as plans write it in JSON.
    pub fn to_json(&self) -> Value {
        let mut json = json!({ "method": self.name() });
        for (key, value) in self.settings() {
            json[key] = value.into();
        }
        json
    }
}

impl PartialEq for Integrator {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name() && self.values == other.values
    }
}

impl fmt::Debug for Integrator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Formats name and settings: `dopri5, rtol 1e-6, atol 1e-9`.
impl fmt::Display for Integrator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        let mut settings = self.settings().into_iter();
        settings.try_for_each(|(key, value)| write!(f, ", {key} {value:e}"))
    }
}
