//! The map over the first two axes, with the line that divides it (the paper's Fig. 12).

use std::collections::BTreeMap;

use crate::axis::Scale;
use crate::colour::{BOTH, DISTINCT, LEVELS};
use crate::contour::{MOST_POINTS, leave_out_shortest, zero_lines};
use crate::cuts::Cuts;
use crate::error::Result;
use crate::figures::boundary::Overlay;
use crate::frame::{
    self, HEADING_HEIGHT, LABEL_SIZE, Panel, Sign, TICK_SIZE, failed, failed_hatch, heading,
    legend_height, sensitive_hatch, undefined,
};
use crate::gather::{Map, OK};
use crate::grid::GridAxis;
use crate::layer::{Layer, Level, Shown};
use crate::raster::text_width;
use crate::region::roomiest;
use crate::scene::{Anchor, Colour, Hatch, INK, Outline, PAPER, Scene, Stroke, Text};

const WIDTH: f64 = 880.0;
/// The line of another file: on neither side of the colours.
const OVERLAY: Colour = Colour::hex(0x0b6b3a);
/// Left of a panel: numbers and label of the y axis.
const LEFT: f64 = 86.0;
/// Right of the panels: the colour bar with its numbers and label.
const RIGHT: f64 = 128.0;
/// Below a panel: numbers and label of the x axis.
const BELOW: f64 = 64.0;
/// Draws a map of two or more axes.
///
/// Over two axes it is one panel. A third axis becomes one panel for each of its values (at most
/// nine, evenly picked); an axis beyond the second that is pinned by `--at`, and every one from the
/// fourth on, is cut at one value (its first unless pinned), which the subtitle names.
///
/// # Errors
/// As [`Shown::layer`].
pub(crate) fn draw(
    map: &Map,
    cuts: &Cuts,
    shown: Option<&Shown>,
    overlay: Option<&Overlay>,
) -> Result<Scene> {
    let mut cells = match shown {
        Some(shown) => Cells::by_value(map, shown.layer(map)?),
        None => Cells::by_status(map),
    };
    let grid = &map.grid;

    let columns = match cuts.cuts.len() {
        1 => 1,
        2..=4 => 2,
        _ => 3,
    };
    let rows = cuts.cuts.len().div_ceil(columns);
    let single = cuts.cuts.len() == 1;
    let bar = if cells.layer.is_some() { RIGHT } else { 24.0 };
    let (gap, head) = if single { (0.0, 0.0) } else { (22.0, 26.0) };
    let width = (WIDTH - LEFT - bar - gap * (columns - 1) as f64) / columns as f64;
    let height = if single { 440.0 } else { 0.78 * width };
    cells.refine_hatches([width, height]);
    let [xs, ys] = [0, 1].map(|k| grid.axes[k].values.len());
    let all = || (0..xs).flat_map(|x| (0..ys).map(move |y| (x, y)));
    let drawn = cuts.cuts.iter().flat_map(|cut| all().map(|(x, y)| grid.cell(x, y, &cut.rest)));
    let mut entries = cells.legend(&drawn.collect::<Vec<_>>());
    let scales = [0, 1].map(|k| grid.axes[k].scale());
    if let Some(overlay) = overlay.filter(|overlay| is_within(overlay, scales)) {
        entries.push((Sign::Line(overlay_stroke()), overlay.name.clone()));
    }
    let of_legend = legend_height(&entries, WIDTH - LEFT - 20.0);
    let panels_height = rows as f64 * (height + head) + gap * (rows - 1) as f64;
    let total = HEADING_HEIGHT + panels_height + BELOW + of_legend + 14.0;

    let [x_axis, y_axis] = [&grid.axes[0], &grid.axes[1]];
    let described = format!("{}: {} over {}", cells.title, y_axis.label(), x_axis.label());
    let mut scene = Scene::new(WIDTH, total, described);
    heading(&mut scene, &cells.title, &subtitle(map, &cuts.notes));
    for (index, cut) in cuts.cuts.iter().enumerate() {
        let (column, row) = (index % columns, index / columns);
        let panel = Panel {
            x: LEFT + column as f64 * (width + gap),
            y: HEADING_HEIGHT + head + row as f64 * (height + head + gap),
            width,
            height,
            xs: x_axis.scale(),
            ys: y_axis.scale(),
        };
        cells.draw(&mut scene, &panel, &cut.rest);
        let divided = cells.layer.as_ref().and_then(|layer| Some((layer, layer.level.as_ref()?)));
        let room = MOST_POINTS / cuts.cuts.len();
        let mut lines = divided.map_or_else(Vec::new, |divided| {
            cells.draw_line(&mut scene, &panel, divided, &cut.rest, room)
        });
        if let Some(overlay) = overlay {
            draw_overlay(&mut scene, &panel, overlay);
        }
        // Above the lines, which they interrupt where there is no room beside them.
        if let Some(divided) = divided {
            let overlaid = overlay.iter().flat_map(|overlay| &overlay.lines);
            lines.extend(overlaid.map(|line| places(&panel, line)));
            cells.name_regions(&mut scene, &panel, divided, (&cut.rest, &lines));
        }
        let lowest = index + columns >= cuts.cuts.len();
        panel.frame(&mut scene, lowest, column == 0);
        if let Some(name) = &cut.name {
            let at = [panel.x + width / 2.0, panel.y - 8.0];
            scene.text(Text::new(name.clone(), at, TICK_SIZE).bold().anchor(Anchor::Middle));
        }
        if lowest {
            panel.x_label(&mut scene, &x_axis.label());
        }
        if column == 0 {
            panel.y_label(&mut scene, &y_axis.label(), 60.0);
        }
    }
    if let Some(layer) = &cells.layer {
        let area = [WIDTH - RIGHT + 20.0, HEADING_HEIGHT + head, 22.0, panels_height - head];
        colour_bar(&mut scene, layer, area);
    }
    let y = HEADING_HEIGHT + panels_height + BELOW;
    frame::legend(&mut scene, &entries, LEFT, y, WIDTH - LEFT - 20.0);
    Ok(scene)
}

