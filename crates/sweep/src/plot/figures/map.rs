//! The map over the first two axes, with the line that divides it (the paper's Fig. 12).

use std::collections::BTreeMap;

use crate::plot::axis::Scale;
use crate::plot::colour::{ColourScale, DISTINCT, LEVELS};
use crate::plot::contour::zero_lines;
use crate::plot::error::PlotError;
use crate::plot::frame::{
    HEADING_HEIGHT, LABEL_SIZE, LEGEND_ROW, Panel, Sign, TICK_SIZE, failed, heading, legend, legend_rows,
    undefined,
};
use crate::plot::grid::Grid;
use crate::plot::label;
use crate::plot::layer::{Layer, Level, layer};
use crate::plot::raster::Typeface;
use crate::plot::read::Table;
use crate::plot::region::roomiest;
use crate::plot::scene::{Anchor, Colour, INK, Outline, PAPER, Scene, Stroke, Text};
use crate::plot::{PlotOptions, Quantity};

const WIDTH: f64 = 880.0;
/// Left of a panel: numbers and label of the y axis.
const LEFT: f64 = 86.0;
/// Right of the panels: the colour bar with its numbers and label.
const RIGHT: f64 = 128.0;
/// Below a panel: numbers and label of the x axis.
const BELOW: f64 = 64.0;
/// Most values of a third axis that are drawn side by side.
const MOST_PANELS: usize = 9;

/// Draws a map file of two or more axes.
///
/// Over two axes it is one panel. A third axis becomes one panel for each of its values (at most nine, evenly picked);
/// an axis beyond the second that is pinned by `--at`, and every one from the fourth on, is cut at one value (its first
/// unless pinned), which the subtitle names.
///
/// # Errors
/// As [`layer`] and [`Slices::of`].
pub(crate) fn draw(
    table: &Table,
    grid: &Grid,
    options: &PlotOptions,
    typeface: &Typeface,
) -> Result<Scene, PlotError> {
    let slices = Slices::of(table, grid, options)?;
    let cells = if options.quantity == Quantity::Status {
        if !options.channels.is_empty() {
            layer(table, options)?;
        }
        Cells::by_status(table)
    } else {
        Cells::by_value(table, layer(table, options)?)
    };

    let columns = match slices.panels.len() {
        1 => 1,
        2..=4 => 2,
        _ => 3,
    };
    let rows = slices.panels.len().div_ceil(columns);
    let single = slices.panels.len() == 1;
    let bar = if cells.layer.is_some() { RIGHT } else { 24.0 };
    let (gap, head) = if single { (0.0, 0.0) } else { (22.0, 26.0) };
    let width = (WIDTH - LEFT - bar - gap * (columns - 1) as f64) / columns as f64;
    let height = if single { 440.0 } else { 0.78 * width };
    let entries = cells.legend(&slices, grid);
    let legend_height = LEGEND_ROW * legend_rows(typeface, &entries, WIDTH - LEFT - 20.0) as f64;
    let panels_height = rows as f64 * (height + head) + gap * (rows - 1) as f64;
    let total = HEADING_HEIGHT + panels_height + BELOW + legend_height + 14.0;

    let [x_axis, y_axis] = [&grid.axes[0], &grid.axes[1]];
    let described = format!("{}: {} over {}", cells.title, y_axis.label(), x_axis.label());
    let mut scene = Scene::new(WIDTH, total, described);
    heading(&mut scene, typeface, &cells.title, &subtitle(table, &slices));
    let scale = |borders: &[f64], log| Scale { log, from: borders[0], to: borders[borders.len() - 1] };
    let borders = [x_axis.borders(), y_axis.borders()];
    for (index, slice) in slices.panels.iter().enumerate() {
        let (column, row) = (index % columns, index / columns);
        let panel = Panel {
            x: LEFT + column as f64 * (width + gap),
            y: HEADING_HEIGHT + head + row as f64 * (height + head + gap),
            width,
            height,
            xs: scale(&borders[0], x_axis.log),
            ys: scale(&borders[1], y_axis.log),
        };
        cells.draw(&mut scene, &panel, grid, &borders, &slice.rest);
        if let Some(level) = cells.layer.as_ref().and_then(|layer| layer.level.as_ref()) {
            cells.draw_line(&mut scene, &panel, grid, &slice.rest, level);
            cells.name_regions(&mut scene, typeface, &panel, grid, &borders, &slice.rest, level);
        }
        let lowest = index + columns >= slices.panels.len();
        panel.frame(&mut scene, lowest, column == 0);
        if let Some(name) = &slice.name {
            let at = [panel.x + width / 2.0, panel.y - 8.0];
            scene.text(Text::new(name.clone(), at, TICK_SIZE).bold().anchor(Anchor::Middle));
        }
        if lowest {
            panel.x_label(&mut scene, &x_axis.label());
        }
        if column == 0 {
            panel.y_label(&mut scene, typeface, &y_axis.label(), 60.0);
        }
    }
    if let Some(layer) = &cells.layer {
        let area = [WIDTH - RIGHT + 20.0, HEADING_HEIGHT + head, 22.0, panels_height - head];
        colour_bar(&mut scene, layer, area);
    }
    let y = HEADING_HEIGHT + panels_height + BELOW + LEGEND_ROW / 2.0;
    legend(&mut scene, typeface, &entries, LEFT, y, WIDTH - LEFT - 20.0);
    Ok(scene)
}

