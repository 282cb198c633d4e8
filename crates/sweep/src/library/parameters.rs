//! The parameter table with values, for reading or for programs.

use serde_json::{Value, json};
use washer_model::{Machine, Parameter, Range, Spin, Target};

use crate::plan::Plan;

/// A line of the listing.
pub(crate) struct Listed {
    pub(crate) parameter: Parameter,
    /// `None` without a grid for numbers only a grid gives, and where several numbers differ.
    pub(crate) value: Option<f64>,
    pub(crate) source: String,
}

/// Every number that can be set or swept as a JSON array of objects: `name`, `value`, `unit`,
/// `description`, `range` and `source`. The values are the plan's, before its axes; without a plan
/// those of the built-in machine.
#[must_use]
pub fn list_parameters(plan: Option<&Plan>) -> String {
    as_json(&listed(plan))
}

/// The listing of [`list_parameters`].
pub(crate) fn listed(plan: Option<&Plan>) -> Vec<Listed> {
    match plan {
        Some(plan) => rows(&plan.machine, &plan.spin, Some(plan.window_s)),
        // The spin's parameters exist without a grid, but have no value.
        None => rows(&Machine::paper(), &Spin::Triangular { peak_rpm: 0.0, ramp_s: 0.0 }, None),
    }
}

/// Every parameter with its value; those of spin and window have one only if a grid gives its
/// window.
fn rows(machine: &Machine, spin: &Spin, window_s: Option<[f64; 2]>) -> Vec<Listed> {
    let built_in = Machine::paper();
    let row = |parameter: Parameter| {
        let of_grid = matches!(parameter.target(), Target::Spin | Target::Window(_));
        let value = match parameter.target() {
            Target::Window(edge) => window_s.map(|window_s| window_s[edge]),
            _ => parameter.get(machine, spin).filter(|_| window_s.is_some() || !of_grid),
        };
        let as_built_in = parameter.get(&built_in, spin) == value;
        let source = if of_grid || as_built_in {
            parameter.source().to_string()
        } else {
            "given".to_owned()
        };
        Listed { parameter, value, source }
    };
    Parameter::all(machine, spin).into_iter().map(row).collect()
}

/// The listing as JSON.
pub(crate) fn as_json(rows: &[Listed]) -> String {
    let row = |row: &Listed| {
        json!({
            "name": row.parameter.name(),
            "value": row.value,
            "unit": row.parameter.unit(),
            "description": row.parameter.description(),
            "range": range(row.parameter.range()),
            "source": row.source,
        })
    };
    format!("{:#}\n", rows.iter().map(row).collect::<Value>())
}

/// Bounds of a range, `null` where there is none but the common greatest magnitude.
fn range(range: Range) -> Value {
    let (least, greatest) = match range {
        Range::Any => (None, None),
        Range::Positive | Range::NonNegative => (Some(0.0), None),
        Range::Negative => (None, Some(0.0)),
        Range::Within(least, greatest) => (Some(least), Some(greatest)),
    };
    let excluded = matches!(range, Range::Positive | Range::Negative);
    json!({ "least": least, "greatest": greatest, "zero_excluded": excluded })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_holds_every_parameter() {
        let spin = Spin::Ramp { peak_rpm: 120.0, ramp_s: 2.0 };
        let rows = rows(&Machine::paper(), &spin, Some([0.0, 1.0]));
        let json: Value = serde_json::from_str(&as_json(&rows)).unwrap();
        assert_eq!(
            json.as_array().map(Vec::len),
            Some(Parameter::all(&Machine::paper(), &spin).len())
        );
        assert_eq!(json[0]["name"], "gravity_m_per_s2");
    }

    #[test]
    fn a_value_of_the_users_own_is_not_ascribed_to_the_paper() {
        let mut machine = Machine::paper();
        machine.tub.mass_kg = 20.0;
        let rows = rows(&machine, &Spin::Ramp { peak_rpm: 120.0, ramp_s: 2.0 }, None);
        let row = |name: &str| rows.iter().find(|row| row.parameter.name() == name).unwrap();
        assert_eq!(row("tub_mass_kg").source, "given");
        assert_eq!(row("shaft_mass_kg").source, "paper, Table 2");
        assert_eq!(row("spin_peak_rpm").value, None);
    }
}
