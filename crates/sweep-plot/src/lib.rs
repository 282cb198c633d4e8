//! Figures from this program's Parquet files: as SVG, as PNG, or as one HTML page that needs
//! nothing else.
//!
//! A file's columns show its kind. A map becomes a picture of cells, any other file a chart of
//! curves. Both are laid out as a scene of shapes and text, which is written as SVG or PNG. A page
//! carries the numbers instead, and a script that draws them. The same file and options give the
//! same bytes.

mod axis;
pub mod chart;
mod colour;
pub mod contour;
mod cuts;
mod decimate;
mod error;
mod figures;
mod frame;
mod gather;
mod grid;
mod html;
mod influence;
pub mod label;
mod layer;
mod model;
mod raster;
pub mod read;
mod region;
#[cfg(test)]
mod sample;
mod scatter;
mod scene;
mod share;
mod svg;
pub mod swept;
pub mod table;
#[cfg(test)]
mod tests;
mod thin;
pub mod together;

use std::path::{Path, PathBuf};

pub use axis::extremes;
pub use colour::{DISTINCT, FAILED, LINEAR, NONLINEAR};
pub use error::PlotError;
pub use html::{embed, sheet, table};
pub use label::{capitalised, quantity, significant, words};
pub use model::{CommonFigures, Computing, Figures};
pub use scene::{Colour, INK, MUTED};
pub use share::Share;
pub use svg::escape;

use chart::Chart;
use cuts::Cuts;
use error::Result;
use figures::boundary::Overlay;
use gather::Map;
use grid::Grid;
use read::{Kind, Source};
use scatter::Scatter;
use scene::Scene;
use swept::SweptAxis;
use table::Table;
use together::At;

use sweep_files::{self as files, Output};

/// Image pixels to a scene pixel in a PNG: sharp on dense screens and in print.
const PNG_SCALE: f64 = 2.0;

/// Which figure of a design.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum View {
    /// Design: points over every pair of parameters, and the quantity over each
    Scatter,
    /// Design: how the quantity is distributed, and the share of reliable points
    Histogram,
    /// Design: how much the quantity depends on each parameter
    Influence,
}

/// What to show; the default is the figure that fits the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Design: which figure; by default the first.
    pub view: Option<View>,
    /// Map: the column that the colours are, by default the greatest ratio, or `status`; over one
    /// axis the columns that are drawn. Design: the column that depends on the parameters.
    pub quantity: Vec<String>,
    /// Map of three or more axes: where to cut an axis beyond the second, by name and value. Kinds
    /// with points: values of those that are shown.
    pub at: Vec<(String, f64)>,
    /// Map as a picture: a boundary file over the same axes, whose line is drawn too.
    pub boundary: Option<PathBuf>,
    /// Map as a page: a folder of trace files; clicking a point that has one shows it.
    pub traces: Option<PathBuf>,
}

/// How a figure is written, and what it may be written over.
type Format = files::FileKind<'static>;

fn format_of(path: &Path) -> Result<Format> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    match ending.to_ascii_lowercase().as_str() {
        "svg" => Ok(Format::Svg),
        "png" => Ok(Format::Png),
        "html" | "htm" => Ok(Format::Html),
        _ => Err(PlotError::Unfit(format!(
            "{}: the figure's format goes by its name's ending: .svg, .png or .html",
            path.display()
        ))),
    }
}

/// Draws the figure that fits `input` to `output`, whose ending (`.svg`, `.png`, `.html`) says how.
///
/// # Errors
/// Any [`PlotError`]: an unreadable file, options that do not fit it, an output that cannot be
/// written. The output's name and the options are judged before the output is touched.
pub fn render(
    input: &Path,
    options: &Options,
    model: &dyn Figures,
    output: &Path,
) -> Result<(), PlotError> {
    let format = format_of(output)?;
    // A figure that cannot be drawn makes no folder.
    files::judge(output, format)?;
    let source = opened(input, options, model)?;
    check_options(&source, options, format)?;
    model.check(&source, format == Format::Html)?;
    let mut bytes = figure(source, options, model, format)?;
    if format == Format::Html {
        // What the page shows where scripts are switched off.
        let still = figure(opened(input, options, model)?, options, model, Format::Png)?;
        bytes = html::with_still(&bytes, &still);
    }
    Ok(Output::begin(output, format)?.finish(&bytes)?)
}

/// A file's figure as an SVG picture of its own, and what its plan says in words, both HTML.
///
/// # Errors
/// As [`render`].
pub fn described(input: &Path, model: &dyn Figures) -> Result<(String, String), PlotError> {
    let options = Options::default();
    let source = opened(input, &options, model)?;
    let told = html::told(&source, model);
    let svg = figure(source, &options, model, Format::Svg)?;
    Ok((html::picture(&svg), told))
}

fn opened(input: &Path, options: &Options, model: &dyn Figures) -> Result<Source> {
    let mut source = Source::open(input, model.known())?;
    if is_scattered(&source, options)? {
        source.kind = Kind::DESIGN;
    }
    Ok(source)
}

fn figure(
    source: Source,
    options: &Options,
    model: &dyn Figures,
    format: Format,
) -> Result<Vec<u8>> {
    let (source, chart) = match source.kind {
        Kind::MAP => return map(source, options, model, format),
        Kind::DESIGN => return design(source, options, model, format),
        Kind::DIFFERENCES => return differences(source, options, model, format),
        Kind::STUDY => {
            let chart = figures::optimise::chart(&source)?;
            (source, chart)
        }
        Kind::BOUNDARY => {
            let table = Table::read(source)?;
            let chart = figures::boundary::chart(&table)?;
            (table.source, chart)
        }
        _ => model.chart(source, options)?,
    };
    written(&source, &chart, "", model, format)
}

