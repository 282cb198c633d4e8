//! The washing machine's figures: of traces, modes, responses and attractors at constant speeds,
//! and the live part of pages.
//!
//! Figures that every model has are drawn by `sweep-plot`, which takes [`WasherFigures`] for the
//! others.

#![allow(missing_docs, reason = "private crate: a name that says enough needs no comment")]

mod campbell;
mod dwell;
mod kinds;
mod live;
mod machine;
mod passages;
mod plan_summary;
mod profiles;
mod shapes;
mod spectrum;
mod stability;
#[cfg(test)]
mod tests;
mod trace;
mod turn;

use std::path::PathBuf;

use serde_json::Value;
use sweep_plot::chart::Chart;
use sweep_plot::read::{FigureFile, FigureKind, ModelKinds};
use sweep_plot::table::FigureTable;
use sweep_plot::{Figures, LivePart, PlotError, PlotOptions};

pub use live::{Live, Slider};

use kinds::{DWELL, MODEL_KINDS, MODES, STABILITY};

/// A figure of a file that has several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum FigureView {
    /// Modes: natural frequencies over spin speed, and the resonances
    Frequencies,
    /// Modes: the variation of frequencies over a turn of the drum
    Variation,
    /// Modes: the mode shapes at the resonance speeds
    Shapes,
    /// Trace: motion over time
    Time,
    /// Trace: greatest deviation in each turn over spin speed, on the way up and down
    Passages,
    /// Curves of a fit: the cost beside each fitted number
    Profiles,
    /// Curves of a fit: the spectra of the measurement and of the residual
    Spectrum,
    /// Design: points over every pair of parameters, and the quantity over each
    Scatter,
    /// Design: the distribution of the quantity, and the share of reliable points
    Histogram,
    /// Design: the influence of each parameter on the quantity
    Influence,
    /// Stability: the growth of disturbances over constant speeds
    Growth,
    /// Stability: the periodic response of both models over constant speeds
    Responses,
    /// Dwell with `--sections`: states once a turn
    Sections,
}

impl FigureView {
    /// Returns the kind of file that the figure shows.
    const fn kind(self) -> FigureKind {
        match self {
            Self::Frequencies | Self::Variation | Self::Shapes => MODES,
            Self::Time | Self::Passages | Self::Profiles | Self::Spectrum => FigureKind::TRACE,
            Self::Scatter | Self::Histogram | Self::Influence => FigureKind::DESIGN,
            Self::Growth | Self::Responses => STABILITY,
            Self::Sections => DWELL,
        }
    }

    /// Returns the figure of designs in `sweep-plot`, if it is one.
    #[must_use]
    pub const fn design_view(self) -> Option<sweep_plot::DesignView> {
        match self {
            Self::Scatter => Some(sweep_plot::DesignView::Scatter),
            Self::Histogram => Some(sweep_plot::DesignView::Histogram),
            Self::Influence => Some(sweep_plot::DesignView::Influence),
            _ => None,
        }
    }
}

/// The options of a washing machine's figures. The default is the figure that fits the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WasherFigures {
    /// Modes, trace, stability, dwell: the figure; by default the first.
    pub view: Option<FigureView>,
    /// Trace, dwell, responses of a stability file: the channels shown.
    pub channels: Vec<String>,
    /// Trace: resonance speeds whose passages are marked, rpm.
    pub resonances_rpm: Vec<f64>,
    /// Trace: a modes file whose resonance speeds are marked too.
    pub modes: Option<PathBuf>,
    /// Trace, modes: a stability file, whose unstable speeds are shaded; a modes file also shows
    /// the sums of frequencies behind them.
    pub stability: Option<PathBuf>,
    /// Trace: another trace file, whose nonlinear model is drawn in place of the linear one. Dwell:
    /// a trace file whose run passes the held speeds.
    pub against: Option<PathBuf>,
    /// Map or design as a page: the live part.
    pub live: Option<Live>,
}

impl Figures for WasherFigures {
    fn model_kinds(&self) -> ModelKinds {
        MODEL_KINDS
    }

