//! Checks of machines and spins. One pass finds every violation and names its parameters, so that a
//! report can point at the places where the numbers were written.

use crate::machine::feet::{Feet, MAX_FEET};
use crate::{Machine, MachineParameter, Range, Spin, decimal};

/// The least distance between the ends of a spring or damper, and between the bearings, m. Basis:
/// far below the distances of any machine, far above rounding errors of directions. Doubling it
/// changes nothing.
const MIN_DISTANCE_M: f64 = 1e-6;

/// The range of times of a spin table, s.
const TABLE_TIME_RANGE_S: Range = Range::NonNegative;
/// The range of speeds of a spin table, rpm, which is also the range of `spin_peak_rpm`.
const TABLE_SPEED_RANGE_RPM: Range = Range::Within(-1e5, 1e5);

/// A reason why a machine or a spin is impossible.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{title}")]
pub struct Violation {
    /// The violation, in a sentence.
    pub title: String,
    /// The names of the parameters that violate it, or of entries of a spin's table such as
    /// `spin_time_s[3]`. Empty if a whole element is missing.
    pub parameters: Vec<String>,
    /// The values that are accepted.
    pub expected: String,
}

impl Violation {
    fn new(
        title: String,
        parameters: impl IntoIterator<Item = String>,
        expected: impl Into<String>,
    ) -> Self {
        Self { title, parameters: parameters.into_iter().collect(), expected: expected.into() }
    }
}

/// Returns the title of the violation of a machine whose feet cannot be used.
fn feet_title(count: usize, has_cabinet: bool) -> String {
    match count {
        _ if !has_cabinet => "feet without a cabinet".to_owned(),
        3..=MAX_FEET => format!("the cabinet's {count} feet are in a line and do not hold it"),
        _ => format!("the cabinet stands on {count} feet, and loads are computed for 3 or 4"),
    }
}

/// Returns the title of the violation of a spin table with different numbers of times and speeds.
fn table_title(time_count: usize, speed_count: usize) -> String {
    match (time_count, speed_count) {
        (0, 0) => "the spin table is empty".to_owned(),
        _ => format!("the spin table has {time_count} times but {speed_count} speeds"),
    }
}

/// Returns the names of the parameters of a vector's components.
fn component_names(prefix: &str, suffix: &str) -> [String; 3] {
    ["x", "y", "z"].map(|axis| format!("{prefix}{axis}{suffix}"))
}

/// Formats a computed number with 13 digits, so that its rounding errors do not show in messages.
fn format_rounded(value: f64) -> String {
    decimal(format!("{value:.12e}").parse().unwrap_or(value))
}

impl Machine {
    /// Returns every violation of the machine.
    pub fn violations(&self) -> Vec<Violation> {
        // A table without points has no parameters, so that only the machine is checked.
        let no_spin = Spin::Table { time_s: Vec::new(), speed_rpm: Vec::new() };
        let mut violations = range_violations(self, &no_spin);
        let mut joint_violations = self.joint_violations();
        // A violation of several numbers is not reported if one of these numbers is out of its
        // range.
        let is_out_of_range =
            |name: &String| violations.iter().any(|violation| violation.parameters.contains(name));
        joint_violations.retain(|violation| !violation.parameters.iter().any(is_out_of_range));
        violations.append(&mut joint_violations);
        violations
    }

