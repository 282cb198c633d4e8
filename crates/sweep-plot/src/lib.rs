//! Figures of result files (Parquet) as SVG, as PNG, or as one self-contained HTML page.
//!
//! The kind of a file follows from its columns. A map becomes a picture of cells, any other file a
//! chart of curves. Both are laid out as a scene of shapes and text, which is written as SVG or
//! PNG. A page carries the numbers instead, and a script that draws them. The same file and options
//! give the same bytes.

#![allow(missing_docs, reason = "private crate: a name that says enough needs no comment")]

mod axis;
mod bucket;
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
mod pdf;
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
pub mod together;

use std::path::{Path, PathBuf};

pub use axis::extremes;
pub use colour::{DISTINCT_COLOURS, FAILED_COLOUR, LINEAR_COLOUR, NONLINEAR_COLOUR};
pub use error::PlotError;
pub use html::{embed, html_table, printable_page};
pub use label::{capitalise, format_significant, name_in_words, quantity_in_words};
pub use model::{CommonFigures, Figures, LivePart};
pub use scene::{Colour, INK, MUTED_COLOUR};
pub use share::ShareInterval;
pub use svg::escape;

use chart::Chart;
use cuts::Cuts;
use error::Result;
use figures::boundary::Overlay;
use gather::CellMap;
use grid::Grid;
use read::{FigureFile, FigureKind};
use scatter::Scatter;
use scene::Scene;
use swept::SweptAxis;
use table::FigureTable;
use together::NamedPoint;

use sweep_files::{self as files, Output};

/// Image pixels per scene pixel in a PNG. Basis: sharp text on dense screens and in print. Doubling
/// it quadruples the pixels of the file.
const PNG_SCALE: f64 = 2.0;

/// A figure of a design; a file of another kind has none of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum DesignView {
    /// Design: points over every pair of parameters, and the quantity over each
    Scatter,
    /// Design: the distribution of the quantity, and the share of reliable points
    Histogram,
    /// Design: the influence of each parameter on the quantity
    Influence,
}

/// The options of a figure. The default is the figure that fits the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlotOptions {
    /// Designs: the figure; by default the scatter matrix.
    pub view: Option<DesignView>,
    /// Maps: the column that gives the colours; by default the greatest ratio, or `status`. Over
    /// one axis: the columns that are drawn. Designs: the column that depends on the parameters.
    pub quantity: Vec<String>,
    /// Maps of three axes or more: fixed values of axes beyond the second, by name. Other kinds
    /// whose rows belong to points: values of the points that are drawn.
    pub fixed_values: Vec<(String, f64)>,
    /// Maps as a picture: a boundary file over the same axes, whose curve is drawn too.
    pub boundary: Option<PathBuf>,
    /// Maps as a page: a folder of trace files. A click on a point with a trace shows its history.
    pub traces: Option<PathBuf>,
}

/// The format of a figure: SVG, PNG or HTML.
type Format = files::FileKind<'static>;

fn format_from_ending(path: &Path) -> Result<Format> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    match ending.to_ascii_lowercase().as_str() {
        "svg" => Ok(Format::Svg),
        "pdf" => Ok(Format::Pdf),
        "png" => Ok(Format::Png),
        "html" | "htm" => Ok(Format::Html),
        _ => Err(PlotError::Unfit(format!(
            "{}: the ending of a figure's name says its format: .svg, .pdf, .png or .html",
            path.display()
        ))),
    }
}

/// Draws the figure of `input` to `output`, whose ending (`.svg`, `.pdf`, `.png`, `.html`)
/// gives the format.
///
/// # Errors
/// Any [`PlotError`]: an unreadable file, options that do not fit it, an output that cannot be
/// written. The output's name and the options are checked before the output is touched.
pub fn render(
    input: &Path,
    options: &PlotOptions,
    model: &dyn Figures,
    output: &Path,
) -> Result<(), PlotError> {
    let format = format_from_ending(output)?;
    // This check comes first, so that a figure that cannot be drawn creates no folder.
    files::check_replaceable(output, format)?;
    let source = open_source(input, options, model)?;
    check_options(&source, options, format)?;
    model.check(&source, format == Format::Html)?;
    let mut bytes = draw_figure(source, options, model, format)?;
    if format == Format::Html {
        // The page shows this picture where scripts are switched off.
        let still_picture =
            draw_figure(open_source(input, options, model)?, options, model, Format::Png)?;
        bytes = html::add_still_picture(&bytes, &still_picture);
    }
    Ok(Output::begin(output, format)?.finish(&bytes)?)
}