/// How the line of another file is drawn.
fn overlay_stroke() -> Stroke {
    Stroke { dash: vec![9.0, 5.0], ..Stroke::solid(OVERLAY, 3.0) }
}

/// Draws the line of another file, as far as it is within the panel.
fn draw_overlay(scene: &mut Scene, panel: &Panel, overlay: &Overlay) {
    let mut outline = Outline::default();
    let mut alone = Vec::new();
    for line in &overlay.lines {
        alone.extend(outline.add_runs(&places(panel, line)));
    }
    scene.line(outline.clone(), Stroke::solid(PAPER, 5.0));
    scene.line(outline, overlay_stroke());
    for place in alone {
        scene.fill(Outline::circle(place, 4.5), PAPER);
        scene.fill(Outline::circle(place, 3.5), OVERLAY);
    }
}

/// Returns whether some place of the line of another file is within these scales, across and up.
fn is_within(overlay: &Overlay, [xs, ys]: [Scale; 2]) -> bool {
    let is_inside = |&[x, y]: &[f64; 2]| {
        [xs.position(x), ys.position(y)].iter().all(|part| (0.0..=1.0).contains(part))
    };
    overlay.lines.iter().flatten().any(is_inside)
}

/// Where a line's places are in a panel, px; none of those outside, and where it has a gap.
fn places(panel: &Panel, line: &[[f64; 2]]) -> Vec<Option<[f64; 2]>> {
    let inside = |x: f64, y: f64| {
        [panel.xs.position(x), panel.ys.position(y)].iter().all(|part| (0.0..=1.0).contains(part))
    };
    line.iter().map(|&[x, y]| inside(x, y).then(|| panel.at(x, y))).collect()
}

