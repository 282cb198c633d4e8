//! The washing machine's figures: of its traces, modes, responses and motions at constant speeds,
//! and the page that computes with its models.
//!
//! What every model's files have is drawn by `sweep-plot`, which takes [`WasherFigures`] for the
//! rest.

mod campbell;
mod dwell;
mod kinds;
mod live;
mod machine;
mod passages;
mod profiles;
mod shapes;
mod spectrum;
mod stability;
#[cfg(test)]
mod tests;
mod told;
mod trace;
mod turn;

use std::path::PathBuf;

use serde_json::Value;
use sweep_plot::chart::Chart;
use sweep_plot::read::{Kind, Known, Source};
use sweep_plot::table::Table;
use sweep_plot::{Computing, Figures, Options, PlotError};

pub use live::{Live, Slider};

use kinds::{DWELL, KNOWN, MODES, STABILITY};

/// Which figure of a file that has several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum View {
    /// Modes: natural frequencies over spin speed, and where they meet it
    Frequencies,
    /// Modes: how far frequencies vary over a turn of the drum
    Variation,
    /// Modes: what moves at each resonance speed
    Shapes,
    /// Trace: motion over time
    Time,
    /// Trace: greatest deviation in each turn over spin speed, on the way up and down
    Passages,
    /// Curves of a fit: how the cost rises beside each fitted number
    Profiles,
    /// Curves of a fit: what was measured and what is left over, by frequency
    Spectrum,
    /// Design: points over every pair of parameters, and the quantity over each
    Scatter,
    /// Design: how the quantity is distributed, and the share of reliable points
    Histogram,
    /// Design: how much the quantity depends on each parameter
    Influence,
    /// Stability: how fast disturbances grow over constant speeds
    Growth,
    /// Stability: the periodic response of both models over constant speeds
    Responses,
    /// Dwell with `--sections`: states once a turn
    Sections,
}

impl View {
    /// The kind of file that it is a figure of.
    const fn of(self) -> Kind {
        match self {
            Self::Frequencies | Self::Variation | Self::Shapes => MODES,
            Self::Time | Self::Passages | Self::Profiles | Self::Spectrum => Kind::TRACE,
            Self::Scatter | Self::Histogram | Self::Influence => Kind::DESIGN,
            Self::Growth | Self::Responses => STABILITY,
            Self::Sections => DWELL,
        }
    }

    /// As a figure of every model's files, if it is one.
    #[must_use]
    pub const fn common(self) -> Option<sweep_plot::View> {
        match self {
            Self::Scatter => Some(sweep_plot::View::Scatter),
            Self::Histogram => Some(sweep_plot::View::Histogram),
            Self::Influence => Some(sweep_plot::View::Influence),
            _ => None,
        }
    }
}

/// What to show of a washing machine's files; the default is the figure that fits the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WasherFigures {
    /// Modes, trace, stability, dwell: which figure; by default the first.
    pub view: Option<View>,
    /// Trace, dwell, responses of a stability file: the channels shown.
    pub channels: Vec<String>,
    /// Trace: resonance speeds whose passages are marked, rpm.
    pub resonances_rpm: Vec<f64>,
    /// Trace: a modes file whose resonance speeds are marked too.
    pub modes: Option<PathBuf>,
    /// Trace, modes: a stability file, whose unstable speeds are shaded; in modes, the sums of
    /// frequencies behind them are drawn too.
    pub stability: Option<PathBuf>,
    /// Trace: another trace file, whose nonlinear model is drawn in place of the linear one. Dwell:
    /// a trace file whose run passes over the held speeds.
    pub against: Option<PathBuf>,
    /// Map or design as a page: what it computes with.
    pub live: Option<Live>,
}

impl Figures for WasherFigures {
    fn known(&self) -> Known {
        KNOWN
    }

    fn check(&self, source: &Source, is_page: bool) -> Result<(), PlotError> {
        let is = |kind| source.kind == kind;
        let (trace, modes, dwell) = (is(Kind::TRACE), is(MODES), is(DWELL));
        let over_modes = modes && matches!(self.view, None | Some(View::Frequencies));
        let over_time = trace && matches!(self.view, None | Some(View::Time));
        let moving = trace || dwell || is(STABILITY) && self.view == Some(View::Responses);
        let moving_are = "traces, dwells and responses of stability files (a map shows a channel's \
                          column: --quantity ratio_tub_yaw)";
        source.refuse("--channel", !self.channels.is_empty(), moving, moving_are)?;
        source.refuse("--resonances", !self.resonances_rpm.is_empty(), trace, "traces")?;
        source.refuse("--modes", self.modes.is_some(), trace, "traces")?;
        let machines = "traces, and frequencies of modes files";
        source.refuse("--stability", self.stability.is_some(), trace || over_modes, machines)?;
        if let Some(kind) = self.view.map(View::of) {
            // Those of designs have been judged as every model's.
            let files = match kind {
                Kind::TRACE => "traces".to_owned(),
                other => format!("{} files", other.name),
            };
            source.refuse("--view", true, is(kind), &files)?;
        }
        let over_runs = "traces over time and dwell files";
        source.refuse("--against", self.against.is_some(), over_time || dwell, over_runs)?;
        let map = is(Kind::MAP) || is(Kind::DIFFERENCES) || is(Kind::DESIGN);
        source.refuse("--live", self.live.is_some(), map && is_page, "maps drawn as .html")
    }

    fn chart(&self, source: Source, options: &Options) -> Result<(Source, Chart), PlotError> {
        let at = &options.at;
        let of_rows = match (source.kind, self.view) {
            (STABILITY, Some(View::Responses)) => Some(stability::responses(&source, at, self)?),
            (STABILITY, _) => Some(stability::growth(&source, at)?),
            (DWELL, Some(View::Sections)) => Some(dwell::sections(&source, at)?),
            (DWELL, _) => Some(dwell::chart(&source, at, self)?),
            _ => None,
        };
        if let Some(chart) = of_rows {
            return Ok((source, chart));
        }
        let table = Table::read(source)?;
        let chart = match (table.source.kind, self.view) {
            (MODES, Some(View::Variation)) => turn::chart(&table)?,
            (MODES, Some(View::Shapes)) => shapes::chart(&table)?,
            (MODES, _) => campbell::chart(&table, self)?,
            (_, Some(View::Passages)) => passages::chart(&table, self)?,
            (_, Some(View::Profiles)) => profiles::chart(&table)?,
            (_, Some(View::Spectrum)) => spectrum::chart(&table)?,
            _ => trace::chart(&table, self)?,
        };
        Ok((table.source, chart))
    }

    fn history(&self, trace: &Table) -> Result<Chart, PlotError> {
        trace::chart(trace, &Self::default())
    }

    fn told(&self, plan: &Value) -> Vec<(&'static str, String)> {
        told::told(plan)
    }

    fn tables(&self) -> String {
        self.live.as_ref().map_or_else(String::new, live::resonances)
    }

    fn caveats(&self) -> &'static [&'static str] {
        &["A map shows one course of speeds. Whether the machine may stay at a speed is another \
           question; the command sweep stability answers it."]
    }

    fn computing(&self, axes: &[(&str, bool)]) -> Option<Computing> {
        self.live.as_ref().map(|live| live::computing(live, axes))
    }
}