    /// Returns the violations by combinations of numbers, even if each number is in its range.
    pub fn joint_violations(&self) -> Vec<Violation> {
        let mut joint_violations = Vec::new();
        for (body, moments_kg_m2) in [
            ("tub", self.tub.inertia_kg_m2),
            ("shaft", self.shaft.inertia_kg_m2),
            ("drum", self.drum.inertia_kg_m2),
        ] {
            let largest_axis = (1..3).fold(0, |greatest, i| {
                if moments_kg_m2[i] > moments_kg_m2[greatest] { i } else { greatest }
            });
            let moment_sum: f64 = moments_kg_m2.iter().sum();
            // A thin disc reaches equality, which rounding must not violate.
            if moments_kg_m2[largest_axis]
                > (moment_sum - moments_kg_m2[largest_axis]) * (1.0 + 1e-9)
            {
                let axis_number = 11 * (largest_axis + 1);
                let moment_text = decimal(moments_kg_m2[largest_axis]);
                let sum_of_others = format_rounded(moment_sum - moments_kg_m2[largest_axis]);
                joint_violations.push(Violation::new(
                    format!(
                        "no rigid body has the {body}'s inertia: I{axis_number} = {moment_text} \
                         exceeds the other two's sum, {sum_of_others}"
                    ),
                    [11, 22, 33].map(|axis_number| format!("{body}_inertia_{axis_number}_kg_m2")),
                    "each moment at most the sum of the other two",
                ));
            }
        }
        let springs = self.springs.iter().map(|s| ("spring", s.given_length_m())).enumerate();
        let dampers = self.dampers.iter().map(|d| ("damper", d.given_length_m())).enumerate();
        for (k, (element, length_m)) in springs.chain(dampers) {
            if length_m < MIN_DISTANCE_M {
                let element_number = k + 1;
                let length_m = format_rounded(length_m);
                let end_names = |end: &str| {
                    component_names(&format!("{element}_{element_number}_{end}_"), "_m")
                };
                joint_violations.push(Violation::new(
                    format!(
                        "the ends of {element} {element_number} are {length_m} m apart: it has no \
                         direction"
                    ),
                    ["tub", "cabinet"].into_iter().flat_map(end_names),
                    format!("ends at least {MIN_DISTANCE_M:e} m apart"),
                ));
            }
        }
        for (k, stop) in self.stops.iter().enumerate() {
            if stop.direction_length() < MIN_DISTANCE_M {
                let element_number = k + 1;
                joint_violations.push(Violation::new(
                    format!("stop {element_number} has no direction"),
                    component_names(&format!("stop_{element_number}_direction_"), ""),
                    "the way from the tub to the stop, such as [0, 0, 1]; any length but 0 is made \
                     1",
                ));
            }
        }
        let has_cabinet = self.cabinet.is_some();
        match Feet::new(self) {
            Some(feet) => {
                let first_y_m = self.feet[0].foot_m[1];
                for (k, foot) in self.feet.iter().enumerate() {
                    let height_difference_m = foot.foot_m[1] - first_y_m;
                    if height_difference_m.abs() > MIN_DISTANCE_M {
                        let element_number = k + 1;
                        let distance_m = format_rounded(height_difference_m.abs());
                        let direction = if height_difference_m > 0.0 { "higher" } else { "lower" };
                        joint_violations.push(Violation::new(
                            format!(
                                "foot {element_number} stands {distance_m} m {direction} than \
                                 foot 1"
                            ),
                            [format!("foot_{element_number}_y_m")],
                            "one height for all feet: the second number of foot_m",
                        ));
                    }
                }
                let loads_n = feet.rest_loads_n(self).into_iter().enumerate();
                let lifted_feet = loads_n.filter(|(_, load_n)| *load_n <= 0.0);
                joint_violations.extend(lifted_feet.map(|(k, load_n)| {
                    let element_number = k + 1;
                    Violation::new(
                        format!(
                            "foot {element_number} lifts at rest: it would carry {load_n:.1} N"
                        ),
                        component_names(&format!("foot_{element_number}_"), "_m"),
                        "feet around the mass centre of cabinet and machine together",
                    )
                }));
            }
            None if has_cabinet || !self.feet.is_empty() => {
                let foot_count = self.feet.len();
                let expected = match has_cabinet {
                    true => "three or four [[feet]] with foot_m = [x, y, z], not all in a line",
                    false => {
                        "a section [cabinet] with mass_kg, centre_m and friction, or no [[feet]]"
                    }
                };
                let foot_parameters = (1..=foot_count)
                    .flat_map(|foot| component_names(&format!("foot_{foot}_"), "_m"));
                joint_violations.push(Violation::new(
                    feet_title(foot_count, has_cabinet),
                    foot_parameters,
                    expected,
                ));
            }
            None => {}
        }
        if !self.further_unbalances.is_empty() {
            for (k, unbalance) in self.unbalances().enumerate() {
                if unbalance.mass_kg != 0.0 && unbalance.radius_m == 0.0 {
                    let element_number = k + 1;
                    let number_prefix =
                        if k == 0 { String::new() } else { format!("{element_number}_") };
                    joint_violations.push(Violation::new(
                        format!(
                            "unbalance {element_number} is on the drum's axis and unbalances \
                             nothing, beside others"
                        ),
                        [format!("unbalance_{number_prefix}radius_m")],
                        "a distance from the axis, negative on the other side; a mass on the axis \
                         belongs to the drum",
                    ));
                }
            }
        }
        let distance_m = self.bearings.front_x_m - self.bearings.rear_x_m;
        if distance_m < MIN_DISTANCE_M {
            let distance_m = format_rounded(distance_m);
            joint_violations.push(Violation::new(
                format!("front and rear bearing are {distance_m} m apart and hold no angle"),
                ["rear", "front"].map(|end| format!("bearing_{end}_x_m")),
                format!("bearings at least {MIN_DISTANCE_M:e} m apart"),
            ));
        }
        if self.springs.is_empty() && self.bushings.is_empty() {
            let title = "the machine has no springs and no bushings: nothing carries it".to_owned();
            let expected = "at least one of [[springs]] or [[bushings]] in the machine file";
            joint_violations.push(Violation::new(title, [], expected));
        }
        joint_violations
    }
}