/// Name of the run, how many points it has and how many failed, and what is fixed, left out or
/// merged.
pub(crate) fn subtitle(map: &Map, notes: &[String]) -> String {
    let source = &map.table.source;
    let mut parts = source.notes([format!("{} points", source.rows)]);
    let failed = map.failed();
    if failed > 0 {
        parts.push(format!("{failed} failed"));
    }
    parts.extend(notes.iter().cloned());
    parts.extend(map.grid.note());
    parts.join(" · ")
}

/// The legend of all cells by a layer, or else by how points ended.
pub(crate) fn legend(map: &Map, layer: Option<Layer>) -> Vec<(Sign, String)> {
    let cells = layer.map_or_else(|| Cells::by_status(map), |layer| Cells::by_value(map, layer));
    cells.legend(&(0..map.counts.len()).collect::<Vec<_>>())
}

/// The colours of how points ended.
pub(crate) fn kinds(map: &Map) -> BTreeMap<String, String> {
    let cells = Cells::by_status(map);
    let colour = |kind: usize| (cells.kinds[kind].0.clone(), cells.kind_colour(kind).css());
    (0..cells.kinds.len()).map(colour).collect()
}

/// A level's lines in so many cuts of a map, through the values of its axes, with at most `room`
/// points. Where a ragged boundary has more, its shortest lines are left out: the cells on either
/// side show them. `cell` is the index of a cut's cell.
pub(crate) fn level_lines(
    map: &Map,
    (layer, level): (&Layer, &Level),
    cuts: usize,
    cell: impl Fn(usize, usize, usize) -> usize,
    room: usize,
) -> Vec<Vec<Vec<[f64; 2]>>> {
    let [xs, ys] = [&map.grid.axes[0], &map.grid.axes[1]];
    let of_cut = |cut: usize| {
        zero_lines(&xs.even(), &ys.even(), |x, y| {
            let cell = cell(cut, x, y);
            level.offset(if map.filled(cell) { layer.typical(cell) } else { f64::NAN })
        })
    };
    let mut lines: Vec<Vec<Vec<[f64; 2]>>> = (0..cuts).map(of_cut).collect();
    leave_out_shortest(&mut lines, room);
    for [x, y] in lines.iter_mut().flatten().flatten() {
        (*x, *y) = (xs.swept.un_even(*x), ys.swept.un_even(*y));
    }
    lines
}

/// What is drawn in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fill {
    Level(usize),
    Kind(usize),
    /// Points on both sides of the level, or of several kinds.
    Both,
    Failed,
    Undefined,
}

/// How each cell is drawn.
struct Cells<'a> {
    map: &'a Map,
    title: String,
    /// None where the file has no point.
    fills: Vec<Option<Fill>>,
    layer: Option<Layer>,
    /// The kinds of [`Fill::Kind`], with the number of points of each.
    kinds: Vec<(String, usize)>,
    /// Over cells in which some points have no value, and over those with sensitive points.
    hatches: [Hatch; 2],
}

impl<'a> Cells<'a> {
    fn new(map: &'a Map, title: String, fill: impl Fn(usize) -> Fill) -> Self {
        let fill = |cell: usize| map.filled(cell).then(|| fill(cell));
        let fills = (0..map.counts.len()).map(fill).collect();
        let hatches = [failed_hatch(), sensitive_hatch()];
        Self { map, title, fills, layer: None, kinds: Vec::new(), hatches }
    }

    fn by_value(map: &'a Map, layer: Layer) -> Self {
        let fill = |cell: usize| match (layer.values[cell].is_finite(), map.counts[cell].failed) {
            (true, _) if layer.both(cell) => Fill::Both,
            (true, _) => Fill::Level(layer.scale.level(layer.values[cell])),
            (false, 0) => Fill::Undefined,
            (false, _) => Fill::Failed,
        };
        let cells = Self::new(map, layer.title.clone(), fill);
        Self { layer: Some(layer), ..cells }
    }

