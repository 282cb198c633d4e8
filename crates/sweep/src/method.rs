//! The methods of integration that a grid file may write; what each does is
//! `washer_model`'s.

use lane_ode::Tolerance;
use sweep_engine::method::{ACCURACY, ATOL, Integrator as _, RTOL, STEP_S, Setting, Steps};
use sweep_engine::methods;
use sweep_parameter::Range;
use washer_model::{Method, MethodNumbers};
use washer_row::{Level, MAX_ADAPTIVE_STEPS};

/// Share of the longest stable step that plain RK4 uses as the fast method's reference.
pub(crate) const REFERENCE_SHARE: f64 = 0.75;

/// The accuracy of the fast method. Below 1e-4 its levels agree on ringing that none resolves.
const LEVELS_ACCURACY: Setting = Setting {
    range: Range::Within(1e-4, 1e-2),
    description: "relative error of a row's numbers",
    help: "for less take `method = \"rk4\"` with `step_s = 2e-4`, which leaves some 1e-8",
    ..ACCURACY
};

methods! {
    Rk4 = "rk4", "classical Runge-Kutta of order 4, in fixed steps" { step_s: STEP_S }
        Steps::Fixed(step_s);
    Dopri5 = "dopri5", "Dormand-Prince 5(4), adaptive" { rtol: RTOL, atol: ATOL } Steps::ByError;
    Additive = "additive", "ARK5(4)8L[2]SA, adaptive, the springs of bearings and hinge implicit: \
                            for bearings too stiff for the others" { rtol: RTOL, atol: ATOL }
        Steps::ByError;
    Rk4MassScaled = "rk4-mass-scaled", "the fast method: capped modes of the bearings, at finer \
                                        and finer levels until two agree" {
        accuracy: LEVELS_ACCURACY
    } Steps::Checked(accuracy);
}

impl Integrator {
    /// Returns the level and the method by which each trajectory is integrated; `None` for the fast
    /// method, which compares levels.
    pub fn direct(&self) -> Option<(Level, Method)> {
        let level = Level::named(self.name())?;
        let mut method = Method::without_numbers(level);
        match (method.numbers(), &self.settings()[..]) {
            (MethodNumbers::Step(step_s), [(_, value)]) => *step_s = *value,
            (MethodNumbers::Tolerance(tolerance), &[(_, relative), (_, absolute)]) => {
                *tolerance = Tolerance { relative, absolute, max_steps: MAX_ADAPTIVE_STEPS };
            }
            _ => return None,
        }
        Some((level, method))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use sweep_engine::method::default_method;

    #[test]
    fn a_row_of_the_table_says_what_its_method_does() {
        for entry in Integrator::methods() {
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
        let all = || Integrator::methods().iter().flat_map(|entry| entry.settings);
        for (one, other) in all().flat_map(|one| all().map(move |other| (one, other))) {
            let same = (one.range, one.default) == (other.range, other.default);
            assert!(one.key != other.key || same, "{}", one.key);
        }
    }

    #[test]
    fn the_default_is_the_fast_method() {
        let method = default_method::<Integrator>().with_defaults();
        assert_eq!(method, Integrator::Rk4MassScaled { accuracy: 1e-3 });
    }

    #[test]
    fn methods_are_shown_and_written_as_ever() {
        let method = Integrator::Dopri5 { rtol: 1e-5, atol: 1e-8 };
        assert_eq!(method.to_string(), "dopri5, rtol 1e-5, atol 1e-8");
        assert_eq!(method.to_json(), json!({ "method": "dopri5", "rtol": 1e-5, "atol": 1e-8 }));
    }
}
