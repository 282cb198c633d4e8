//! `sweep plot`: the figure that fits a file.

use std::path::{Path, PathBuf};

use super::examples::Examples;
use crate::exit::{Error, Exit, tell};
use crate::live::{SliderRange, live, slider_range};
use sweep_files::beside;
use sweep_plot::{PlotOptions, Quantity, View, render};

/// Shown by `--help`.
pub(super) const EXAMPLES: Examples = &[
    ["sweep plot results/first.parquet", "results/first.svg: ratios, and the line of the limit"],
    ["sweep plot results/first.parquet -o map.html", "a page to point and click in"],
    ["sweep plot results/first.parquet -o map.html --live", "one that computes any point itself"],
    [
        "sweep plot results/first.parquet --quantity nonlinear --channel tub_yaw",
        "one channel's amplitude",
    ],
    ["sweep plot results/design.parquet --view influence", "which parameters of a design matter"],
];

/// Arguments of `sweep plot`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Result of `sweep run`, `trace`, `modes`, `boundary` or `stability`
    #[arg(value_name = "FILE")]
    pub file: PathBuf,

    /// Where to write; the ending .svg, .png or .html says how [default: FILE with .svg]
    #[arg(short, long, visible_alias = "out", value_name = "IMAGE")]
    pub output: Option<PathBuf>,

    /// Modes, trace, design, stability: which of its figures [default: frequencies, time, scatter,
    /// growth]; a page of a design has all three
    #[arg(long, value_enum)]
    pub view: Option<View>,

    /// Map: what the colours show. Design: what is shown over the parameters
    #[arg(long, value_enum, default_value_t)]
    pub quantity: Quantity,

    /// Channel to show, as in the column names (tub_yaw, drum_front_y, ...); of a load, which stop
    /// or foot (stop_2, foot_1); again for more of them in a trace
    #[arg(long = "channel", value_name = "NAME")]
    pub channels: Vec<String>,

    /// Map of three or more axes: cut an axis beyond the second at this value. Stability: show the
    /// points at this value
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    pub at: Vec<(String, f64)>,

    /// Trace: mark where these speeds are passed, in rpm, separated by commas
    #[arg(
        long,
        value_name = "RPM,...",
        value_delimiter = ',',
        allow_negative_numbers = true,
        value_parser = speed
    )]
    pub resonances: Vec<f64>,

    /// Trace: mark where the resonance speeds of this modes file are passed
    #[arg(long, value_name = "FILE")]
    pub modes: Option<PathBuf>,

    /// Trace, modes: shade the unstable speeds of this stability file
    #[arg(long, value_name = "FILE")]
    pub stability: Option<PathBuf>,

    /// Map as .svg or .png: draw the line of this boundary file too
    #[arg(long, value_name = "FILE")]
    pub boundary: Option<PathBuf>,

    /// Trace: compare with this trace: both nonlinear models, the linear one left out
    #[arg(long, value_name = "FILE")]
    pub against: Option<PathBuf>,

    /// Map as .html: a page that computes, with both models in it: any point by sliders, without a
    /// network
    #[arg(long)]
    pub live: bool,

    /// With --live: a slider for this parameter; may be repeated [default: a usual choice]
    #[arg(
        long = "slider",
        value_name = "NAME=FROM:TO",
        requires = "live",
        value_parser = slider_range
    )]
    pub sliders: Vec<SliderRange>,

    /// Map as .html: folder of trace files; clicking a point that has one shows its time histories
    #[arg(long, value_name = "FOLDER")]
    pub traces: Option<PathBuf>,
}

/// Draws the figure and says where it is.
///
/// # Errors
/// As [`render`].
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let output = args.output.clone().unwrap_or_else(|| default_output(&args.file));
    let mut options = PlotOptions {
        view: args.view,
        quantity: args.quantity,
        channels: args.channels.clone(),
        at: args.at.clone(),
        resonances_rpm: args.resonances.clone(),
        modes: args.modes.clone(),
        stability: args.stability.clone(),
        boundary: args.boundary.clone(),
        against: args.against.clone(),
        traces: args.traces.clone(),
        live: None,
    };
    if args.live {
        options.live = Some(live(&args.file, &args.sliders)?);
    }
    render(&args.file, &options, &output)?;
    tell(&format!("wrote {}", output.display()));
    Ok(Exit::Done)
}

/// Beside the input, under its name.
fn default_output(file: &Path) -> PathBuf {
    beside(file, "svg")
}

fn assignment(text: &str) -> Result<(String, f64), String> {
    let (name, value) =
        text.split_once('=').ok_or("expected NAME=VALUE, as in spin_peak_rpm=350")?;
    Ok((name.trim().to_owned(), finite(value)?))
}

fn speed(text: &str) -> Result<f64, String> {
    let speed = finite(text)?;
    if speed > 0.0 { Ok(speed) } else { Err("expected a speed above 0 rpm".to_owned()) }
}

fn finite(text: &str) -> Result<f64, String> {
    text.trim()
        .parse::<f64>()
        .ok()
        .filter(|value| value.is_finite())
        .ok_or_else(|| format!("`{}` is not a finite number", text.trim()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        plot: Args,
    }

    fn parse(line: &str) -> Result<Args, String> {
        let words = std::iter::once("plot").chain(line.split(' '));
        Cli::try_parse_from(words).map(|cli| cli.plot).map_err(|error| error.to_string())
    }

    #[test]
    fn options_are_read_as_documented() {
        let args = parse(
            "m.parquet --quantity gap-linear --at spin_peak_rpm=350 --resonances 99.9,147.6 \
             --channel a --channel b",
        );
        let args = args.unwrap();
        assert_eq!(args.quantity, Quantity::GapLinear);
        assert_eq!(args.at, [("spin_peak_rpm".to_owned(), 350.0)]);
        assert_eq!(args.resonances, [99.9, 147.6]);
        assert_eq!(args.channels, ["a", "b"]);
        assert_eq!(default_output(&args.file), Path::new("m.svg"));
    }

    #[test]
    fn numbers_that_are_none_are_refused_with_what_was_expected() {
        for (line, said) in [
            ("m.parquet --at spin_peak_rpm", "expected NAME=VALUE"),
            ("m.parquet --at x=nan", "`nan` is not a finite number"),
            ("m.parquet --resonances -3", "expected a speed above 0 rpm"),
            ("m.parquet --resonances 0", "expected a speed above 0 rpm"),
            ("m.parquet --quantity gapp", "gap-nonlinear"),
        ] {
            let message = parse(line).unwrap_err();
            assert!(message.contains(said), "{line}: {message}");
        }
    }
}
