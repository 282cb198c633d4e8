//! Draws the figure of a result file without a model or the command:
//! `cargo run -p sweep-plot --example draw -- FILE.parquet FIGURE.svg`.

use std::error::Error;
use std::path::PathBuf;

use sweep_plot::{CommonFigures, PlotOptions, render};

fn main() -> Result<(), Box<dyn Error>> {
    let mut files = std::env::args_os().skip(1).map(PathBuf::from);
    let (Some(input), Some(output), None) = (files.next(), files.next(), files.next()) else {
        return Err("usage: draw FILE.parquet FIGURE.svg|.png|.html".into());
    };
    render(&input, &PlotOptions::default(), &CommonFigures, &output)?;
    Ok(())
}
