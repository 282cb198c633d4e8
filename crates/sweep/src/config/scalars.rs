//! `--set` of what a grid file holds of the washing machine that is no parameter.

use serde_json::{Value, json};
use sweep_engine::config::Draft;
use sweep_engine::config::written::Written;
use washer_row::{Criterion, Metric};

use super::spin;
use crate::model::Washer;

/// Their names.
pub(crate) const NAMES: &[&str] = &["profile", "criterion", "metrics"];

/// Puts one in place; its value as it stands in the plan.
pub(crate) fn put(written: &Written<'_>, draft: &mut Draft<'_, Washer>) -> Option<Value> {
    let report = draft.report;
    let plan = &mut draft.plan;
    Some(match written.name.value {
        "profile" => {
            let names = spin::RAMPED.map(|profile| profile.name);
            let profile = &spin::RAMPED[written.choice(&names)?];
            let Some(spun) = spin::by_profile(&plan.model.spin, profile) else {
                let title = "the grid's spin is a table, which has no peak and no ramp";
                let expected = "expected a grid file with `peak_rpm` and `ramp_s`";
                return report.refuse(&written.name.at, title, expected);
            };
            plan.model.spin = spun;
            json!(profile.name)
        }
        "metrics" => {
            let metrics = written.list("metric", &Metric::ALL, Metric::name)?;
            let speeds = &mut plan.model.held_speeds;
            let of_speeds = metrics.iter().find(|metric| metric.is_of_speeds());
            if of_speeds.is_none() {
                *speeds = None;
            } else if let (Some(metric), None) = (of_speeds, &speeds) {
                let title = format!("the metric `{}` needs speeds", metric.name());
                let expected = "expected a grid file with this metric and a section [stability]";
                return report.refuse(&written.value.at, title, expected);
            }
            plan.model.measures.metrics = metrics;
            json!(written.value.value)
        }
        "criterion" => {
            let names = Criterion::ALL.map(Criterion::name);
            plan.model.measures.criterion = Criterion::ALL[written.choice(&names)?];
            report.put("reliability.criterion", written.value.at.clone());
            json!(plan.model.measures.criterion.name())
        }
        _ => return None,
    })
}