/// Returns the SVG picture of a file and the summary of its plan, both as HTML.
///
/// # Errors
/// The errors of [`render`].
pub fn describe_as_html(input: &Path, model: &dyn Figures) -> Result<(String, String), PlotError> {
    let options = PlotOptions::default();
    let source = open_source(input, &options, model)?;
    let plan_summary = html::run_summary(&source, model);
    let svg = draw_figure(source, &options, model, Format::Svg)?;
    Ok((html::svg_image(&svg), plan_summary))
}

fn open_source(input: &Path, options: &PlotOptions, model: &dyn Figures) -> Result<FigureFile> {
    let mut source = FigureFile::open(input, model.model_kinds())?;
    if is_scattered(&source, options)? {
        source.kind = FigureKind::DESIGN;
    }
    Ok(source)
}

fn draw_figure(
    source: FigureFile,
    options: &PlotOptions,
    model: &dyn Figures,
    format: Format,
) -> Result<Vec<u8>> {
    let (source, chart) = match source.kind {
        FigureKind::MAP => return draw_map(source, options, model, format),
        FigureKind::DESIGN => return draw_design(source, options, model, format),
        FigureKind::DIFFERENCES => return draw_differences(source, options, model, format),
        FigureKind::STUDY => {
            let chart = figures::optimise::study_chart(&source)?;
            (source, chart)
        }
        FigureKind::BOUNDARY => {
            let table = FigureTable::read(source)?;
            let chart = figures::boundary::boundary_chart(&table)?;
            (table.source, chart)
        }
        _ => model.chart(source, options)?,
    };
    write_chart(&source, &chart, "", model, format)
}

/// Writes a chart, whose x axis may be the parameter `axis` (empty if it is none).
fn write_chart(
    source: &FigureFile,
    chart: &Chart,
    axis: &str,
    model: &dyn Figures,
    format: Format,
) -> Result<Vec<u8>> {
    match format {
        Format::Html => Ok(html::chart_page(source, chart, axis, model).into_bytes()),
        _ => encode_image(&chart::draw_chart(chart), format),
    }
}

/// Returns whether the rows of a map file are a design's points. A design that lists a whole grid,
/// or varies one parameter alone, is drawn as a map or as curves unless a figure of designs is
/// requested.
fn is_scattered(source: &FigureFile, options: &PlotOptions) -> Result<bool> {
    if source.kind != FigureKind::MAP || source.design_method().is_none() {
        return Ok(false);
    }
    Ok(options.view.is_some() || !swept::is_whole_grid(source)?)
}

fn draw_design(
    source: FigureFile,
    options: &PlotOptions,
    model: &dyn Figures,
    format: Format,
) -> Result<Vec<u8>> {
    let scatter = Scatter::read(source, options)?;
    if format == Format::Html {
        return Ok(html::design_page(&scatter, options, model).into_bytes());
    }
    let scene = match options.view {
        Some(DesignView::Histogram) => {
            chart::draw_chart(&figures::histogram::histogram_chart(&scatter))
        }
        Some(DesignView::Influence) => figures::influence::draw_influence(&scatter),
        _ => figures::matrix::draw_matrix(&scatter).0,
    };
    encode_image(&scene, format)
}

/// Maximum number of cells of a picture. Basis: a cell of a picture takes two or three pixels.
/// Doubling it makes cells smaller than a pixel.
const PICTURE_CELLS: usize = 1 << 17;