/// Returns the violations of single numbers. Parameters of several numbers are skipped, because
/// each of their numbers has a parameter of its own.
fn range_violations(machine: &Machine, spin: &Spin) -> Vec<Violation> {
    let find_violation = |parameter: MachineParameter| {
        let name = parameter.name();
        let value = parameter.get(machine, spin)?;
        let range = parameter.range();
        if parameter.target().has_several_numbers() || range.contains(value) {
            return None;
        }
        let title = format!("{name} = {} is out of range", decimal(value));
        Some(Violation::new(title, [name.to_owned()], range.describe_for(value)))
    };
    MachineParameter::all(machine, spin).into_iter().filter_map(find_violation).collect()
}

impl Spin {
    /// Returns every violation of the spin.
    pub fn violations(&self) -> Vec<Violation> {
        match self {
            Self::Table { .. } => self.joint_violations(),
            Self::Ramped { .. } => range_violations(&Machine::paper(), self),
        }
    }

    /// Returns the violations by combinations of a table's numbers. The numbers of a profile do not
    /// depend on each other.
    pub fn joint_violations(&self) -> Vec<Violation> {
        let Self::Table { time_s, speed_rpm } = self else { return Vec::new() };
        let mut violations = Vec::new();
        if time_s.len() != speed_rpm.len() || time_s.is_empty() {
            violations.push(Violation::new(
                table_title(time_s.len(), speed_rpm.len()),
                ["spin_speed_rpm", "spin_time_s"].map(str::to_owned),
                "as many speeds as times, at least one of each",
            ));
        }
        for (column, values, range) in [
            ("time_s", time_s, TABLE_TIME_RANGE_S),
            ("speed_rpm", speed_rpm, TABLE_SPEED_RANGE_RPM),
        ] {
            let out_of_range_values =
                values.iter().enumerate().filter(|(_, value)| !range.contains(**value));
            violations.extend(out_of_range_values.map(|(index, &value)| {
                let value_text = decimal(value);
                let entry_number = index + 1;
                let expected = match column {
                    "time_s" => range.describe_for(value),
                    _ => range.to_string(),
                };
                Violation::new(
                    format!(
                        "{column} = {value_text} (entry {entry_number}) of the spin table is out \
                         of range"
                    ),
                    [format!("spin_{column}[{index}]")],
                    expected,
                )
            }));
        }
        if let Some(&time_s) = time_s.first()
            && TABLE_TIME_RANGE_S.contains(time_s)
            && time_s != 0.0
        {
            violations.push(Violation::new(
                format!("the spin table starts at {time_s} s"),
                ["spin_time_s[0]".to_owned()],
                "a table that starts at time 0",
            ));
        }
        for (k, pair) in time_s.windows(2).enumerate() {
            if let &[before_s, time_s] = pair
                && TABLE_TIME_RANGE_S.contains(before_s)
                && TABLE_TIME_RANGE_S.contains(time_s)
                && time_s <= before_s
            {
                violations.push(Violation::new(
                    format!("time {time_s} s of the spin table follows {before_s} s"),
                    [format!("spin_time_s[{}]", k + 1)],
                    "times that increase",
                ));
            }
        }
        violations
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Profile;

    /// Returns the violations of the changed paper's machine, as text.
    fn violations_after(change: impl FnOnce(&mut Machine)) -> Vec<String> {
        let mut machine = Machine::paper();
        change(&mut machine);
        machine.violations().iter().map(ToString::to_string).collect()
    }

    #[test]
    fn the_papers_machine_has_no_violations() {
        assert_eq!(Machine::paper().violations(), []);
    }

    #[test]
    fn every_violation_is_returned_at_once() {
        let violations = violations_after(|m| {
            m.tub.mass_kg = -1.0;
            m.shaft.inertia_kg_m2 = [0.1, 0.02, 0.02];
            m.springs[2].tub_m = m.springs[2].cabinet_m;
            m.dampers[1].damping_n_s_per_m = f64::NAN;
            m.bearings.rear_x_m = 0.05;
        });
        assert_eq!(
            violations,
            [
                "tub_mass_kg = -1 is out of range",
                "bearing_rear_x_m = 0.05 is out of range",
                "damper_2_damping_n_s_per_m = NaN is out of range",
                "no rigid body has the shaft's inertia: I11 = 0.1 exceeds the other two's sum, \
                 0.04",
                "the ends of spring 3 are 0 m apart: it has no direction",
            ]
        );
    }

    #[test]
    fn a_thin_disc_is_a_rigid_body() {
        assert_eq!(violations_after(|m| m.shaft.inertia_kg_m2 = [0.3, 0.1, 0.2]), [""; 0]);
    }

    #[test]
    fn a_number_out_of_range_is_reported_once() {
        assert_eq!(
            violations_after(|m| m.tub.inertia_kg_m2[1] = -1.61),
            ["tub_inertia_22_kg_m2 = -1.61 is out of range"]
        );
    }

    #[test]
    fn a_machine_without_springs_is_refused() {
        assert_eq!(
            violations_after(|m| m.springs.clear()),
            ["the machine has no springs and no bushings: nothing carries it"]
        );
        assert_eq!(violations_after(|m| m.dampers.clear()), [""; 0]);
    }

    #[test]
    fn each_concern_is_a_parameter_of_the_machine() {
        let mut machine = Machine::paper();
        machine.tub.inertia_kg_m2[0] = 10.0;
        machine.dampers[0].cabinet_m = machine.dampers[0].tub_m;
        machine.bearings.front_x_m = 1e-9;
        machine.bearings.rear_x_m = -1e-9;
        let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 1.0, ramp_s: 1.0 };
        let violations = machine.violations();
        assert_eq!(violations.len(), 3, "{violations:?}");
        for name in violations.iter().flat_map(|violation| &violation.parameters) {
            assert!(MachineParameter::find(name, &machine, &spin).is_ok(), "{name}");
        }
    }