    fn by_status(map: &'a Map) -> Self {
        let mut kinds: Vec<(String, usize)> =
            map.statuses.iter().map(|(kind, points)| (kind.clone(), *points)).collect();
        kinds.sort_by_key(|(kind, _)| (kind != OK, kind.clone()));
        let fill = |cell: usize| {
            map.status(cell).map_or(Fill::Both, |status| {
                Fill::Kind(kinds.iter().position(|(kind, _)| kind == status).unwrap_or_default())
            })
        };
        let cells = Self::new(map, "How each point ended".to_owned(), fill);
        Self { kinds, ..cells }
    }

    /// Makes hatches fine enough to show on the smallest cell of a panel of that size, px.
    fn refine_hatches(&mut self, size: [f64; 2]) {
        let smallest = [0, 1].map(|k| {
            let axis = &self.map.grid.axes[k];
            let scale = axis.scale();
            let part = |pair: &[f64]| scale.position(pair[1]) - scale.position(pair[0]);
            axis.borders.windows(2).map(part).fold(1.0, f64::min) * size[k]
        });
        self.hatches = self.hatches.clone().map(|hatch| hatch.within(smallest));
    }

    fn kind_colour(&self, kind: usize) -> Colour {
        if self.kinds[kind].0 == OK {
            Colour::hex(0xe8ebee)
        } else {
            DISTINCT[kind % DISTINCT.len()]
        }
    }

    fn draw(&self, scene: &mut Scene, panel: &Panel, rest: &[usize]) {
        // Cells of one colour are one shape, and runs of them along y one rectangle: small files,
        // no seams.
        let mut shapes: BTreeMap<Fill, Outline> = BTreeMap::new();
        let mut lone: Vec<[f64; 4]> = Vec::new();
        let fill = |cell: usize| self.fills[cell];
        let is_lone = |fill| fill == Some(Fill::Undefined);
        for ([x, y, width, height], fill) in self.strips(panel, rest, fill, is_lone) {
            match fill {
                Some(Fill::Undefined) => lone.push([x, y, width, height]),
                Some(fill) => shapes.entry(fill).or_default().add_rectangle(x, y, width, height),
                None => {}
            }
        }
        for (fill, shape) in shapes {
            match (fill, &self.layer) {
                (Fill::Level(level), Some(layer)) => {
                    scene.fill_crisp(shape, layer.scale.colour(level))
                }
                (Fill::Kind(kind), _) => scene.fill_crisp(shape, self.kind_colour(kind)),
                (Fill::Both, _) => scene.fill_crisp(shape, BOTH),
                _ => failed(scene, shape),
            }
        }
        if !lone.is_empty() {
            undefined(scene, &lone);
        }
        scene.hatch(self.area(panel, rest, |cell| self.partly_lost(cell)), &self.hatches[0]);
        scene.hatch(self.area(panel, rest, |cell| self.sensitive(cell)), &self.hatches[1]);
    }

    /// The cells that `holds` is true of.
    fn area(&self, panel: &Panel, rest: &[usize], holds: impl Fn(usize) -> bool) -> Outline {
        let mut area = Outline::default();
        for ([x, y, width, height], holds) in self.strips(panel, rest, holds, |_| false) {
            if holds {
                area.add_rectangle(x, y, width, height);
            }
        }
        area
    }

    /// Rectangles `[x, y, width, height]` of neighbours along y with the same content, px; those of
    /// content that is `lone` are one cell each.
    fn strips<T: Copy + PartialEq>(
        &self,
        panel: &Panel,
        rest: &[usize],
        content: impl Fn(usize) -> T,
        lone: impl Fn(T) -> bool,
    ) -> Vec<([f64; 4], T)> {
        let [x_axis, y_axis] = [&self.map.grid.axes[0], &self.map.grid.axes[1]];
        let ys: Vec<f64> = y_axis.borders.iter().map(|&border| panel.at_y(border)).collect();
        let mut strips = Vec::new();
        for (x, pair) in x_axis.borders.windows(2).enumerate() {
            let (left, right) = (panel.at_x(pair[0]), panel.at_x(pair[1]));
            let of_cell = |y: usize| content(self.map.grid.cell(x, y, rest));
            let mut start = 0;
            while start + 1 < ys.len() {
                let (here, mut end) = (of_cell(start), start + 1);
                while !lone(here) && end + 1 < ys.len() && of_cell(end) == here {
                    end += 1;
                }
                strips.push(([left, ys[end], right - left, ys[start] - ys[end]], here));
                start = end;
            }
        }
        strips
    }