    fn check(&self, source: &FigureFile, is_page: bool) -> Result<(), PlotError> {
        let is_kind = |kind| source.kind == kind;
        let is_trace = is_kind(FigureKind::TRACE);
        let is_modes = is_kind(MODES);
        let is_dwell = is_kind(DWELL);
        let shows_frequencies =
            is_modes && matches!(self.view, None | Some(FigureView::Frequencies));
        let shows_time = is_trace && matches!(self.view, None | Some(FigureView::Time));
        let shows_channels =
            is_trace || is_dwell || is_kind(STABILITY) && self.view == Some(FigureView::Responses);
        let files_with_channels = "traces, dwells and responses of stability files (a map shows a \
                                   channel's column: --quantity ratio_tub_yaw)";
        source.reject_option(
            "--channel",
            !self.channels.is_empty(),
            shows_channels,
            files_with_channels,
        )?;
        source.reject_option(
            "--resonances",
            !self.resonances_rpm.is_empty(),
            is_trace,
            "traces",
        )?;
        source.reject_option("--modes", self.modes.is_some(), is_trace, "traces")?;
        let files_with_stability = "traces, and frequencies of modes files";
        source.reject_option(
            "--stability",
            self.stability.is_some(),
            is_trace || shows_frequencies,
            files_with_stability,
        )?;
        if let Some(kind) = self.view.map(FigureView::kind) {
            // Options of designs are checked by `sweep-plot`.
            let files = match kind {
                FigureKind::TRACE => "traces".to_owned(),
                kind => format!("{} files", kind.name),
            };
            source.reject_option("--view", true, is_kind(kind), &files)?;
        }
        let files_with_runs = "traces over time and dwell files";
        source.reject_option(
            "--against",
            self.against.is_some(),
            shows_time || is_dwell,
            files_with_runs,
        )?;
        let is_map = is_kind(FigureKind::MAP)
            || is_kind(FigureKind::DIFFERENCES)
            || is_kind(FigureKind::DESIGN);
        source.reject_option(
            "--live",
            self.live.is_some(),
            is_map && is_page,
            "maps drawn as .html",
        )
    }

    fn chart(
        &self,
        source: FigureFile,
        options: &PlotOptions,
    ) -> Result<(FigureFile, Chart), PlotError> {
        let fixed_values = &options.fixed_values;
        let speed_chart = match (source.kind, self.view) {
            (STABILITY, Some(FigureView::Responses)) => {
                Some(stability::response_chart(&source, fixed_values, self)?)
            }
            (STABILITY, _) => Some(stability::growth_chart(&source, fixed_values)?),
            (DWELL, Some(FigureView::Sections)) => {
                Some(dwell::section_chart(&source, fixed_values)?)
            }
            (DWELL, _) => Some(dwell::dwell_chart(&source, fixed_values, self)?),
            _ => None,
        };
        if let Some(chart) = speed_chart {
            return Ok((source, chart));
        }
        let table = FigureTable::read(source)?;
        let chart = match (table.source.kind, self.view) {
            (MODES, Some(FigureView::Variation)) => turn::variation_chart(&table)?,
            (MODES, Some(FigureView::Shapes)) => shapes::shape_chart(&table)?,
            (MODES, _) => campbell::campbell_chart(&table, self)?,
            (_, Some(FigureView::Passages)) => passages::passage_chart(&table, self)?,
            (_, Some(FigureView::Profiles)) => profiles::profile_chart(&table)?,
            (_, Some(FigureView::Spectrum)) => spectrum::spectrum_chart(&table)?,
            _ => trace::trace_chart(&table, self)?,
        };
        Ok((table.source, chart))
    }

    fn history(&self, trace: &FigureTable) -> Result<Chart, PlotError> {
        trace::trace_chart(trace, &Self::default())
    }

    fn plan_summary(&self, plan: &Value) -> Vec<(&'static str, String)> {
        plan_summary::plan_summary(plan)
    }

    fn tables(&self) -> String {
        self.live.as_ref().map_or_else(String::new, live::resonances)
    }

    fn cautions(&self) -> &'static [&'static str] {
        &["A map shows one course of speeds. Whether the machine may stay at a speed is another \
           question; the command sweep stability answers it."]
    }

    fn live_part(&self, axes: &[(&str, bool)]) -> Option<LivePart> {
        self.live.as_ref().map(|live| live::live_part(live, axes))
    }
}
