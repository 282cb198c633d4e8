//! What a page computes with: the module, its setup and the sliders.

use serde_json::{Value, json};
use sweep_plot::{Computing, embed, label, table};

/// The module of `crates/washer-live`, packed by gzip; `scripts/release/build_live.sh` makes it.
const MODULE: &[u8] = include_bytes!("../assets/live.wasm.gz");

const SCRIPTS: &[&str] = &[
    include_str!("html/spectrum.js"),
    include_str!("html/pool.js"),
    include_str!("html/curves.js"),
    include_str!("html/growth.js"),
    include_str!("html/live.js"),
];

/// Templates, and what the page's workers run.
const PARTS: &str = concat!(
    include_str!("html/parts.html"),
    "<script type=\"text/plain\" id=\"worker\">",
    include_str!("html/worker.js"),
    "</script>\n"
);

/// What a page computes with, beside the module that every such page has.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Live {
    /// What the module is set up with, in its own terms.
    #[serde(skip)]
    pub setup: Vec<f64>,
    /// What can be moved, the map's axes first.
    #[serde(skip)]
    pub sliders: Vec<Slider>,
    /// Time between two instants of a history (s).
    pub every_s: f64,
    /// The end of the run (s).
    pub end_s: f64,
    /// When amplitudes are taken (s).
    pub window_s: [f64; 2],
    /// The channels of the module's records, in their order.
    pub channels: Vec<String>,
    /// Those that the verdict compares, by their places.
    pub compared: Vec<usize>,
    /// What an amplitude is, and a ratio.
    pub criterion: [String; 2],
    /// The columns of each model's metrics in the module's records, in their order.
    pub metrics: Vec<[String; 2]>,
    /// Whether the map has the static sag.
    pub has_static_sag: bool,
    /// The constant speeds (rpm) that metrics of the map are about; none if it has none of these.
    pub held_speeds_rpm: Vec<f64>,
    /// These metrics: `growth`, `dwell`.
    pub held_metrics: Vec<String>,
    /// Whether the growth at a constant speed takes long: with friction or stops.
    pub has_slow_growth: bool,
    /// What motions that a held speed ends in are, in the module's order.
    pub motions: Vec<String>,
    /// Ways in which a response at a constant speed can lose its stability, in the module's order;
    /// none where that cannot be asked of the machine.
    pub kinds: Vec<String>,
    /// Names of the levels that the module counts.
    pub levels: Vec<String>,
    /// Largest error of a checked amplitude, relative.
    pub accuracy: f64,
    /// Ratios below it are reliable.
    pub ratio_limit: f64,
    /// And above this, if it is asked for.
    pub ratio_min: Option<f64>,
    /// The rungs of the nonlinear and of the linear model, in words.
    pub rungs: [Vec<String>; 2],
    /// The version of the program that chose the rungs.
    pub version: String,
    /// Resonances of the linear model: motion, speed with its unit, damping ratio.
    #[serde(skip)]
    pub resonances: Vec<[String; 3]>,
}

/// A parameter that a page can move.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Slider {
    /// As in grid files.
    pub name: String,
    /// In a phrase.
    pub description: String,
    /// The least value.
    pub from: f64,
    /// The greatest value.
    pub to: f64,
    /// The map's own value; none of an axis.
    pub value: Option<f64>,
}

/// What a page computes with. The axes by name, and whether they are logarithmic.
pub(crate) fn computing(live: &Live, axes: &[(&str, bool)]) -> Computing {
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
    for (key, names) in [("kinds", &live.kinds), ("motions", &live.motions)] {
        data[key] = names.iter().map(|name| name.replace('_', " ")).collect();
    }
    Computing { data, scripts: SCRIPTS, parts: PARTS }
}

/// The resonances of the machine, in HTML.
pub(crate) fn resonances(live: &Live) -> String {
    let rows: Vec<_> = live.resonances.iter().cloned().map(Vec::from).collect();
    let heads = ["Motion", "Resonance", "Damping ratio"];
    table("Resonances at the middle of the map", &heads, &rows)
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