/// A chart of a file; over a parameter of this name, if that is an axis.
fn written(
    source: &Source,
    chart: &Chart,
    axis: &str,
    model: &dyn Figures,
    format: Format,
) -> Result<Vec<u8>> {
    match format {
        Format::Html => Ok(html::chart_page(source, chart, axis, model).into_bytes()),
        _ => image(&chart::draw(chart), format),
    }
}

/// Whether a map file's points are a design's. One that lists a whole grid, or spreads points over
/// a single parameter, has a map or curves unless a figure of designs is asked for.
fn is_scattered(source: &Source, options: &Options) -> Result<bool> {
    if source.kind != Kind::MAP || source.design_method().is_none() {
        return Ok(false);
    }
    Ok(options.view.is_some() || !swept::is_whole(source)?)
}

fn design(
    source: Source,
    options: &Options,
    model: &dyn Figures,
    format: Format,
) -> Result<Vec<u8>> {
    let scatter = Scatter::read(source, options)?;
    if format == Format::Html {
        return Ok(html::design_page(&scatter, options, model).into_bytes());
    }
    let scene = match options.view {
        Some(View::Histogram) => chart::draw(&figures::histogram::chart(&scatter)),
        Some(View::Influence) => figures::influence::draw(&scatter),
        _ => figures::matrix::draw(&scatter).0,
    };
    image(&scene, format)
}

/// Most cells of a picture: two pixels or three to each.
const PICTURE_CELLS: usize = 1 << 17;

fn map(source: Source, options: &Options, model: &dyn Figures, format: Format) -> Result<Vec<u8>> {
    let axes = swept::axes(&source)?;
    if format != Format::Html && axes.len() > 1 {
        let shown = layer::chosen(&source, options)?;
        let columns = shown.iter().map(|shown| shown.column()).chain([layer::STATUS]);
        let columns: Vec<String> = columns.map(str::to_owned).collect();
        let cuts = Cuts::of_picture(&source, &axes, &options.at)?;
        let grid = Grid::new(&axes, &cuts.picks, PICTURE_CELLS);
        let map = Map::read(source, grid, &columns)?;
        let overlay = options.boundary.as_ref();
        let overlay = overlay.map(|path| overlay_of(path, &axes, &map.table.source)).transpose()?;
        let scene = figures::map::draw(&map, &cuts, shown.as_ref(), overlay.as_ref())?;
        return image(&scene, format);
    }
    let columns = html::carried(&source, &axes);
    let most = html::most_cells(columns.len());
    let cuts = Cuts::of_page(&source, &axes, &options.at, most)?;
    let grid = Grid::new(&axes, &cuts.picks, most);
    let map = Map::read(source, grid, &columns)?;
    if axes.len() == 1 {
        let chart = figures::curves::chart(&map, options)?;
        return written(&map.table.source, &chart, &axes[0].name, model, format);
    }
    Ok(html::map_page(&map, &cuts, options, model)?.into_bytes())
}

/// The boundary file beside a map of these axes.
fn overlay_of(path: &Path, axes: &[SweptAxis], map: &Source) -> Result<Overlay> {
    let source = Source::open(path, map.known)?;
    source.expect(Kind::BOUNDARY, "--boundary", "`sweep boundary` writes a boundary file")?;
    let table = Table::read(source)?;
    let line = figures::boundary::overlay(&table, [&axes[0].name, &axes[1].name])?;
    let moved: At = axes.iter().map(|axis| (axis.name.clone(), 0.0)).collect();
    let files = [(map, &moved), (&table.source, &moved)];
    together::agree("--boundary", path, files, &figures::boundary::follows_from(&table))?;
    Ok(line)
}

/// A picture of what differs between two maps.
fn differences(
    source: Source,
    options: &Options,
    model: &dyn Figures,
    format: Format,
) -> Result<Vec<u8>> {
    if format == Format::Html || swept::axes(&source)?.len() < 2 {
        let path = source.path.display();
        return Err(PlotError::Unfit(format!(
            "{path} is a differences file, which is drawn as .svg or .png over two axes or more"
        )));
    }
    map(source, options, model, format)
}

fn image(scene: &Scene, format: Format) -> Result<Vec<u8>> {
    match format {
        Format::Png => raster::write(scene, PNG_SCALE),
        _ => Ok(svg::write(scene).into_bytes()),
    }
}

/// Refuses options that the file's kind or the output's format would leave without effect.
fn check_options(source: &Source, options: &Options, format: Format) -> Result<()> {
    let is = |kind| source.kind == kind;
    let (map, design) = (is(Kind::MAP) || is(Kind::DIFFERENCES), is(Kind::DESIGN));
    let is_page = format == Format::Html;
    let with_points = source.known.kinds.iter().filter(|kind| kind.has_points);
    let with_points: String = with_points.map(|kind| format!(", {} files", kind.name)).collect();
    let designs = "designs: results of a grid file with [design]";
    source.refuse("--quantity", !options.quantity.is_empty(), map || design, "maps")?;
    let at = !options.at.is_empty();
    source.refuse("--at", at, source.kind.has_points, &format!("maps{with_points}"))?;
    let (boundary, traces) = (options.boundary.is_some(), options.traces.is_some());
    source.refuse("--boundary", boundary, map && !is_page, "maps drawn as .svg or .png")?;
    source.refuse("--view", options.view.is_some(), design, designs)?;
    source.refuse("--traces", traces, map && is_page, "maps drawn as .html")
}
