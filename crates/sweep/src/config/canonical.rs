//! A plan as JSON: what a result file carries as its input, and what tells one run's plan from
//! another's.

use serde_json::{Value, json};
use washer_model::Spin;
use washer_row::{Criterion, Measures};

use super::machine;
use crate::design::{Design, Distribution};
use crate::plan::{Axis, AxisValues, Plan};

impl Plan {
    /// The whole plan with every default and constant in place, in the grid file's own terms:
    /// `name`, `machine` (in full), `spin`, `time`, `integrator`, `axis`, `reliability`, and
    /// under `set` what `--set` has changed, if it has.
    ///
    /// Canonical: keys are sorted, and numbers are written as the shortest decimal that reads back
    /// to the same bits, so two plans are the same if and only if their texts are.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let axes = self.axes.iter().map(|axis| self::axis(axis, self.design.as_ref()));
        let channels = self.reliability.channels.iter().map(|channel| channel.name());
        let mut plan = json!({
            "name": self.name,
            "machine": machine::to_json(&self.machine),
            "spin": spin(&self.spin),
            "time": { "end_s": self.end_s, "window_s": self.window_s },
            "integrator": self.integrator.to_json(),
            "axis": axes.collect::<Value>(),
            "reliability": {
                "ratio_limit": self.reliability.ratio_limit,
                "channels": channels.collect::<Value>(),
            },
        });
        if let Some(design) = &self.design {
            plan["design"] = self::design(design);
        }
        // What is left out stands for the default, so that plans which do not ask for more read as
        // ever.
        // The machine says how many stops and feet it has.
        let Measures { criterion, metrics, stops: _, feet: _ } = &self.measures;
        if *criterion != Criterion::default() {
            plan["reliability"]["criterion"] = criterion.name().into();
        }
        if !metrics.is_empty() {
            plan["metrics"] = metrics.iter().map(|metric| metric.name()).collect();
        }
        if let Some(speeds) = &self.growth_speeds {
            plan["stability"] = json!({ "speed_rpm": speeds.to_string() });
        }
        if !self.set.is_empty() {
            plan["set"] = self.set.iter().cloned().collect();
        }
        plan
    }
}

fn design(design: &Design) -> Value {
    let method = design.method();
    match design {
        Design::LatinHypercube { points, seed }
        | Design::Sobol { points, seed }
        | Design::MonteCarlo { points, seed } => {
            json!({ "method": method, "points": points, "seed": seed })
        }
        Design::List { file, points, hash } => {
            json!({ "method": method, "file": file, "points": points, "hash": hash })
        }
    }
}

fn spin(spin: &Spin) -> Value {
    let profile = super::spin::name(spin);
    match spin {
        Spin::Cycloidal { peak_rpm, ramp_s }
        | Spin::Triangular { peak_rpm, ramp_s }
        | Spin::Ramp { peak_rpm, ramp_s } => {
            json!({ "profile": profile, "peak_rpm": peak_rpm, "ramp_s": ramp_s })
        }
        Spin::Table { time_s, speed_rpm } => {
            json!({ "profile": profile, "time_s": time_s, "speed_rpm": speed_rpm })
        }
    }
}

fn axis(axis: &Axis, design: Option<&Design>) -> Value {
    let parameter = axis.parameter.name();
    if let Some(Design::List { .. }) = design {
        // The values are the result's own columns, and the design's hash is over them all.
        return json!({ "parameter": parameter });
    }
    let range = |from: f64, to: f64, count: u64, spacing: &str| {
        let mut range = json!({ "from": from, "to": to, "spacing": spacing });
        if design.is_none() {
            range["count"] = count.into();
        }
        json!({ "parameter": parameter, "range": range })
    };
    match axis.values {
        AxisValues::List(ref values) => json!({ "parameter": parameter, "values": values }),
        AxisValues::Distributed(ref distribution) => {
            let Distribution { shape, from, to } = *distribution;
            let mut json = json!({ "kind": shape.name(), "from": from, "to": to });
            for (key, number) in shape.numbers() {
                json[key] = number.into();
            }
            json!({ "parameter": parameter, "distribution": json })
        }
        AxisValues::Linear { from, to, count } => range(from, to, count, "linear"),
        AxisValues::Log { from, to, count } => range(from, to, count, "log"),
    }
}
