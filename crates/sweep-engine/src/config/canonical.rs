//! A plan as canonical JSON: the input in a result file, and the text by which plans are compared.

use serde_json::{Value, json};

use super::{Keys, sections};
use crate::Model;
use crate::{Axis, AxisValues, Design, Distribution, Plan};

impl<M: Model> Plan<M> {
    /// Returns the plan with all defaults and constants, in the keys of grid files: `name`, `time`,
    /// `integrator`, `axis`, `reliability`, the model's own keys, and under `set` the changes by
    /// `--set`, if there are any.
    ///
    /// An axis with a tolerance has its values as a range or a distribution, and the tolerance
    /// beside them.
    ///
    /// The text is canonical: keys are sorted, and numbers are the shortest decimals that read back
    /// to the same bits, so that two plans are equal if and only if their texts are.
    pub fn to_json(&self) -> Value {
        // The axes are left out of this copy, because they may be long.
        let mut plan = Self {
            name: self.name.clone(),
            model: self.model.clone(),
            end_s: self.end_s,
            window_s: self.window_s,
            integrator: self.integrator.clone(),
            design: self.design.clone(),
            reliability: self.reliability.clone(),
            ..Self::blank_plan()
        };
        let axes = self.axes.iter().map(|axis| self::axis_to_json(axis, self.design.as_ref()));
        let description = Keys::described(false, |keys| {
            sections::walk_plan_keys(&mut plan, keys);
            keys.write_value("axis", axes.collect());
            if !self.set.is_empty() {
                keys.write_value("set", self.set.iter().cloned().collect());
            }
        });
        description.finish()
    }
}

fn axis_to_json<M: Model>(axis: &Axis<M>, design: Option<&Design>) -> Value {
    let parameter = &axis.parameter.name;
    if let Some(Design::List { .. }) = design {
        // The values are columns of the result, and the design's hash covers them.
        return json!({ "parameter": parameter });
    }
    let range_to_json = |from: f64, to: f64, count: u64, spacing: &str| {
        let mut range_to_json = json!({ "from": from, "to": to, "spacing": spacing });
        if design.is_none() {
            range_to_json["count"] = count.into();
        }
        json!({ "parameter": parameter, "range": range_to_json })
    };
    let mut axis_json = match axis.values {
        AxisValues::List(ref values) => json!({ "parameter": parameter, "values": values }),
        AxisValues::Distributed(ref distribution) => {
            let Distribution { shape, from, to } = *distribution;
            let mut axis_json = json!({ "kind": shape.name(), "from": from, "to": to });
            for (key, number) in shape.numbers() {
                axis_json[key] = number.into();
            }
            json!({ "parameter": parameter, "distribution": axis_json })
        }
        AxisValues::Linear { from, to, count } => range_to_json(from, to, count, "linear"),
        AxisValues::Log { from, to, count } => range_to_json(from, to, count, "log"),
    };
    if let Some(tolerance) = axis.tolerance {
        axis_json["tolerance"] = tolerance.to_json();
    }
    axis_json
}