    /// Whether a cell has points that failed or have no value beside others that have one.
    fn partly_lost(&self, cell: usize) -> bool {
        matches!(self.fills[cell], Some(Fill::Level(_) | Fill::Both))
            && self
                .layer
                .as_ref()
                .is_some_and(|layer| self.some_failed(cell) || layer.undefined(cell))
    }

    fn some_failed(&self, cell: usize) -> bool {
        self.map.counts[cell].failed > 0
    }

    /// Whether a cell's colour depends on a motion that is chaotic.
    fn sensitive(&self, cell: usize) -> bool {
        self.layer.as_ref().is_some_and(|layer| layer.nonlinear)
            && self.map.counts[cell].sensitive > 0
    }

    /// Draws the level's line with at most `room` points, and gives their places, px.
    fn draw_line(
        &self,
        scene: &mut Scene,
        panel: &Panel,
        divided: (&Layer, &Level),
        rest: &[usize],
        room: usize,
    ) -> Vec<Vec<Option<[f64; 2]>>> {
        let cell = |_, x, y| self.map.grid.cell(x, y, rest);
        let lines = level_lines(self.map, divided, 1, cell, room).into_iter().flatten();
        let mut outline = Outline::default();
        let lines = lines.map(|line| {
            let points: Vec<[f64; 2]> = line.iter().map(|&[x, y]| panel.at(x, y)).collect();
            outline.add_line(&points);
            points.into_iter().map(Some).collect()
        });
        let lines = lines.collect();
        scene.line(outline.clone(), Stroke::solid(PAPER, 5.0));
        scene.line(outline, Stroke::solid(INK, 2.6));
        lines
    }

    fn name_regions(
        &self,
        scene: &mut Scene,
        panel: &Panel,
        (layer, level): (&Layer, &Level),
        (rest, lines): (&[usize], &[Vec<Option<[f64; 2]>>]),
    ) {
        let place = |axis: &GridAxis, scale: Scale, part: f64| {
            let found = axis.borders.partition_point(|&border| scale.position(border) <= part);
            found.clamp(1, axis.borders.len() - 1) - 1
        };
        let axes = &self.map.grid.axes;
        let offset = |[x, y]: [f64; 2]| {
            let x = place(&axes[0], panel.xs, x / panel.width);
            let y = place(&axes[1], panel.ys, 1.0 - y / panel.height);
            let cell = self.map.cell(x, y, rest).filter(|&cell| !layer.both(cell));
            level.offset(cell.map_or(f64::NAN, |cell| layer.values[cell]))
        };
        for (name, wanted_above) in [(&level.above[0], true), (&level.below[0], false)] {
            // A cell without a value is on neither side.
            let inside = |point: [f64; 2]| {
                let offset = offset(point);
                offset.is_finite() && (offset >= 0.0) == wanted_above
            };
            let size = [text_width(name, LABEL_SIZE, true) + 10.0, LABEL_SIZE + 8.0];
            let area = [panel.width, panel.height];
            // Off the lines, unless that leaves no room.
            let clear = |point: [f64; 2]| inside(point) && !is_near(panel, lines, point);
            let found = roomiest(area, size, clear).or_else(|| roomiest(area, size, inside));
            if let Some([x, y]) = found {
                let at = [panel.x + x, panel.y + y + 0.35 * LABEL_SIZE];
                let text = Text::new(name, at, LABEL_SIZE).bold().anchor(Anchor::Middle);
                scene.text(Text { halo: Some(PAPER), ..text });
            }
        }
    }

