//! What a page computes with: the module, its setup and the sliders.

use serde_json::{Value, json};

use super::embed;
use crate::{Live, Slider, label};

/// The module of `crates/washer-live`, packed by gzip; `scripts/release/build_live.sh` makes it.
const MODULE: &[u8] = include_bytes!("../../assets/live.wasm.gz");

/// What the page's workers run.
pub(crate) const WORKER: &str =
    concat!("<script type=\"text/plain\" id=\"worker\">", include_str!("worker.js"), "</script>\n");

/// `axes` by name, and whether they are logarithmic.
pub(crate) fn json(live: &Live, axes: &[(&str, bool)]) -> Value {
    let channel = |name: &String| {
        let (unit, factor) = label::shown(label::unit_of_channel(name));
        json!({ "name": name, "words": label::channel(name), "unit": unit, "factor": factor })
    };
    let mut data = json!(live);
    data["module"] = embed::bytes(MODULE.iter().copied()).into();
    data["setup"] = embed::doubles(&live.setup).into();
    data["sliders"] = live.sliders.iter().map(|one| slider(one, axes)).collect();
    data["channels"] = live.channels.iter().map(channel).collect();
    data["metrics"] = live.metrics.iter().map(metric).collect();
    data["kinds"] = live.kinds.iter().map(|kind| kind.replace('_', " ")).collect();
    data
}

fn metric(columns: &[String; 2]) -> Value {
    let unit = label::unit_of_name(&columns[0]);
    let (unit, factor) = label::shown(&unit);
    let words = label::quantity(&columns[0]);
    json!({ "columns": columns, "words": words, "unit": unit, "factor": factor })
}

fn slider(slider: &Slider, axes: &[(&str, bool)]) -> Value {
    let mut data = json!(slider);
    data["words"] = label::words(&slider.name).into();
    data["unit"] = label::unit_of_name(&slider.name).into();
    data["value"] = slider.value.unwrap_or(slider.from).into();
    data["axis"] = slider.value.is_none().into();
    data["log"] = axes.iter().any(|(name, log)| *name == slider.name && *log).into();
    data
}
