//! A plan as JSON: a result file carries it as its input, and it tells the plans of two runs apart.

use serde_json::{Value, json};
use sweep_parameter::Parameter as _;

use super::{Keys, Read, sections};
use crate::{Axis, AxisValues, Design, Distribution, Plan};

impl<M: Read> Plan<M> {
    /// The whole plan with every default and constant in place, in the grid file's own terms:
    /// `name`, `time`, `integrator`, `axis`, `reliability`, what the model says of itself, and
    /// under `set` what `--set` has changed, if it has.
    ///
    /// Canonical: keys are sorted, and numbers are written as the shortest decimal that reads back
    /// to the same bits, so two plans are the same if and only if their texts are.
    pub fn to_json(&self) -> Value {
        // Not the axes, which may be long.
        let mut plan = Self {
            name: self.name.clone(),
            model: self.model.clone(),
            end_s: self.end_s,
            window_s: self.window_s,
            integrator: self.integrator,
            design: self.design.clone(),
            reliability: self.reliability.clone(),
            ..Self::blank()
        };
        let axes = self.axes.iter().map(|axis| self::axis(axis, self.design.as_ref()));
        let told = Keys::told(false, |keys| {
            sections::walk(&mut plan, keys);
            keys.write("axis", axes.collect());
            if !self.set.is_empty() {
                keys.write("set", self.set.iter().cloned().collect());
            }
        });
        told.finish()
    }
}

fn axis<M: Read>(axis: &Axis<M>, design: Option<&Design>) -> Value {
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