/// Which cuts through the grid are shown.
pub(crate) struct Slices {
    panels: Vec<Slice>,
    /// What is fixed or left out, in words.
    notes: Vec<String>,
}

struct Slice {
    /// Place on each axis after the second.
    rest: Vec<usize>,
    name: Option<String>,
}

impl Slices {
    /// The cuts that the options ask for.
    ///
    /// # Errors
    /// [`PlotError::NotThere`] when `--at` names no axis beyond the second, or a value that its axis does not have.
    pub(crate) fn of(table: &Table, grid: &Grid, options: &PlotOptions) -> Result<Self, PlotError> {
        let extra = grid.axes.get(2..).unwrap_or_default();
        let mut pinned: Vec<Option<usize>> = vec![None; extra.len()];
        for (name, value) in &options.at {
            let missing = |what, known: String| PlotError::NotThere {
                option: "--at",
                given: format!("{name}={value}"),
                path: table.path.clone(),
                what,
                known,
            };
            let place = extra.iter().position(|axis| axis.name == *name).ok_or_else(|| {
                let known: Vec<&str> = extra.iter().map(|axis| axis.name.as_str()).collect();
                let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                missing("axis beyond the second", known)
            })?;
            let near = |known: f64| (known - value).abs() <= 1e-9 * value.abs().max(known.abs());
            pinned[place] =
                Some(extra[place].values.iter().position(|&known| near(known)).ok_or_else(|| {
                    let known: Vec<String> =
                        extra[place].values.iter().map(|&v| label::significant(v, 6)).collect();
                    missing("value of that axis", known.join(", "))
                })?);
        }
        let mut notes = Vec::new();
        for (axis, pin) in extra.iter().zip(&pinned).enumerate().filter_map(|(k, (axis, pin))| {
            // The third axis becomes panels unless it is pinned.
            (k > 0 || pin.is_some()).then_some((axis, pin))
        }) {
            notes.push(axis.said(pin.unwrap_or(0)));
        }
        let rest = |third: usize| {
            let mut rest: Vec<usize> = pinned.iter().map(|pin| pin.unwrap_or(0)).collect();
            if let Some(first) = rest.first_mut() {
                *first = third;
            }
            rest
        };
        let panels = match (extra.first(), pinned.first().copied().flatten()) {
            (None, _) => vec![Slice { rest: Vec::new(), name: None }],
            (Some(_), Some(pin)) => vec![Slice { rest: rest(pin), name: None }],
            (Some(axis), None) => {
                let count = axis.values.len();
                let shown = count.min(MOST_PANELS);
                if shown < count {
                    notes.push(format!("{shown} of {count} values of {}", axis.words.to_lowercase()));
                }
                let pick =
                    |k: usize| if shown == 1 { 0 } else { (k * (count - 1) + (shown - 1) / 2) / (shown - 1) };
                (0..shown).map(pick).map(|k| Slice { rest: rest(k), name: Some(axis.said(k)) }).collect()
            }
        };
        Ok(Self { panels, notes })
    }

    /// Place of the first cut on each axis after the second.
    pub(crate) fn first(&self) -> &[usize] {
        self.panels.first().map_or(&[], |slice| &slice.rest)
    }
}

/// Name of the run, count of points and failures, and where the map is cut.
fn subtitle(table: &Table, slices: &Slices) -> String {
    let mut parts = vec![counts(table)];
    parts.extend(slices.notes.iter().cloned());
    parts.join(" · ")
}

