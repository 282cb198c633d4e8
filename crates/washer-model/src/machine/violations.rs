//! Checks of machines and spins: everything impossible about them, found in one pass and named by
//! parameter, so that a report can point at each number where it was written.

use crate::machine::feet::{FEET, Feet};
use crate::{Machine, Parameter, Range, Spin, decimal};

/// Ends of a spring or damper closer than this have no direction; bearings closer than this hold no
/// angle.
const SHORTEST_M: f64 = 1e-6;

/// Times and speeds (rpm) accepted of a spin table: as of `spin_peak_rpm`.
const TIMES: Range = Range::NonNegative;
const SPEEDS: Range = Range::Within(-1e5, 1e5);

/// One reason why a machine or a spin is impossible.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Violation {
    /// A number outside its parameter's range, or not a finite number.
    #[error("{} = {} is out of range", parameter.name(), decimal(*value))]
    OutOfRange {
        /// The parameter.
        parameter: Parameter,
        /// Its value.
        value: f64,
    },
    /// Principal moments of inertia that no rigid body has: one exceeds the sum of the other two.
    #[error(
        "no rigid body has the {body}'s inertia: I{} = {} exceeds the other two's sum, {}",
        11 * (greatest + 1),
        decimal(moments_kg_m2[*greatest]),
        rounded(moments_kg_m2.iter().sum::<f64>() - moments_kg_m2[*greatest])
    )]
    Inertia {
        /// `"tub"`, `"shaft"` or `"drum"`.
        body: &'static str,
        /// Index of the greatest moment, 0 to 2.
        greatest: usize,
        /// The three moments, in kg m^2.
        moments_kg_m2: [f64; 3],
    },
    /// A spring or damper whose ends coincide.
    #[error(
        "the ends of {element} {number} are {} m apart: it has no direction",
        rounded(*length_m)
    )]
    ZeroLength {
        /// `"spring"` or `"damper"`.
        element: &'static str,
        /// Which, from 1.
        number: usize,
        /// Distance between its ends.
        length_m: f64,
    },
    /// A stop whose direction has no length.
    #[error("stop {number} has no direction")]
    NoDirection {
        /// Which stop, from 1.
        number: usize,
    },
    /// An unbalance on the drum's axis, of a machine that has others.
    #[error("unbalance {number} is on the drum's axis and unbalances nothing, beside others")]
    OnAxis {
        /// Which, from 1, the one that every machine has.
        number: usize,
    },
    /// A cabinet whose feet do not hold it: not three or four of them, all in a line, or feet
    /// without a cabinet.
    #[error("{}", of_feet(*count, *has_cabinet))]
    Feet {
        /// How many.
        count: usize,
        /// Whether there is a cabinet on them.
        has_cabinet: bool,
    },
    /// A foot that does not stand as high as the first: a floor is even.
    #[error(
        "foot {number} stands {} m {} than foot 1",
        rounded(higher_m.abs()),
        if *higher_m > 0.0 { "higher" } else { "lower" }
    )]
    FootOffTheFloor {
        /// Which, from 1.
        number: usize,
        /// How much higher it stands (m).
        higher_m: f64,
    },
    /// A foot that carries nothing even at rest: the machine's mass centre is beyond the others.
    #[error("foot {number} lifts at rest: it would carry {load_n:.1} N")]
    FootInTheAir {
        /// Which, from 1.
        number: usize,
        /// Its load (N).
        load_n: f64,
    },
    /// Bearings at one place cannot hold the shaft's direction.
    #[error("front and rear bearing are {} m apart and hold no angle", rounded(*distance_m))]
    BearingsTogether {
        /// Distance between them.
        distance_m: f64,
    },
    /// No spring carries the machine.
    #[error("the machine has no springs: nothing carries it")]
    NoSprings,
    /// Times and speeds of a spin table do not pair up, or there are none.
    #[error("{}", of_table(*times, *speeds))]
    TableLength {
        /// How many times.
        times: usize,
        /// How many speeds.
        speeds: usize,
    },
    /// The first time of a spin table is not 0.
    #[error("the spin table starts at {time_s} s")]
    TableStart {
        /// The first time.
        time_s: f64,
    },
    /// A time of a spin table that does not come after the one before it.
    #[error("time {time_s} s of the spin table follows {before_s} s")]
    TableOrder {
        /// Index of the later time, from 0.
        index: usize,
        /// The time before it.
        before_s: f64,
        /// The time.
        time_s: f64,
    },
    /// An entry of a spin table that is out of range.
    #[error(
        "{column} = {} (entry {}) of the spin table is out of range",
        decimal(*value),
        index + 1
    )]
    TableValue {
        /// `"time_s"` or `"speed_rpm"`.
        column: &'static str,
        /// Index from 0.
        index: usize,
        /// The entry.
        value: f64,
    },
}

