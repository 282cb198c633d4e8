//! `sweep plot` draws the figure that fits a file.

use std::path::PathBuf;

use crate::live::{SliderRange, build_live_part, parse_slider_range};
use sweep_engine::commands::plot;
use sweep_engine::config::arguments::parse_finite;
use sweep_engine::{Error, Exit};
use sweep_plot::PlotOptions;
use washer_plot::{FigureView, WasherFigures};

/// Arguments of `sweep plot`.
#[derive(Debug, clap::Args)]
pub struct WasherPlotArgs {
    #[command(flatten)]
    plot: plot::PlotArgs<FigureView>,

    /// Channel to show of a trace, of dwells or of responses, as in the column names; may be
    /// repeated
    #[arg(long = "channel", value_name = "NAME")]
    pub channels: Vec<String>,

    /// Trace: mark where these speeds are passed, in rpm, separated by commas
    #[arg(long, value_name = "RPM,...", value_delimiter = ',', value_parser = parse_positive_speed)]
    #[arg(allow_negative_numbers = true)]
    pub resonances: Vec<f64>,

    /// Trace: mark where the resonance speeds of this modes file are passed
    #[arg(long, value_name = "FILE")]
    pub modes: Option<PathBuf>,

    /// Trace, modes: shade the unstable speeds of this stability file
    #[arg(long, value_name = "FILE")]
    pub stability: Option<PathBuf>,

    /// Trace: compare the nonlinear model of both files, without the linear one. Dwell: add the
    /// amplitudes of this trace, whose run passes the held speeds
    #[arg(long, value_name = "FILE")]
    pub against: Option<PathBuf>,

    /// Map as .html: a page with both models, which computes any point by sliders, without a
    /// network
    #[arg(long)]
    pub live: bool,

    /// With --live: a slider for this parameter; may be repeated [default: a usual choice]
    #[arg(long = "slider", value_name = "NAME=FROM:TO", requires = "live")]
    #[arg(value_parser = parse_slider_range)]
    pub sliders: Vec<SliderRange>,

    /// Map as .html: folder of trace files; clicking a point that has one shows its time histories
    #[arg(long, value_name = "FOLDER")]
    pub traces: Option<PathBuf>,
}

/// Draws the figure and prints its path.
///
/// # Errors
/// Returns the errors of the engine's command, and an error for a map that no page can compute.
pub(crate) fn run(args: &WasherPlotArgs) -> Result<Exit, Error> {
    let live_part =
        args.live.then(|| build_live_part(&args.plot.file, &args.sliders)).transpose()?;
    let figures = WasherFigures {
        view: args.plot.view,
        channels: args.channels.clone(),
        resonances_rpm: args.resonances.clone(),
        modes: args.modes.clone(),
        stability: args.stability.clone(),
        against: args.against.clone(),
        live: live_part,
    };
    let options = PlotOptions {
        view: args.plot.view.and_then(FigureView::design_view),
        traces: args.traces.clone(),
        ..PlotOptions::default()
    };
    plot::draw(&args.plot, options, &figures)
}

fn parse_positive_speed(text: &str) -> Result<f64, String> {
    let speed = parse_finite(text)?;
    if speed > 0.0 { Ok(speed) } else { Err("expected a speed above 0 rpm".to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct WasherCli {
        #[command(flatten)]
        plot: WasherPlotArgs,
    }

    fn parse_line(line: &str) -> Result<WasherPlotArgs, String> {
        let words = std::iter::once("plot").chain(line.split(' '));
        WasherCli::try_parse_from(words).map(|cli| cli.plot).map_err(|error| error.to_string())
    }

    #[test]
    fn options_are_read_as_documented() {
        let args = parse_line(
            "m.parquet --quantity min_gap_linear_m --at spin_peak_rpm=350 --resonances 99.9,147.6 \
             --channel a --channel b",
        );
        let args = args.unwrap();
        assert_eq!(args.plot.quantity, ["min_gap_linear_m"]);
        assert_eq!(args.plot.at, [("spin_peak_rpm".to_owned(), 350.0)]);
        assert_eq!(args.resonances, [99.9, 147.6]);
        assert_eq!(args.channels, ["a", "b"]);
    }

    #[test]
    fn an_error_for_a_wrong_number_names_the_expected_one() {
        for (line, expected) in [
            ("m.parquet --at spin_peak_rpm", "expected NAME=VALUE"),
            ("m.parquet --at x=nan", "`nan` is not a finite number"),
            ("m.parquet --resonances -3", "expected a speed above 0 rpm"),
            ("m.parquet --resonances 0", "expected a speed above 0 rpm"),
        ] {
            let message = parse_line(line).unwrap_err();
            assert!(message.contains(expected), "{line}: {message}");
        }
    }
}
