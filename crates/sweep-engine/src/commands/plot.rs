//! `plot`: the figure that fits a file.

use std::path::PathBuf;

use crate::config::written::finite;
use crate::exit::{Error, Exit, tell};
use sweep_files::beside;
use sweep_plot::{PlotOptions, View, render};

/// Arguments of `plot`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A result file
    #[arg(value_name = "FILE")]
    pub file: PathBuf,

    /// Where to write; the ending .svg, .png or .html says how [default: FILE with .svg]
    #[arg(short, long, visible_alias = "out", value_name = "IMAGE")]
    pub output: Option<PathBuf>,

    /// Modes, trace, design, stability: which of its figures [default: frequencies, time, scatter,
    /// growth]; a page of a design has all three
    #[arg(long, value_enum)]
    pub view: Option<View>,

    /// Map: the column that the colours show, or `status`; over one axis again for more of them.
    /// Design: the column over the parameters [default: ratio_max]
    #[arg(long, value_name = "COLUMN")]
    pub quantity: Vec<String>,

    /// Channel to show of a trace, of dwells or of responses, as in the column names; may be
    /// repeated
    #[arg(long = "channel", value_name = "NAME")]
    pub channels: Vec<String>,

    /// Map of three or more axes: cut an axis beyond the second at this value. Stability: show the
    /// points at this value
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    pub at: Vec<(String, f64)>,

    /// Map as .svg or .png: draw the line of this boundary file too
    #[arg(long, value_name = "FILE")]
    pub boundary: Option<PathBuf>,
}

/// Draws the figure and says where it is.
///
/// # Errors
/// As [`render`].
pub fn run(args: &Args) -> Result<Exit, Error> {
    draw(args, PlotOptions::default())
}

/// As [`run`], with further options.
///
/// # Errors
/// As [`render`].
pub fn draw(args: &Args, further: PlotOptions) -> Result<Exit, Error> {
    let output = args.output.clone().unwrap_or_else(|| beside(&args.file, "svg"));
    let options = PlotOptions {
        view: args.view,
        quantity: args.quantity.clone(),
        channels: args.channels.clone(),
        at: args.at.clone(),
        boundary: args.boundary.clone(),
        ..further
    };
    render(&args.file, &options, &output)?;
    tell(&format!("wrote {}", output.display()));
    Ok(Exit::Done)
}

fn assignment(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE, as in mass_kg=3.5")?;
    Ok((name.trim().to_owned(), finite(value)?))
}