fn draw_map(
    source: FigureFile,
    options: &PlotOptions,
    model: &dyn Figures,
    format: Format,
) -> Result<Vec<u8>> {
    let axes = swept::read_axes(&source)?;
    if format != Format::Html && axes.len() > 1 {
        let shown_column = layer::requested_column(&source, options)?;
        let columns = shown_column
            .iter()
            .map(|shown_column| shown_column.name())
            .chain([layer::STATUS_COLUMN]);
        let columns: Vec<String> = columns.map(str::to_owned).collect();
        let cuts = Cuts::for_picture(&source, &axes, &options.fixed_values)?;
        let grid = Grid::new(&axes, &cuts.picked_indices, PICTURE_CELLS);
        let map = CellMap::read(source, grid, &columns)?;
        let overlay = options.boundary.as_ref();
        let overlay =
            overlay.map(|path| read_overlay(path, &axes, &map.table.source)).transpose()?;
        let scene =
            figures::map::draw_map_scene(&map, &cuts, shown_column.as_ref(), overlay.as_ref())?;
        return encode_image(&scene, format);
    }
    let columns = html::page_columns(&source, &axes);
    let cell_limit = html::max_cells(columns.len());
    let cuts = Cuts::for_page(&source, &axes, &options.fixed_values, cell_limit)?;
    let grid = Grid::new(&axes, &cuts.picked_indices, cell_limit);
    let map = CellMap::read(source, grid, &columns)?;
    if axes.len() == 1 {
        let chart = figures::curves::curves_chart(&map, options)?;
        return write_chart(&map.table.source, &chart, &axes[0].name, model, format);
    }
    Ok(html::map_page(&map, &cuts, options, model)?.into_bytes())
}

/// Reads the boundary file that is drawn over a map with these axes.
fn read_overlay(path: &Path, axes: &[SweptAxis], map: &FigureFile) -> Result<Overlay> {
    let source = FigureFile::open(path, map.model_kinds)?;
    source.expect_kind(
        FigureKind::BOUNDARY,
        "--boundary",
        "`sweep boundary` writes a boundary file",
    )?;
    let table = FigureTable::read(source)?;
    let overlay = figures::boundary::boundary_overlay(&table, [&axes[0].name, &axes[1].name])?;
    let axes_as_point: NamedPoint = axes.iter().map(|axis| (axis.name.clone(), 0.0)).collect();
    let files = [(map, &axes_as_point), (&table.source, &axes_as_point)];
    together::check_agreement(
        "--boundary",
        path,
        files,
        &figures::boundary::plan_sections(&table),
    )?;
    Ok(overlay)
}

/// Draws the differences between two maps as a picture.
fn draw_differences(
    source: FigureFile,
    options: &PlotOptions,
    model: &dyn Figures,
    format: Format,
) -> Result<Vec<u8>> {
    if format == Format::Html || swept::read_axes(&source)?.len() < 2 {
        let path = source.path.display();
        return Err(PlotError::Unfit(format!(
            "{path} is a differences file, which is drawn as .svg, .pdf or .png over two axes or \
             more"
        )));
    }
    draw_map(source, options, model, format)
}

fn encode_image(scene: &Scene, format: Format) -> Result<Vec<u8>> {
    match format {
        Format::Png => raster::write_png(scene, PNG_SCALE),
        Format::Pdf => Ok(pdf::write_pdf(scene)),
        _ => Ok(svg::write_svg(scene).into_bytes()),
    }
}

/// Rejects options that have no effect on this kind of file or this format.
fn check_options(source: &FigureFile, options: &PlotOptions, format: Format) -> Result<()> {
    let is_kind = |kind| source.kind == kind;
    let is_map = is_kind(FigureKind::MAP) || is_kind(FigureKind::DIFFERENCES);
    let is_design = is_kind(FigureKind::DESIGN);
    let is_page = format == Format::Html;
    let point_kinds = source.model_kinds.kinds.iter().filter(|kind| kind.has_points);
    let point_kinds: String = point_kinds.map(|kind| format!(", {} files", kind.name)).collect();
    let design_files = "designs: results of a grid file with [design]";
    source.reject_option(
        "--quantity",
        !options.quantity.is_empty(),
        is_map || is_design,
        "maps",
    )?;
    let has_fixed_values = !options.fixed_values.is_empty();
    source.reject_option(
        "--at",
        has_fixed_values,
        source.kind.has_points,
        &format!("maps{point_kinds}"),
    )?;
    let has_boundary = options.boundary.is_some();
    let has_traces = options.traces.is_some();
    source.reject_option(
        "--boundary",
        has_boundary,
        is_map && !is_page,
        "maps drawn as .svg, .pdf or .png",
    )?;
    source.reject_option("--view", options.view.is_some(), is_design, design_files)?;
    source.reject_option("--traces", has_traces, is_map && is_page, "maps drawn as .html")
}
