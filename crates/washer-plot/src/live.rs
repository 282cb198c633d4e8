//! The live part of a page: the WebAssembly module, its setup and the sliders.

use serde_json::{Value, json};
use sweep_plot::{LivePart, embed, html_table, label};

/// The module of `crates/washer-live`, compressed by gzip; `scripts/release/build_live.sh` makes
/// it.
const COMPRESSED_MODULE: &[u8] = include_bytes!("../assets/live.wasm.gz");

/// The scripts of the live part.
const SCRIPTS: &[&str] = &[
    include_str!("html/spectrum.js"),
    include_str!("html/pool.js"),
    include_str!("html/curves.js"),
    include_str!("html/growth.js"),
    include_str!("html/live.js"),
];

/// The templates of elements, and the script of the page's workers.
const ELEMENT_TEMPLATES: &str = concat!(
    include_str!("html/parts.html"),
    "<script type=\"text/plain\" id=\"worker\">",
    include_str!("html/worker.js"),
    "</script>\n"
);

/// The data of the live part of a page, in addition to the module that every live page has.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Live {
    /// The setup of the module, encoded by `washer-live`.
    #[serde(skip)]
    pub setup: Vec<f64>,
    /// The parameters that can be moved, axes of the map first.
    #[serde(skip)]
    pub sliders: Vec<Slider>,
    /// The time between two instants of a history (s).
    pub every_s: f64,
    /// The end of a run (s).
    pub end_s: f64,
    /// The window in which amplitudes are taken (s).
    pub window_s: [f64; 2],
    /// The channels in the order of the module's records.
    pub channels: Vec<String>,
    /// The indices of the channels that the verdict compares.
    #[serde(rename = "compared")]
    pub compared_channels: Vec<usize>,
    /// The words for an amplitude and for a ratio.
    #[serde(rename = "criterion")]
    pub criterion_words: [String; 2],
    /// The columns of each model's metrics in the order of the module's records.
    pub metrics: Vec<[String; 2]>,
    /// Whether the map has the static sag.
    pub has_static_sag: bool,
    /// The constant speeds (rpm) at which metrics of the map are taken; empty without such metrics.
    pub held_speeds_rpm: Vec<f64>,
    /// The metrics at these speeds: `growth`, `dwell`.
    pub held_metrics: Vec<String>,
    /// Whether the growth at a constant speed takes long to compute, as with friction or stops.
    pub has_slow_growth: bool,
    /// The kinds of attractors in the module's order, in words.
    #[serde(rename = "motions")]
    pub attractor_kinds: Vec<String>,
    /// The ways in which a response can lose its stability, in the module's order; empty for a
    /// machine whose stability cannot be computed.
    #[serde(rename = "kinds")]
    pub instability_kinds: Vec<String>,
    /// The names of the refinement levels in the module's order.
    pub levels: Vec<String>,
    /// The largest relative error of a checked amplitude.
    pub accuracy: f64,
    /// The upper limit of reliable ratios.
    pub ratio_limit: f64,
    /// The lower limit of reliable ratios, if the plan has one.
    pub ratio_min: Option<f64>,
    /// The refinement levels of the nonlinear and of the linear model, in words.
    #[serde(rename = "rungs")]
    pub level_words: [Vec<String>; 2],
    /// The version of the program that chose the refinement levels.
    pub version: String,
    /// The resonances of the linear model: motion, speed with its unit, damping ratio.
    #[serde(skip)]
    pub resonances: Vec<[String; 3]>,
}

/// A parameter that a page can move.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Slider {
    /// The name in grid files.
    pub name: String,
    /// The meaning, as a phrase.
    pub description: String,
    pub from: f64,
    pub to: f64,
    /// The map's own value; `None` for an axis.
    pub value: Option<f64>,
}

/// Returns the live part of a page over these axes, given by name and whether they are logarithmic.
pub(crate) fn live_part(live: &Live, axes: &[(&str, bool)]) -> LivePart {
    let channel = |name: &String| {
        let (unit, factor) = label::display_unit(label::unit_of_channel(name));
        let words = label::channel_in_words(name);
        json!({ "name": name, "words": words, "unit": unit, "factor": factor })
    };
    let mut data = json!(live);
    data["module"] = embed::encode_bytes(COMPRESSED_MODULE.iter().copied()).into();
    data["setup"] = embed::encode_doubles(&live.setup).into();
    data["sliders"] = live.sliders.iter().map(|parameter| slider_json(parameter, axes)).collect();
    data["channels"] = live.channels.iter().map(channel).collect();
    data["metrics"] = live.metrics.iter().map(metric_json).collect();
    for (key, names) in [("kinds", &live.instability_kinds), ("motions", &live.attractor_kinds)] {
        data[key] = names.iter().map(|name| name.replace('_', " ")).collect();
    }
    LivePart { data, scripts: SCRIPTS, templates: ELEMENT_TEMPLATES }
}

/// Writes the table of the machine's resonances in HTML.
pub(crate) fn resonances(live: &Live) -> String {
    let rows: Vec<_> = live.resonances.iter().cloned().map(Vec::from).collect();
    let headings = ["Motion", "Resonance", "Damping ratio"];
    html_table("Resonances at the middle of the map", &headings, &rows)
}

fn metric_json(columns: &[String; 2]) -> Value {
    let unit = label::unit_of_name(&columns[0]);
    let (unit, factor) = label::display_unit(&unit);
    let words = label::quantity_in_words(&columns[0]);
    json!({ "columns": columns, "words": words, "unit": unit, "factor": factor })
}

fn slider_json(slider: &Slider, axes: &[(&str, bool)]) -> Value {
    let mut data = json!(slider);
    data["words"] = label::name_in_words(&slider.name).into();
    data["unit"] = label::unit_of_name(&slider.name).into();
    data["value"] = slider.value.unwrap_or(slider.from).into();
    data["axis"] = slider.value.is_none().into();
    data["log"] = axes.iter().any(|(name, is_log)| *name == slider.name && *is_log).into();
    data
}
