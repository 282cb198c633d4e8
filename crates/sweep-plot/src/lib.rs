//! Figures from this program's Parquet files: as SVG, as PNG, or as one HTML page that needs
//! nothing else.
//!
//! A file's columns show its kind. A map becomes a picture of cells, any other file a chart of
//! curves. Both are laid out as a scene of shapes and text, which is written as SVG or PNG. A page
//! carries the numbers instead, and a script that draws them. The same file and options give the
//! same bytes.

mod axis;
mod chart;
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
mod label;
mod layer;
mod raster;
mod read;
mod region;
#[cfg(test)]
mod sample;
mod scatter;
mod scene;
mod share;
mod svg;
mod swept;
mod table;
#[cfg(test)]
mod tests;
mod thin;
mod together;

use std::path::{Path, PathBuf};

pub use error::PlotError;
pub use html::{sheet, table};
pub use label::{capitalised, quantity, significant, words};
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
            Self::Frequencies | Self::Variation | Self::Shapes => Kind::Modes,
            Self::Time | Self::Passages | Self::Profiles | Self::Spectrum => Kind::Trace,
            Self::Scatter | Self::Histogram | Self::Influence => Kind::Design,
            Self::Growth | Self::Responses => Kind::Stability,
            Self::Sections => Kind::Dwell,
        }
    }
}

/// What to show; the default is the figure that fits the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlotOptions {
    /// Modes, trace, design, stability: which figure; by default the first.
    pub view: Option<View>,
    /// Map: the column that the colours are, by default the greatest ratio, or `status`; over one
    /// axis the columns that are drawn. Design: the column that depends on the parameters.
    pub quantity: Vec<String>,
    /// Trace, dwell, responses of a stability file: the channels shown.
    pub channels: Vec<String>,
    /// Map of three or more axes: where to cut an axis beyond the second, by name and value.
    /// Stability: values of the points that are shown.
    pub at: Vec<(String, f64)>,
    /// Trace: resonance speeds whose passages are marked, rpm.
    pub resonances_rpm: Vec<f64>,
    /// Trace: a modes file whose resonance speeds are marked too.
    pub modes: Option<PathBuf>,
    /// Trace, modes: a stability file, whose unstable speeds are shaded; in modes, the sums of
    /// frequencies behind them are drawn too.
    pub stability: Option<PathBuf>,
    /// Map as a picture: a boundary file over the same axes, whose line is drawn too.
    pub boundary: Option<PathBuf>,
    /// Trace: another trace file, whose nonlinear model is drawn in place of the linear one. Dwell:
    /// a trace file whose run passes over the held speeds.
    pub against: Option<PathBuf>,
    /// Map as a page: a folder of trace files; clicking a point that has one shows it.
    pub traces: Option<PathBuf>,
    /// Map or design as a page: what it computes with.
    pub live: Option<Live>,
}

/// What a page computes with, beside the module that every such page has.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Live {
    /// What the module is set up with, in its own terms.
    #[serde(skip)]
    pub setup: Vec<f64>,
    /// What can be moved, the map's axes first.
    #[serde(skip)]
    pub sliders: Vec<Slider>,
    /// Time between two instants of a history (s).
    pub every_s: f64,
    /// The end of the run (s).
    pub end_s: f64,
    /// When amplitudes are taken (s).
    pub window_s: [f64; 2],
    /// The channels of the module's records, in their order.
    pub channels: Vec<String>,
    /// Those that the verdict compares, by their places.
    pub compared: Vec<usize>,
    /// What an amplitude is, and a ratio.
    pub criterion: [String; 2],
    /// The columns of each model's metrics in the module's records, in their order.
    pub metrics: Vec<[String; 2]>,
    /// Whether the map has the static sag.
    pub has_static_sag: bool,
    /// The constant speeds (rpm) that the map's growth is about; none if it has none.
    pub growth_speeds_rpm: Vec<f64>,
    /// Whether a constant speed takes long: with friction or stops.
    pub has_slow_growth: bool,
    /// What the map has and a page does not compute, in a sentence; empty if there is nothing.
    pub left_out: String,
    /// Ways in which a response at a constant speed can lose its stability, in the module's order;
    /// none where that cannot be asked of the machine.
    pub kinds: Vec<String>,
    /// Names of the levels that the module counts.
    pub levels: Vec<String>,
    /// Largest error of a checked amplitude, relative.
    pub accuracy: f64,
    /// Ratios below it are reliable.
    pub ratio_limit: f64,
    /// And above this, if it is asked for.
    pub ratio_min: Option<f64>,
    /// The rungs of the nonlinear and of the linear model, in words.
    pub rungs: [Vec<String>; 2],
    /// The version of the program that chose the rungs.
    pub version: String,
    /// Resonances of the linear model: motion, speed with its unit, damping ratio.
    #[serde(skip)]
    pub resonances: Vec<[String; 3]>,
}