/// Name of the run, and how many points it has and how many failed.
pub(crate) fn counts(table: &Table) -> String {
    let mut parts: Vec<String> = table.run_name().map(str::to_owned).into_iter().collect();
    parts.push(format!("{} points", table.rows));
    let failed = table.statuses().filter(|status| *status != "ok").count();
    if failed > 0 {
        parts.push(format!("{failed} failed"));
    }
    parts.join(" · ")
}

/// What is drawn in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fill {
    Level(usize),
    Kind(usize),
    Failed,
    Undefined,
}

/// How each row is drawn.
struct Cells {
    title: String,
    fills: Vec<Fill>,
    layer: Option<Layer>,
    /// The kinds of [`Fill::Kind`].
    kinds: Vec<String>,
}

impl Cells {
    fn by_value(table: &Table, layer: Layer) -> Self {
        let fills = layer
            .values
            .iter()
            .zip(table.statuses())
            .map(|(value, status)| match (value.is_finite(), status) {
                (true, _) => Fill::Level(layer.scale.level(*value)),
                (false, "ok") => Fill::Undefined,
                (false, _) => Fill::Failed,
            })
            .collect();
        Self { title: layer.title.clone(), fills, layer: Some(layer), kinds: Vec::new() }
    }

    fn by_status(table: &Table) -> Self {
        let mut kinds: Vec<String> = table.statuses().map(str::to_owned).collect();
        kinds.sort_by_key(|kind| (kind != "ok", kind.clone()));
        kinds.dedup();
        let fills = table
            .statuses()
            .map(|status| Fill::Kind(kinds.iter().position(|kind| kind == status).unwrap_or_default()))
            .collect();
        Self { title: "How each point ended".to_owned(), fills, layer: None, kinds }
    }

    fn kind_colour(&self, kind: usize) -> Colour {
        if self.kinds[kind] == "ok" { Colour::hex(0xe8ebee) } else { DISTINCT[kind % DISTINCT.len()] }
    }

    fn draw(&self, scene: &mut Scene, panel: &Panel, grid: &Grid, borders: &[Vec<f64>; 2], rest: &[usize]) {
        // Cells of one colour are one shape, and runs of them along y one rectangle: small files, no seams.
        let mut shapes: BTreeMap<Fill, Outline> = BTreeMap::new();
        let mut lone: Vec<[f64; 4]> = Vec::new();
        let ys: Vec<f64> = borders[1].iter().map(|&border| panel.at_y(border)).collect();
        for (x, pair) in borders[0].windows(2).enumerate() {
            let (left, right) = (panel.at_x(pair[0]), panel.at_x(pair[1]));
            let mut y = 0;
            while y + 1 < ys.len() {
                let fill = |y: usize| grid.row(x, y, rest).map(|row| self.fills[row]);
                let here = fill(y);
                let start = y;
                y += 1;
                while here != Some(Fill::Undefined) && y + 1 < ys.len() && fill(y) == here {
                    y += 1;
                }
                match here {
                    Some(Fill::Undefined) => lone.push([left, ys[y], right - left, ys[start] - ys[y]]),
                    Some(fill) => {
                        let shape = shapes.entry(fill).or_default();
                        shape.add_rectangle(left, ys[y], right - left, ys[start] - ys[y]);
                    }
                    None => {}
                }
            }
        }
        for (fill, shape) in shapes {
            match (fill, &self.layer) {
                (Fill::Level(level), Some(layer)) => scene.fill_crisp(shape, layer.scale.colour(level)),
                (Fill::Kind(kind), _) => scene.fill_crisp(shape, self.kind_colour(kind)),
                _ => failed(scene, shape),
            }
        }
        if !lone.is_empty() {
            undefined(scene, &lone);
        }
    }

    fn value(&self, row: Option<usize>) -> f64 {
        match (row, &self.layer) {
            (Some(row), Some(layer)) => layer.values[row],
            _ => f64::NAN,
        }
    }

    fn draw_line(&self, scene: &mut Scene, panel: &Panel, grid: &Grid, rest: &[usize], level: &Level) {
        let lines = zero_lines(&grid.axes[0].even(), &grid.axes[1].even(), |x, y| {
            level.offset(self.value(grid.row(x, y, rest)))
        });
        let place = |scale: Scale, even: f64| {
            if scale.log { scale.position(even.exp()) } else { scale.position(even) }
        };
        let mut outline = Outline::default();
        for line in lines {
            let points: Vec<[f64; 2]> = line
                .into_iter()
                .map(|[x, y]| {
                    [
                        panel.x + place(panel.xs, x) * panel.width,
                        panel.y + (1.0 - place(panel.ys, y)) * panel.height,
                    ]
                })
                .collect();
            outline.add_line(&points);
        }
        scene.line(outline.clone(), Stroke::solid(PAPER, 5.0));
        scene.line(outline, Stroke::solid(INK, 2.6));
    }