impl Violation {
    /// The numbers to look at: parameter names, or `time_s[3]` and the like in a spin table. Empty
    /// where the missing thing has no number.
    #[must_use]
    pub fn concerns(&self) -> Vec<String> {
        match self {
            Self::OutOfRange { parameter, .. } => vec![parameter.name().to_owned()],
            Self::Inertia { body, .. } => {
                [11, 22, 33].map(|ii| format!("{body}_inertia_{ii}_kg_m2")).into()
            }
            Self::ZeroLength { element, number, .. } => ["tub", "cabinet"]
                .into_iter()
                .flat_map(|end| components(&format!("{element}_{number}_{end}_"), "_m"))
                .collect(),
            Self::NoDirection { number } => {
                components(&format!("stop_{number}_direction_"), "").into()
            }
            Self::OnAxis { number: 1 } => vec!["unbalance_radius_m".to_owned()],
            Self::OnAxis { number } => vec![format!("unbalance_{number}_radius_m")],
            Self::Feet { count, .. } => {
                (1..=*count).flat_map(|foot| components(&format!("foot_{foot}_"), "_m")).collect()
            }
            Self::FootInTheAir { number, .. } => {
                components(&format!("foot_{number}_"), "_m").into()
            }
            Self::FootOffTheFloor { number, .. } => vec![format!("foot_{number}_y_m")],
            Self::BearingsTogether { .. } => {
                vec!["bearing_rear_x_m".to_owned(), "bearing_front_x_m".to_owned()]
            }
            Self::NoSprings => Vec::new(),
            Self::TableLength { .. } => vec!["speed_rpm".to_owned(), "time_s".to_owned()],
            Self::TableStart { .. } => vec!["time_s[0]".to_owned()],
            Self::TableOrder { index, .. } => vec![format!("time_s[{index}]")],
            Self::TableValue { column, index, .. } => vec![format!("{column}[{index}]")],
        }
    }

    /// The values that would be accepted instead.
    #[must_use]
    pub fn expected(&self) -> String {
        match self {
            Self::OutOfRange { parameter, value } => parameter.range().instead_of(*value),
            Self::Inertia { .. } => "each moment at most the sum of the other two".to_owned(),
            Self::ZeroLength { .. } => format!("ends at least {SHORTEST_M:e} m apart"),
            Self::NoDirection { .. } => {
                "the way from the tub to the stop, such as [0, 0, 1]; any length but 0 is made 1"
                    .to_owned()
            }
            Self::OnAxis { .. } => {
                "a distance from the axis, negative on the other side; a mass on the axis belongs \
                 to the drum"
                    .to_owned()
            }
            Self::Feet { has_cabinet: false, .. } => {
                "a section [cabinet] with mass_kg, centre_m and friction, or no [[feet]]".to_owned()
            }
            Self::Feet { .. } => {
                "three or four [[feet]] with foot_m = [x, y, z], not all in a line".to_owned()
            }
            Self::FootOffTheFloor { .. } => {
                "one height for all feet: the second number of foot_m".to_owned()
            }
            Self::FootInTheAir { .. } => {
                "feet around the mass centre of cabinet and machine together".to_owned()
            }
            Self::BearingsTogether { .. } => format!("bearings at least {SHORTEST_M:e} m apart"),
            Self::NoSprings => "at least one spring".to_owned(),
            Self::TableLength { .. } => "as many speeds as times, at least one of each".to_owned(),
            Self::TableStart { .. } => "a table that starts at time 0".to_owned(),
            Self::TableOrder { .. } => "times that increase".to_owned(),
            Self::TableValue { column: "time_s", value, .. } => TIMES.instead_of(*value),
            Self::TableValue { .. } => SPEEDS.to_string(),
        }
    }
}

/// Why so many feet do not hold a cabinet, or that they have none to hold.
fn of_feet(count: usize, has_cabinet: bool) -> String {
    match count {
        _ if !has_cabinet => "feet without a cabinet".to_owned(),
        3..=FEET => format!("the cabinet's {count} feet are in a line and do not hold it"),
        _ => format!("the cabinet stands on {count} feet, and loads are reckoned for 3 or 4"),
    }
}

/// What is wrong with so many entries of a spin table.
fn of_table(times: usize, speeds: usize) -> String {
    match (times, speeds) {
        (0, 0) => "the spin table is empty".to_owned(),
        _ => format!("the spin table has {times} times but {speeds} speeds"),
    }
}

/// Names of a vector's components.
fn components(before: &str, after: &str) -> [String; 3] {
    ["x", "y", "z"].map(|axis| format!("{before}{axis}{after}"))
}