    /// Of the cells that are drawn.
    fn legend(&self, drawn: &[usize]) -> Vec<(Sign, String)> {
        let mut entries = Vec::new();
        let shown = |wanted: &dyn Fn(usize) -> bool| drawn.iter().any(|&cell| wanted(cell));
        let filled = |fill: Fill| shown(&|cell| self.fills[cell] == Some(fill));
        if let Some(Layer { level: Some(level), scale, .. }) = &self.layer {
            let quarter = |part: usize| scale.colour(part * LEVELS / 4);
            // Between cells of one side no line is drawn.
            let offset = |cell: usize| {
                self.layer.as_ref().map_or(f64::NAN, |layer| level.offset(layer.typical(cell)))
            };
            if shown(&|cell| offset(cell) >= 0.0) && shown(&|cell| offset(cell) < 0.0) {
                entries.push((Sign::Line(Stroke::solid(INK, 2.6)), level.line.clone()));
            }
            entries.push((Sign::Area(quarter(3)), level.above[1].clone()));
            entries.push((Sign::Area(quarter(1)), level.below[1].clone()));
            if filled(Fill::Both) {
                entries.push((Sign::Area(BOTH), level.both.clone()));
            }
        }
        for (kind, (name, points)) in self.kinds.iter().enumerate() {
            let text = format!("{} ({points})", name.replace('_', " "));
            entries.push((Sign::Area(self.kind_colour(kind)), text));
        }
        if self.layer.is_none() && filled(Fill::Both) {
            entries.push((Sign::Area(BOTH), "points of several kinds".to_owned()));
        }
        let only_failed =
            |cell: usize| self.map.counts[cell].failed == self.map.counts[cell].points;
        if shown(&|cell| self.fills[cell] == Some(Fill::Failed) && !only_failed(cell)) {
            entries.push((Sign::Failed, "no result: failed or undefined".to_owned()));
        } else if filled(Fill::Failed) {
            entries.push((Sign::Failed, "failed: no result".to_owned()));
        }
        if shown(&|cell| self.partly_lost(cell)) {
            let some_failed = shown(&|cell| self.partly_lost(cell) && self.some_failed(cell));
            let undefined = |cell| self.layer.as_ref().is_some_and(|layer| layer.undefined(cell));
            let some_undefined = shown(&|cell| self.partly_lost(cell) && undefined(cell));
            let said = match (some_failed, some_undefined) {
                (true, false) => "some points failed",
                (true, true) => "some points failed or undefined",
                (false, _) => "some points undefined",
            };
            entries.push((Sign::Hatched(self.hatches[0].clone()), said.to_owned()));
        }
        if shown(&|cell| self.sensitive(cell)) {
            let said = if self.map.grid.merged() {
                "some points sensitive: chaotic"
            } else {
                "sensitive: motion is chaotic"
            };
            entries.push((Sign::Hatched(self.hatches[1].clone()), said.to_owned()));
        }
        if filled(Fill::Undefined) {
            entries.push((Sign::Undefined, "undefined: no excitation".to_owned()));
        }
        entries
    }
}

/// Whether a point of a panel, px from its corner, is as near to one of these lines as samples for
/// a name are to each other.
fn is_near(panel: &Panel, lines: &[Vec<Option<[f64; 2]>>], [x, y]: [f64; 2]) -> bool {
    let point = [panel.x + x, panel.y + y];
    let reach = (panel.width / 44.0).max(panel.height / 33.0);
    let near = |from: [f64; 2], to: [f64; 2]| {
        let [[dx, px], [dy, py]] = [0, 1].map(|k| [to[k] - from[k], point[k] - from[k]]);
        let square = (dx * dx + dy * dy).max(f64::MIN_POSITIVE);
        let part = ((px * dx + py * dy) / square).clamp(0.0, 1.0);
        (px - part * dx).hypot(py - part * dy) < reach
    };
    let pairs = lines.iter().flat_map(|line| line.windows(2));
    let mut known = pairs.filter_map(|pair| pair[0].zip(pair[1]));
    known.any(|(from, to)| near(from, to))
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
        let centre = layer.scale.centre == Some(tick.value);
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