    #[expect(clippy::too_many_arguments, reason = "one call; the panel's parts belong together nowhere else")]
    fn name_regions(
        &self,
        scene: &mut Scene,
        typeface: &Typeface,
        panel: &Panel,
        grid: &Grid,
        borders: &[Vec<f64>; 2],
        rest: &[usize],
        level: &Level,
    ) {
        let place = |borders: &[f64], scale: Scale, part: f64| {
            let found = borders.partition_point(|&border| scale.position(border) <= part);
            found.clamp(1, borders.len() - 1) - 1
        };
        let offset = |[x, y]: [f64; 2]| {
            let x = place(&borders[0], panel.xs, x / panel.width);
            let y = place(&borders[1], panel.ys, 1.0 - y / panel.height);
            level.offset(self.value(grid.row(x, y, rest)))
        };
        for (name, wanted_above) in [(&level.above[0], true), (&level.below[0], false)] {
            // A cell without a value is on neither side.
            let inside = |point: [f64; 2]| {
                let offset = offset(point);
                offset.is_finite() && (offset >= 0.0) == wanted_above
            };
            let size = [typeface.width(name, LABEL_SIZE, true) + 10.0, LABEL_SIZE + 8.0];
            if let Some([x, y]) = roomiest([panel.width, panel.height], size, inside) {
                let at = [panel.x + x, panel.y + y + 0.35 * LABEL_SIZE];
                scene.text(Text::new(name, at, LABEL_SIZE).bold().anchor(Anchor::Middle).halo(PAPER));
            }
        }
    }

    fn legend(&self, slices: &Slices, grid: &Grid) -> Vec<(Sign, String)> {
        let mut entries = Vec::new();
        if let Some(Layer { level: Some(level), scale, .. }) = &self.layer {
            let quarter = |part: usize| scale.colour(part * LEVELS / 4);
            entries.push((Sign::Line(Stroke::solid(INK, 2.6)), level.line.clone()));
            entries.push((Sign::Area(quarter(3)), level.above[1].clone()));
            entries.push((Sign::Area(quarter(1)), level.below[1].clone()));
        }
        for (kind, name) in self.kinds.iter().enumerate() {
            let count = self.fills.iter().filter(|fill| **fill == Fill::Kind(kind)).count();
            entries
                .push((Sign::Area(self.kind_colour(kind)), format!("{} ({count})", name.replace('_', " "))));
        }
        let shown = |fill: Fill| {
            slices.panels.iter().any(|slice| {
                let (xs, ys) = (grid.axes[0].values.len(), grid.axes[1].values.len());
                let mut rows = (0..xs).flat_map(|x| (0..ys).map(move |y| (x, y)));
                rows.any(|(x, y)| grid.row(x, y, &slice.rest).is_some_and(|row| self.fills[row] == fill))
            })
        };
        if shown(Fill::Failed) {
            entries.push((Sign::Failed, "failed: no result".to_owned()));
        }
        if shown(Fill::Undefined) {
            entries.push((Sign::Undefined, "undefined: no excitation".to_owned()));
        }
        entries
    }
}

fn colour_bar(scene: &mut Scene, layer: &Layer, [x, y, width, height]: [f64; 4]) {
    let step = height / LEVELS as f64;
    for level in 0..LEVELS {
        let top = y + height - (level + 1) as f64 * step;
        scene.fill_crisp(Outline::rectangle(x, top, width, step), layer.scale.colour(level));
    }
    scene.line(Outline::rectangle(x, y, width, height), Stroke::solid(INK, 1.2));
    let mut marks = Outline::default();
    for tick in layer.scale.ticks() {
        let at = y + (1.0 - layer.scale.position(tick.value)) * height;
        marks.add_line(&[[x + width, at], [x + width + 5.0, at]]);
        let centre = matches!(layer.scale, ColourScale::Diverging { centre, .. } if centre == tick.value);
        let text = Text::new(tick.label, [x + width + 8.0, at + 0.35 * TICK_SIZE], TICK_SIZE);
        scene.text(if centre { text.bold() } else { text });
        if centre {
            marks.add_line(&[[x, at], [x + width, at]]);
        }
    }
    scene.line(marks, Stroke::solid(INK, 1.4));
    let at = [x + width + 72.0, y + height / 2.0];
    scene.text(Text::new(layer.label.clone(), at, TICK_SIZE).anchor(Anchor::Middle).upright());
}