    #[test]
    fn spins_are_checked_as_a_whole() {
        let violations =
            |spin: Spin| spin.violations().iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(
            violations(Spin::Ramped { profile: Profile::Ramp, peak_rpm: -350.0, ramp_s: 50.0 }),
            [""; 0]
        );
        assert_eq!(
            violations(Spin::Table { time_s: vec![0.0, 1.0], speed_rpm: vec![0.0, 9.0] }),
            [""; 0]
        );
        assert_eq!(
            violations(Spin::Ramped {
                profile: Profile::Cycloidal,
                peak_rpm: f64::INFINITY,
                ramp_s: 0.0
            }),
            ["spin_peak_rpm = inf is out of range", "spin_ramp_s = 0 is out of range"]
        );
        assert_eq!(
            violations(Spin::Table {
                time_s: vec![1.0, 3.0, 2.0, f64::NAN],
                speed_rpm: vec![0.0, 1e6]
            }),
            [
                "the spin table has 4 times but 2 speeds",
                "time_s = NaN (entry 4) of the spin table is out of range",
                "speed_rpm = 1000000 (entry 2) of the spin table is out of range",
                "the spin table starts at 1 s",
                "time 2 s of the spin table follows 3 s",
            ]
        );
        assert_eq!(
            violations(Spin::Table { time_s: vec![], speed_rpm: vec![] }),
            ["the spin table is empty"]
        );
    }
}
