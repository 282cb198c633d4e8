//! `plot`: draws a figure of a file.

use std::path::PathBuf;

use clap::ValueEnum;

use crate::config::arguments::parse_finite;
use crate::exit::{Error, Exit, tell};
use crate::store::refuse_unfinished;
use sweep_files::path_beside;
use sweep_plot::{CommonFigures, DesignView, Figures, PlotError, PlotOptions, render};
use sweep_results::nearest_name;

/// The arguments of `plot` for a model with these views.
#[derive(Debug, clap::Args)]
pub struct PlotArgs<V: ValueEnum + Send + Sync + 'static = DesignView> {
    /// A result file
    #[arg(value_name = "FILE")]
    pub file: PathBuf,

    /// Figure to write; its extension .svg, .pdf, .png or .html selects the format [default: FILE
    /// with .svg]
    #[arg(short, long, visible_alias = "out", value_name = "IMAGE")]
    pub output: Option<PathBuf>,

    /// Figure to draw, if a file has several [default: the first]; a page of a design has all three
    #[arg(long, value_enum)]
    pub view: Option<V>,

    /// Map: the column that the colours show, or `status`; over a single axis it may be repeated.
    /// Design: the column over the parameters [default: ratio_max]
    #[arg(long, value_name = "COLUMN")]
    pub quantity: Vec<String>,

    /// Map of three or more axes: cut an axis beyond the second at this value. Other files: show
    /// only the points at this value
    #[arg(long, value_name = "NAME=VALUE", value_parser = parse_assignment)]
    pub at: Vec<(String, f64)>,

    /// Map as .svg, .pdf or .png: draw the line of this boundary file too
    #[arg(long, value_name = "FILE")]
    pub boundary: Option<PathBuf>,
}

/// Draws the figure, and prints its path.
///
/// # Errors
/// The errors of [`render`], and a result that is not finished.
pub fn run(args: &PlotArgs) -> Result<Exit, Error> {
    draw(args, PlotOptions { view: args.view, ..PlotOptions::default() }, &CommonFigures)
}

/// Draws the figure with further options of a model and its own figures, and prints its path.
///
/// # Errors
/// The errors of [`render`], and a result that is not finished.
pub fn draw<V: ValueEnum + Send + Sync>(
    args: &PlotArgs<V>,
    model_options: PlotOptions,
    model: &dyn Figures,
) -> Result<Exit, Error> {
    let output = args.output.clone().unwrap_or_else(|| path_beside(&args.file, "svg"));
    let options = PlotOptions {
        quantity: args.quantity.clone(),
        fixed_values: args.at.clone(),
        boundary: args.boundary.clone(),
        ..model_options
    };
    refuse_unfinished(&args.file)?;
    render(&args.file, &options, model, &output).map_err(suggest_name)?;
    tell(&format!("wrote {}", output.display()));
    Ok(Exit::Done)
}

/// Adds the nearest valid name to the error about an unknown one.
fn suggest_name(error: PlotError) -> PlotError {
    let PlotError::NotThere { message, requested_name, valid_names } = &error else { return error };
    match nearest_name(requested_name, valid_names.iter().map(String::as_str)) {
        Some(nearest_name) => {
            PlotError::Unfit(format!("{message}\n  = help: is `{nearest_name}` meant?"))
        }
        None => error,
    }
}

fn parse_assignment(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE, as in mass_kg=3.5")?;
    Ok((name.trim().to_owned(), parse_finite(value)?))
}