/// A parameter that a page can move.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Slider {
    /// As in grid files.
    pub name: String,
    /// In a phrase.
    pub description: String,
    /// The least value.
    pub from: f64,
    /// The greatest value.
    pub to: f64,
    /// The map's own value; none of an axis.
    pub value: Option<f64>,
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
pub fn render(input: &Path, options: &PlotOptions, output: &Path) -> Result<(), PlotError> {
    let format = format_of(output)?;
    // A figure that cannot be drawn makes no folder.
    files::judge(output, format)?;
    let mut bytes = figure(input, options, format)?;
    if format == Format::Html {
        // What the page shows where scripts are switched off.
        let options = PlotOptions { traces: None, live: None, ..options.clone() };
        let still = figure(input, &options, Format::Png)?;
        bytes = html::with_still(&bytes, &still);
    }
    Ok(Output::begin(output, format)?.finish(&bytes)?)
}

/// A file's figure as an SVG picture of its own, and what its plan says in words, both HTML.
///
/// # Errors
/// As [`render`].
pub fn described(input: &Path) -> Result<(String, String), PlotError> {
    let svg = figure(input, &PlotOptions::default(), Format::Svg)?;
    Ok((html::picture(&svg), html::told(&Source::open(input)?, None)))
}

fn figure(input: &Path, options: &PlotOptions, format: Format) -> Result<Vec<u8>> {
    let mut source = Source::open(input)?;
    if is_scattered(&source, options)? {
        source.kind = Kind::Design;
    }
    check_options(&source, options, format)?;
    match source.kind {
        Kind::Map => map(source, options, format),
        Kind::Design => design(source, options, format),
        Kind::Differences => differences(source, options, format),
        _ => curves(source, options, format),
    }
}

/// Whether a map file's points are a design's. One that lists a whole grid, or spreads points over
/// a single parameter, has a map or curves unless a figure of designs is asked for.
fn is_scattered(source: &Source, options: &PlotOptions) -> Result<bool> {
    if source.kind != Kind::Map || source.design_method().is_none() {
        return Ok(false);
    }
    match options.view {
        Some(view) => Ok(view.of() == Kind::Design),
        None => Ok(!swept::is_whole(source)?),
    }
}