/// A computed number for a message, without the last digits' rounding error.
fn rounded(value: f64) -> String {
    decimal(format!("{value:.12e}").parse().unwrap_or(value))
}

impl Machine {
    /// Everything impossible about this machine; empty for a sound one.
    #[must_use]
    pub fn violations(&self) -> Vec<Violation> {
        // The spin's own parameters are the spin's to judge; any table has none.
        let no_spin = Spin::Table { time_s: Vec::new(), speed_rpm: Vec::new() };
        let mut found = out_of_range(self, &no_spin);
        let in_range = |names: &[String]| {
            !found.iter().any(|v| v.concerns().iter().any(|name| names.contains(name)))
        };
        let mut joint = self.joint_violations();
        // A number refused by itself says all there is to say about what depends on it.
        joint.retain(|violation| in_range(&violation.concerns()));
        found.append(&mut joint);
        found
    }

    /// Combinations of numbers that are impossible although each number is in its range.
    #[must_use]
    pub fn joint_violations(&self) -> Vec<Violation> {
        let mut joint = Vec::new();
        for (body, moments_kg_m2) in [
            ("tub", self.tub.inertia_kg_m2),
            ("shaft", self.shaft.inertia_kg_m2),
            ("drum", self.drum.inertia_kg_m2),
        ] {
            let greatest =
                (1..3).fold(0, |g, i| if moments_kg_m2[i] > moments_kg_m2[g] { i } else { g });
            let sum: f64 = moments_kg_m2.iter().sum();
            // A thin disc reaches equality: rounding must not refuse it.
            if moments_kg_m2[greatest] > (sum - moments_kg_m2[greatest]) * (1.0 + 1e-9) {
                joint.push(Violation::Inertia { body, greatest, moments_kg_m2 });
            }
        }
        let springs = self.springs.iter().map(|s| ("spring", s.given_length_m())).enumerate();
        let dampers = self.dampers.iter().map(|d| ("damper", d.given_length_m())).enumerate();
        for (k, (element, length_m)) in springs.chain(dampers) {
            if length_m < SHORTEST_M {
                joint.push(Violation::ZeroLength { element, number: k + 1, length_m });
            }
        }
        for (k, stop) in self.stops.iter().enumerate() {
            if stop.direction_length() < SHORTEST_M {
                joint.push(Violation::NoDirection { number: k + 1 });
            }
        }
        let has_cabinet = self.cabinet.is_some();
        match Feet::new(self) {
            Some(feet) => {
                let first_y_m = self.feet[0].foot_m[1];
                for (k, foot) in self.feet.iter().enumerate() {
                    let higher_m = foot.foot_m[1] - first_y_m;
                    if higher_m.abs() > SHORTEST_M {
                        joint.push(Violation::FootOffTheFloor { number: k + 1, higher_m });
                    }
                }
                let loads_n = feet.at_rest_n(self).into_iter().enumerate();
                let lifted = loads_n.filter(|(_, load_n)| *load_n <= 0.0);
                joint.extend(
                    lifted.map(|(k, load_n)| Violation::FootInTheAir { number: k + 1, load_n }),
                );
            }
            None if has_cabinet || !self.feet.is_empty() => {
                joint.push(Violation::Feet { count: self.feet.len(), has_cabinet });
            }
            None => {}
        }
        if !self.further_unbalances.is_empty() {
            for (k, unbalance) in self.unbalances().enumerate() {
                if unbalance.mass_kg != 0.0 && unbalance.radius_m == 0.0 {
                    joint.push(Violation::OnAxis { number: k + 1 });
                }
            }
        }
        let distance_m = self.bearings.front_x_m - self.bearings.rear_x_m;
        if distance_m < SHORTEST_M {
            joint.push(Violation::BearingsTogether { distance_m });
        }
        if self.springs.is_empty() {
            joint.push(Violation::NoSprings);
        }
        joint
    }
}

/// Every single number outside its range. Parameters of several numbers are judged by their parts.
fn out_of_range(machine: &Machine, spin: &Spin) -> Vec<Violation> {
    let judge = |parameter: Parameter| {
        let value = parameter.get(machine, spin)?;
        let single = !parameter.target().is_several();
        (single && !parameter.range().contains(value))
            .then_some(Violation::OutOfRange { parameter, value })
    };
    Parameter::all(machine, spin).into_iter().filter_map(judge).collect()
}

impl Spin {
    /// Everything impossible about this spin; empty for a sound one.
    #[must_use]
    pub fn violations(&self) -> Vec<Violation> {
        match self {
            Self::Table { .. } => self.joint_violations(),
            Self::Cycloidal { .. } | Self::Triangular { .. } | Self::Ramp { .. } => {
                out_of_range(&Machine::paper(), self)
            }
        }
    }

