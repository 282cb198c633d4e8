//! The methods of integration that a grid file may write; `washer_model` computes them.

use lane_ode::Tolerance;
pub use sweep_engine::method::Integrator;
use sweep_engine::method::{
    ACCURACY, ATOL, DOPRI5, IntegrationMethod, RK4, RTOL, Setting, StepRule,
};
use sweep_parameter::Range;
use washer_model::{Method, MethodKind};
use washer_row::MAX_ADAPTIVE_STEPS;

/// The share of the longest stable step that plain RK4 uses as the fast method's reference.
pub(crate) const REFERENCE_STEP_RATIO: f64 = 0.75;

/// The accuracy of the fast method. Below 1e-4 its levels agree on ringing that none resolves.
const ACCURACY_OF_LEVELS: Setting = Setting {
    range: Range::Within(1e-4, 1e-2),
    description: "relative error of a row's numbers",
    help: "for less take `method = \"rk4\"` with `step_s = 2e-4`, which leaves some 1e-8",
    ..ACCURACY
};

/// The methods of grid files; the last is the default.
pub(crate) static METHODS: [IntegrationMethod; 4] = [
    RK4,
    DOPRI5,
    IntegrationMethod {
        name: "additive",
        description: "ARK5(4)8L[2]SA, adaptive, the springs of bearings and hinge implicit: for \
                      bearings too stiff for the others",
        settings: &[RTOL, ATOL],
        step_rule: StepRule::ByError,
    },
    IntegrationMethod {
        name: "rk4-mass-scaled",
        description: "the fast method: capped modes of the bearings, at finer and finer levels \
                      until two agree",
        settings: &[ACCURACY_OF_LEVELS],
        step_rule: StepRule::Checked,
    },
];

/// Returns the classical Runge-Kutta method in fixed steps (s).
pub fn rk4(step_s: f64) -> Integrator {
    METHODS[0].with_settings(|_| step_s)
}

/// Returns the fast method with a relative accuracy.
pub fn rk4_mass_scaled(accuracy: f64) -> Integrator {
    METHODS[3].with_settings(|_| accuracy)
}

/// Returns the method by which each trajectory is integrated; `None` for the fast method, which
/// compares levels.
pub(crate) fn direct_method(integrator: &Integrator) -> Option<Method> {
    let mut method = Method::new(MethodKind::named(integrator.name())?);
    match (method.kind.adapts_steps(), &integrator.settings()[..]) {
        (false, &[(_, step_s)]) => method.step_s = step_s,
        (true, &[(_, relative), (_, absolute)]) => {
            method.tolerance = Tolerance {
                relative,
                absolute,
                max_steps: MAX_ADAPTIVE_STEPS,
                longest_step_s: None,
            };
        }
        _ => return None,
    }
    Some(method)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use sweep_engine::Model as _;

    use crate::model::Washer;

    #[test]
    fn a_row_of_the_table_says_what_its_method_does() {
        for table_entry in METHODS.iter() {
            let method = table_entry.with_defaults();
            assert_eq!(method.name(), table_entry.name);
            let keys: Vec<_> = table_entry.settings.iter().map(|setting| setting.key).collect();
            let settings = method.settings();
            assert_eq!(settings.iter().map(|(key, _)| *key).collect::<Vec<_>>(), keys);
            for (setting, (key, value)) in table_entry.settings.iter().zip(settings) {
                assert!(setting.range.contains(value), "{key} = {value}");
                assert_eq!(method.to_json()[key], value);
            }
            if let Some(direct) = direct_method(&method) {
                assert_eq!(direct.kind.name(), table_entry.name, "a row names its method");
            }
        }
    }

    #[test]
    fn a_key_means_the_same_to_every_method() {
        let all_settings = || METHODS.iter().flat_map(|table_row| table_row.settings);
        for (setting_a, other) in
            all_settings().flat_map(|setting_a| all_settings().map(move |other| (setting_a, other)))
        {
            let is_same_setting =
                (setting_a.range, setting_a.default) == (other.range, other.default);
            assert!(setting_a.key != other.key || is_same_setting, "{}", setting_a.key);
        }
    }

    #[test]
    fn the_default_is_the_fast_method() {
        let method = Washer::ABOUT.default_method().with_defaults();
        assert_eq!(method, rk4_mass_scaled(1e-3));
    }

    #[test]
    fn methods_are_shown_and_written_with_their_settings() {
        let method =
            METHODS[1].with_settings(|setting| if setting.key == "rtol" { 1e-5 } else { 1e-8 });
        assert_eq!(method.to_string(), "dopri5, rtol 1e-5, atol 1e-8");
        assert_eq!(method.to_json(), json!({ "method": "dopri5", "rtol": 1e-5, "atol": 1e-8 }));
    }
}