fn design(source: Source, options: &PlotOptions, format: Format) -> Result<Vec<u8>> {
    let scatter = Scatter::read(source, options)?;
    if format == Format::Html {
        return Ok(html::design_page(&scatter, options).into_bytes());
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

fn map(source: Source, options: &PlotOptions, format: Format) -> Result<Vec<u8>> {
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
        return written((&map.table.source, &chart), options, format);
    }
    Ok(html::map_page(&map, &cuts, options)?.into_bytes())
}

/// The boundary file beside a map of these axes.
fn overlay_of(path: &Path, axes: &[SweptAxis], map: &Source) -> Result<Overlay> {
    let source = Source::open(path)?;
    source.expect(Kind::Boundary, "--boundary", "`sweep boundary` writes a boundary file")?;
    let table = Table::read(source)?;
    let line = figures::boundary::overlay(&table, [&axes[0].name, &axes[1].name])?;
    let moved: At = axes.iter().map(|axis| (axis.name.clone(), 0.0)).collect();
    let files = [(map, &moved), (&table.source, &moved)];
    together::agree("--boundary", path, files, figures::boundary::follows_from(&table))?;
    Ok(line)
}

/// A picture of what differs between two maps.
fn differences(source: Source, options: &PlotOptions, format: Format) -> Result<Vec<u8>> {
    if format == Format::Html || swept::axes(&source)?.len() < 2 {
        let path = source.path.display();
        return Err(PlotError::Unfit(format!(
            "{path} is a differences file, which is drawn as .svg or .png over two axes or more"
        )));
    }
    map(source, options, format)
}

/// A file's curves.
fn curves(source: Source, options: &PlotOptions, format: Format) -> Result<Vec<u8>> {
    use figures::{boundary, campbell, dwell, optimise, passages, profiles};
    use figures::{shapes, spectrum, stability, trace, turn};
    let of_rows = match (source.kind, options.view) {
        (Kind::Optimise, _) => Some(optimise::chart(&source)?),
        (Kind::Stability, Some(View::Responses)) => Some(stability::responses(&source, options)?),
        (Kind::Stability, _) => Some(stability::growth(&source, options)?),
        (Kind::Dwell, Some(View::Sections)) => Some(dwell::sections(&source, options)?),
        (Kind::Dwell, _) => Some(dwell::chart(&source, options)?),
        _ => None,
    };
    if let Some(chart) = of_rows {
        return written((&source, &chart), options, format);
    }
    let table = &Table::read(source)?;
    let chart = match (table.source.kind, options.view) {
        (Kind::Trace, Some(View::Passages)) => passages::chart(table, options)?,
        (Kind::Trace, Some(View::Profiles)) => profiles::chart(table)?,
        (Kind::Trace, Some(View::Spectrum)) => spectrum::chart(table)?,
        (Kind::Trace, _) => trace::chart(table, options)?,
        (Kind::Modes, Some(View::Variation)) => turn::chart(table)?,
        (Kind::Modes, Some(View::Shapes)) => shapes::chart(table)?,
        (Kind::Modes, _) => campbell::chart(table, options)?,
        _ => boundary::chart(table)?,
    };
    written((&table.source, &chart), options, format)
}

fn written(
    (source, chart): (&Source, &Chart),
    options: &PlotOptions,
    format: Format,
) -> Result<Vec<u8>> {
    match format {
        Format::Html => Ok(html::chart_page(source, chart, options.live.as_ref()).into_bytes()),
        _ => image(&chart::draw(chart), format),
    }
}

fn image(scene: &Scene, format: Format) -> Result<Vec<u8>> {
    match format {
        Format::Png => raster::write(scene, PNG_SCALE),
        _ => Ok(svg::write(scene).into_bytes()),
    }
}

/// Refuses options that the file's kind or the output's format would leave without effect.
fn check_options(source: &Source, options: &PlotOptions, format: Format) -> Result<()> {
    let refuse = |option: &str, given: bool, fits: bool, for_what: &str| {
        if !given || fits {
            return Ok(());
        }
        let (kind, path) = (source.kind.name(), source.path.display());
        Err(PlotError::Unfit(format!("`{option}` is for {for_what}; {path} is a {kind} file")))
    };
    let is = |kind| source.kind == kind;
    let (map, design) = (is(Kind::Map) || is(Kind::Differences), is(Kind::Design));
    let (trace, modes) = (is(Kind::Trace), is(Kind::Modes));
    let (stability, dwell) = (is(Kind::Stability), is(Kind::Dwell));
    let over_modes = modes && matches!(options.view, None | Some(View::Frequencies));
    let over_time = trace && matches!(options.view, None | Some(View::Time));
    let (at, channels) = (!options.at.is_empty(), !options.channels.is_empty());
    let moving = trace || dwell || stability && options.view == Some(View::Responses);
    let moving_are = "traces, dwells and responses of stability files (a map shows a channel's \
                      column: --quantity ratio_tub_yaw)";
    let is_page = format == Format::Html;
    refuse("--quantity", !options.quantity.is_empty(), map || design, "maps")?;
    refuse("--channel", channels, moving, moving_are)?;
    refuse("--at", at, map || stability || dwell, "maps, stability and dwell files")?;
    refuse("--resonances", !options.resonances_rpm.is_empty(), trace, "traces")?;
    refuse("--modes", options.modes.is_some(), trace, "traces")?;
    let machines = "traces, and frequencies of modes files";
    refuse("--stability", options.stability.is_some(), trace || over_modes, machines)?;
    let pictures = "maps drawn as .svg or .png";
    refuse("--boundary", options.boundary.is_some(), map && !is_page, pictures)?;
    if let Some(kind) = options.view.map(View::of) {
        let files = match kind {
            Kind::Trace => "traces".to_owned(),
            Kind::Design => "designs: results of a grid file with [design]".to_owned(),
            other => format!("{} files", other.name()),
        };
        refuse("--view", true, kind == source.kind, &files)?;
    }
    let over_runs = "traces over time and dwell files";
    refuse("--against", options.against.is_some(), over_time || dwell, over_runs)?;
    let pages = "maps drawn as .html";
    refuse("--live", options.live.is_some(), (map || design) && is_page, pages)?;
    refuse("--traces", options.traces.is_some(), map && is_page, pages)
}