    /// Everything impossible about a table. The numbers of a profile are independent.
    #[must_use]
    pub fn joint_violations(&self) -> Vec<Violation> {
        let Self::Table { time_s, speed_rpm } = self else { return Vec::new() };
        let mut found = Vec::new();
        if time_s.len() != speed_rpm.len() || time_s.is_empty() {
            found.push(Violation::TableLength { times: time_s.len(), speeds: speed_rpm.len() });
        }
        for (column, values, range) in [("time_s", time_s, TIMES), ("speed_rpm", speed_rpm, SPEEDS)]
        {
            let bad = values.iter().enumerate().filter(|(_, value)| !range.contains(**value));
            found.extend(bad.map(|(index, &value)| Violation::TableValue { column, index, value }));
        }
        if let Some(&time_s) = time_s.first()
            && TIMES.contains(time_s)
            && time_s != 0.0
        {
            found.push(Violation::TableStart { time_s });
        }
        for (k, pair) in time_s.windows(2).enumerate() {
            if let &[before_s, time_s] = pair
                && TIMES.contains(before_s)
                && TIMES.contains(time_s)
                && time_s <= before_s
            {
                found.push(Violation::TableOrder { index: k + 1, before_s, time_s });
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What `change` makes wrong with the paper's machine, as text.
    fn wrong(change: impl FnOnce(&mut Machine)) -> Vec<String> {
        let mut machine = Machine::paper();
        change(&mut machine);
        machine.violations().iter().map(ToString::to_string).collect()
    }

    #[test]
    fn the_papers_machine_is_sound() {
        assert_eq!(Machine::paper().violations(), []);
    }

    #[test]
    fn every_violation_is_returned_at_once() {
        let found = wrong(|m| {
            m.tub.mass_kg = -1.0;
            m.shaft.inertia_kg_m2 = [0.1, 0.02, 0.02];
            m.springs[2].tub_m = m.springs[2].cabinet_m;
            m.dampers[1].damping_n_s_per_m = f64::NAN;
            m.bearings.rear_x_m = 0.05;
        });
        assert_eq!(
            found,
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
        assert_eq!(wrong(|m| m.shaft.inertia_kg_m2 = [0.3, 0.1, 0.2]), [""; 0]);
    }

    #[test]
    fn a_number_out_of_range_is_reported_once() {
        assert_eq!(
            wrong(|m| m.tub.inertia_kg_m2[1] = -1.61),
            ["tub_inertia_22_kg_m2 = -1.61 is out of range"]
        );
    }

    #[test]
    fn nothing_carries_a_machine_without_springs() {
        assert_eq!(
            wrong(|m| m.springs.clear()),
            ["the machine has no springs: nothing carries it"]
        );
        assert_eq!(wrong(|m| m.dampers.clear()), [""; 0]);
    }

    #[test]
    fn each_concern_is_a_parameter_of_the_machine() {
        let mut machine = Machine::paper();
        machine.tub.inertia_kg_m2[0] = 10.0;
        machine.dampers[0].cabinet_m = machine.dampers[0].tub_m;
        machine.bearings.front_x_m = 1e-9;
        machine.bearings.rear_x_m = -1e-9;
        let spin = Spin::Ramp { peak_rpm: 1.0, ramp_s: 1.0 };
        let found = machine.violations();
        assert_eq!(found.len(), 3, "{found:?}");
        for name in found.iter().flat_map(Violation::concerns) {
            assert!(Parameter::find(&name, &machine, &spin).is_ok(), "{name}");
        }
    }

    #[test]
    fn spins_are_judged_whole() {
        let judge =
            |spin: Spin| spin.violations().iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(judge(Spin::Ramp { peak_rpm: -350.0, ramp_s: 50.0 }), [""; 0]);
        assert_eq!(
            judge(Spin::Table { time_s: vec![0.0, 1.0], speed_rpm: vec![0.0, 9.0] }),
            [""; 0]
        );
        assert_eq!(
            judge(Spin::Cycloidal { peak_rpm: f64::INFINITY, ramp_s: 0.0 }),
            ["spin_peak_rpm = inf is out of range", "spin_ramp_s = 0 is out of range"]
        );
        assert_eq!(
            judge(Spin::Table { time_s: vec![1.0, 3.0, 2.0, f64::NAN], speed_rpm: vec![0.0, 1e6] }),
            [
                "the spin table has 4 times but 2 speeds",
                "time_s = NaN (entry 4) of the spin table is out of range",
                "speed_rpm = 1000000 (entry 2) of the spin table is out of range",
                "the spin table starts at 1 s",
                "time 2 s of the spin table follows 3 s",
            ]
        );
        assert_eq!(
            judge(Spin::Table { time_s: vec![], speed_rpm: vec![] }),
            ["the spin table is empty"]
        );
    }
}
