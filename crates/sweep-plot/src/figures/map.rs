//! The map over the first two axes, with the line that divides it (the paper's Fig. 12).

use std::collections::BTreeMap;

use crate::axis::AxisScale;
use crate::colour::{BOTH, COLOUR_STEPS, DISTINCT};
use crate::contour::{MAX_POINTS, leave_out_shortest, zero_lines};
use crate::cuts::Cuts;
use crate::error::Result;
use crate::figures::boundary::Overlay;
use crate::frame::{
    self, BOTTOM_MARGIN, FIGURE_WIDTH, HEADING_HEIGHT, LABEL_SIZE, LegendSymbol, Panel, TICK_SIZE,
    failed, failed_hatch, heading, legend_height, sensitive_hatch, undefined,
};
use crate::gather::{CellMap, OK};
use crate::grid::GridAxis;
use crate::layer::{DividingLimit, Layer, ShownColumn};
use crate::raster::text_width;
use crate::region::roomiest_place;
use crate::scene::{Anchor, Colour, Hatch, INK, Outline, PAPER, Scene, Stroke, Text};

/// The colour of a boundary file's curve, which no colour scale has.
const OVERLAY_COLOUR: Colour = Colour::hex(0x0b6b3a);
/// Left margin for the numbers and the label of the y axis, px.
const LEFT_MARGIN: f64 = 86.0;
/// Right margin for the colour bar with its numbers and label, px.
const RIGHT_MARGIN: f64 = 128.0;
/// Draws a map of two axes or more.
///
/// A map over two axes is one panel. A third axis becomes one panel for each of its values (at most
/// nine, evenly picked). An axis beyond the second that `--at` fixes, and every axis from the
/// fourth on, has one value (its first unless fixed), which the subtitle names.
///
/// # Errors
/// Returns the errors of [`ShownColumn::layer`].
pub(crate) fn draw(
    map: &CellMap,
    cuts: &Cuts,
    shown: Option<&ShownColumn>,
    overlay: Option<&Overlay>,
) -> Result<Scene> {
    let mut cells = match shown {
        Some(shown) => CellPainter::by_value(map, shown.layer(map)?),
        None => CellPainter::by_status(map),
    };
    let grid = &map.grid;

    let columns = match cuts.cuts.len() {
        1 => 1,
        2..=4 => 2,
        _ => 3,
    };
    let rows = cuts.cuts.len().div_ceil(columns);
    let single = cuts.cuts.len() == 1;
    let bar = if cells.layer.is_some() { RIGHT_MARGIN } else { 24.0 };
    let (gap, head) = if single { (0.0, 0.0) } else { (22.0, 26.0) };
    let width = (FIGURE_WIDTH - LEFT_MARGIN - bar - gap * (columns - 1) as f64) / columns as f64;
    let height = if single { 440.0 } else { 0.78 * width };
    cells.refine_hatches([width, height]);
    let [xs, ys] = [0, 1].map(|k| grid.axes[k].values.len());
    let all = || (0..xs).flat_map(|x| (0..ys).map(move |y| (x, y)));
    let drawn = cuts.cuts.iter().flat_map(|cut| all().map(|(x, y)| grid.cell(x, y, &cut.rest)));
    let mut entries = cells.legend(&drawn.collect::<Vec<_>>());
    let scales = [0, 1].map(|k| grid.axes[k].scale());
    if let Some(overlay) = overlay.filter(|overlay| is_within(overlay, scales)) {
        entries.push((LegendSymbol::Line(overlay_stroke()), overlay.name.clone()));
    }
    let legend_height = legend_height(&entries, FIGURE_WIDTH - LEFT_MARGIN - 20.0);
    let panels_height = rows as f64 * (height + head) + gap * (rows - 1) as f64;
    let total = HEADING_HEIGHT + panels_height + BOTTOM_MARGIN + legend_height + 14.0;

    let [x_axis, y_axis] = [&grid.axes[0], &grid.axes[1]];
    let described = format!("{}: {} over {}", cells.title, y_axis.label(), x_axis.label());
    let mut scene = Scene::new(FIGURE_WIDTH, total, described);
    heading(&mut scene, &cells.title, &subtitle(map, &cuts.notes));
    for (index, cut) in cuts.cuts.iter().enumerate() {
        let column = index % columns;
        let row = index / columns;
        let panel = Panel {
            x: LEFT_MARGIN + column as f64 * (width + gap),
            y: HEADING_HEIGHT + head + row as f64 * (height + head + gap),
            width,
            height,
            xs: x_axis.scale(),
            ys: y_axis.scale(),
        };
        cells.draw(&mut scene, &panel, &cut.rest);
        let divided = cells.layer.as_ref().and_then(|layer| Some((layer, layer.level.as_ref()?)));
        let room = MAX_POINTS / cuts.cuts.len();
        let mut lines = divided.map_or_else(Vec::new, |divided| {
            cells.draw_line(&mut scene, &panel, divided, &cut.rest, room)
        });
        if let Some(overlay) = overlay {
            draw_overlay(&mut scene, &panel, overlay);
        }
        // The names of the sides are drawn over the lines, which they interrupt if there is no room
        // beside them.
        if let Some(divided) = divided {
            let overlaid = overlay.iter().flat_map(|overlay| &overlay.lines);
            lines.extend(overlaid.map(|line| curve_pixels(&panel, line)));
            cells.name_regions(&mut scene, &panel, divided, (&cut.rest, &lines));
        }
        let lowest = index + columns >= cuts.cuts.len();
        panel.draw_frame(&mut scene, lowest, column == 0);
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
        let area =
            [FIGURE_WIDTH - RIGHT_MARGIN + 20.0, HEADING_HEIGHT + head, 22.0, panels_height - head];
        colour_bar(&mut scene, layer, area);
    }
    let y = HEADING_HEIGHT + panels_height + BOTTOM_MARGIN;
    frame::legend(&mut scene, &entries, LEFT_MARGIN, y, FIGURE_WIDTH - LEFT_MARGIN - 20.0);
    Ok(scene)
}

/// Returns the stroke of a boundary file's curve.
fn overlay_stroke() -> Stroke {
    Stroke { dash: vec![9.0, 5.0], ..Stroke::solid(OVERLAY_COLOUR, 3.0) }
}

/// Draws the curve of a boundary file as far as it lies within the panel.
fn draw_overlay(scene: &mut Scene, panel: &Panel, overlay: &Overlay) {
    let mut outline = Outline::default();
    let mut alone = Vec::new();
    for line in &overlay.lines {
        alone.extend(outline.add_runs(&curve_pixels(panel, line)));
    }
    scene.line(outline.clone(), Stroke::solid(PAPER, 5.0));
    scene.line(outline, overlay_stroke());
    for place in alone {
        scene.fill(Outline::circle(place, 4.5), PAPER);
        scene.fill(Outline::circle(place, 3.5), OVERLAY_COLOUR);
    }
}

/// Returns whether a point of a boundary file's curve lies within these scales.
fn is_within(overlay: &Overlay, [xs, ys]: [AxisScale; 2]) -> bool {
    let is_inside = |&[x, y]: &[f64; 2]| {
        [xs.position(x), ys.position(y)].iter().all(|part| (0.0..=1.0).contains(part))
    };
    overlay.lines.iter().flatten().any(is_inside)
}

/// Returns the pixels of a curve's points; `None` for points outside the panel and for gaps.
fn curve_pixels(panel: &Panel, line: &[[f64; 2]]) -> Vec<Option<[f64; 2]>> {
    let inside = |x: f64, y: f64| {
        [panel.xs.position(x), panel.ys.position(y)].iter().all(|part| (0.0..=1.0).contains(part))
    };
    line.iter().map(|&[x, y]| inside(x, y).then(|| panel.at(x, y))).collect()
}

/// Returns the subtitle: the name of the run, the number of points and of failed ones, and notes on
/// fixed, omitted or merged values.
pub(crate) fn subtitle(map: &CellMap, notes: &[String]) -> String {
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

/// Returns the legend of all cells by a layer, or by status without one.
pub(crate) fn legend(map: &CellMap, layer: Option<Layer>) -> Vec<(LegendSymbol, String)> {
    let cells = layer
        .map_or_else(|| CellPainter::by_status(map), |layer| CellPainter::by_value(map, layer));
    cells.legend(&(0..map.counts.len()).collect::<Vec<_>>())
}

/// Returns the colour of each status.
pub(crate) fn kinds(map: &CellMap) -> BTreeMap<String, String> {
    let cells = CellPainter::by_status(map);
    let colour = |kind: usize| (cells.kinds[kind].0.clone(), cells.status_colour(kind).css());
    (0..cells.kinds.len()).map(colour).collect()
}

/// Returns the lines of a limit in several cuts of a map, in values of its axes, with at most
/// `room` points. If a ragged boundary has more, its shortest lines are left out: the cells on
/// either side show them. `cell` maps a cut and its indices along both axes to a cell.
pub(crate) fn level_lines(
    map: &CellMap,
    (layer, level): (&Layer, &DividingLimit),
    cuts: usize,
    cell: impl Fn(usize, usize, usize) -> usize,
    room: usize,
) -> Vec<Vec<Vec<[f64; 2]>>> {
    let [xs, ys] = [&map.grid.axes[0], &map.grid.axes[1]];
    let lines_of_cut = |cut: usize| {
        zero_lines(&xs.coordinates(), &ys.coordinates(), |x, y| {
            let cell = cell(cut, x, y);
            level.offset(if map.filled(cell) { layer.typical(cell) } else { f64::NAN })
        })
    };
    let mut lines: Vec<Vec<Vec<[f64; 2]>>> = (0..cuts).map(lines_of_cut).collect();
    leave_out_shortest(&mut lines, room);
    for [x, y] in lines.iter_mut().flatten().flatten() {
        (*x, *y) = (xs.swept.from_coordinate(*x), ys.swept.from_coordinate(*y));
    }
    lines
}

/// The filling of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fill {
    Step(usize),
    Status(usize),
    /// Points on both sides of the limit, or of several kinds.
    Both,
    Failed,
    Undefined,
}

/// The fillings of a map's cells.
struct CellPainter<'a> {
    map: &'a CellMap,
    title: String,
    /// The filling of each cell; `None` if the file has no point in it.
    fills: Vec<Option<Fill>>,
    layer: Option<Layer>,
    /// The statuses that [`Fill::Status`] refers to, with the number of points of each.
    kinds: Vec<(String, usize)>,
    /// The hatch of cells in which some points have no value, and that of cells with sensitive
    /// points.
    hatches: [Hatch; 2],
}

impl<'a> CellPainter<'a> {
    fn new(map: &'a CellMap, title: String, fill: impl Fn(usize) -> Fill) -> Self {
        let fill = |cell: usize| map.filled(cell).then(|| fill(cell));
        let fills = (0..map.counts.len()).map(fill).collect();
        let hatches = [failed_hatch(), sensitive_hatch()];
        Self { map, title, fills, layer: None, kinds: Vec::new(), hatches }
    }

    fn by_value(map: &'a CellMap, layer: Layer) -> Self {
        let fill = |cell: usize| match (layer.values[cell].is_finite(), map.counts[cell].failed) {
            (true, _) if layer.both(cell) => Fill::Both,
            (true, _) => Fill::Step(layer.scale.step(layer.values[cell])),
            (false, 0) => Fill::Undefined,
            (false, _) => Fill::Failed,
        };
        let cells = Self::new(map, layer.title.clone(), fill);
        Self { layer: Some(layer), ..cells }
    }

    fn by_status(map: &'a CellMap) -> Self {
        let mut kinds: Vec<(String, usize)> =
            map.statuses.iter().map(|(kind, points)| (kind.clone(), *points)).collect();
        kinds.sort_by_key(|(kind, _)| (kind != OK, kind.clone()));
        let fill = |cell: usize| {
            map.status(cell).map_or(Fill::Both, |status| {
                Fill::Status(kinds.iter().position(|(kind, _)| kind == status).unwrap_or_default())
            })
        };
        let cells = Self::new(map, "How each point ended".to_owned(), fill);
        Self { kinds, ..cells }
    }

    /// Makes hatches fine enough to be visible on the smallest cell of a panel of this size, px.
    fn refine_hatches(&mut self, size: [f64; 2]) {
        let smallest = [0, 1].map(|k| {
            let axis = &self.map.grid.axes[k];
            let scale = axis.scale();
            let part = |pair: &[f64]| scale.position(pair[1]) - scale.position(pair[0]);
            axis.borders.windows(2).map(part).fold(1.0, f64::min) * size[k]
        });
        self.hatches = self.hatches.clone().map(|hatch| hatch.within(smallest));
    }

    fn status_colour(&self, kind: usize) -> Colour {
        if self.kinds[kind].0 == OK {
            Colour::hex(0xe8ebee)
        } else {
            DISTINCT[kind % DISTINCT.len()]
        }
    }

    fn draw(&self, scene: &mut Scene, panel: &Panel, rest: &[usize]) {
        // Cells of one colour are one shape, and runs of them along y one rectangle: the file is
        // small and has no seams.
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
                (Fill::Step(level), Some(layer)) => {
                    scene.fill_crisp(shape, layer.scale.colour(level))
                }
                (Fill::Status(kind), _) => scene.fill_crisp(shape, self.status_colour(kind)),
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

    /// Returns the outline of the cells for which `holds` is true.
    fn area(&self, panel: &Panel, rest: &[usize], holds: impl Fn(usize) -> bool) -> Outline {
        let mut area = Outline::default();
        for ([x, y, width, height], holds) in self.strips(panel, rest, holds, |_| false) {
            if holds {
                area.add_rectangle(x, y, width, height);
            }
        }
        area
    }

    /// Returns rectangles `[x, y, width, height]` (px) of runs of cells along y with the same
    /// content. Cells whose content is `lone` have a rectangle each.
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
            let left = panel.at_x(pair[0]);
            let right = panel.at_x(pair[1]);
            let content_at = |y: usize| content(self.map.grid.cell(x, y, rest));
            let mut start = 0;
            while start + 1 < ys.len() {
                let here = content_at(start);
                let mut end = start + 1;
                while !lone(here) && end + 1 < ys.len() && content_at(end) == here {
                    end += 1;
                }
                strips.push(([left, ys[end], right - left, ys[start] - ys[end]], here));
                start = end;
            }
        }
        strips
    }

    /// Returns whether a cell has points that failed or have no value beside others with a value.
    fn partly_lost(&self, cell: usize) -> bool {
        matches!(self.fills[cell], Some(Fill::Step(_) | Fill::Both))
            && self
                .layer
                .as_ref()
                .is_some_and(|layer| self.some_failed(cell) || layer.undefined(cell))
    }

    fn some_failed(&self, cell: usize) -> bool {
        self.map.counts[cell].failed > 0
    }

    /// Returns whether a cell's colour depends on a chaotic motion.
    fn sensitive(&self, cell: usize) -> bool {
        self.layer.as_ref().is_some_and(|layer| layer.nonlinear)
            && self.map.counts[cell].sensitive > 0
    }

    /// Draws the lines of the limit with at most `room` points. Returns their points, px.
    fn draw_line(
        &self,
        scene: &mut Scene,
        panel: &Panel,
        divided: (&Layer, &DividingLimit),
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
        (layer, level): (&Layer, &DividingLimit),
        (rest, lines): (&[usize], &[Vec<Option<[f64; 2]>>]),
    ) {
        let place = |axis: &GridAxis, scale: AxisScale, part: f64| {
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
            // A cell without a value lies on neither side.
            let inside = |point: [f64; 2]| {
                let offset = offset(point);
                offset.is_finite() && (offset >= 0.0) == wanted_above
            };
            let size = [text_width(name, LABEL_SIZE, true) + 10.0, LABEL_SIZE + 8.0];
            let area = [panel.width, panel.height];
            // A name is kept away from the lines if there is room.
            let clear = |point: [f64; 2]| inside(point) && !is_near(panel, lines, point);
            let found =
                roomiest_place(area, size, clear).or_else(|| roomiest_place(area, size, inside));
            if let Some([x, y]) = found {
                let at = [panel.x + x, panel.y + y + 0.35 * LABEL_SIZE];
                let text = Text::new(name, at, LABEL_SIZE).bold().anchor(Anchor::Middle);
                scene.text(Text { halo: Some(PAPER), ..text });
            }
        }
    }

    /// Returns the legend of the cells that are drawn.
    fn legend(&self, drawn: &[usize]) -> Vec<(LegendSymbol, String)> {
        let mut entries = Vec::new();
        let shown = |wanted: &dyn Fn(usize) -> bool| drawn.iter().any(|&cell| wanted(cell));
        let filled = |fill: Fill| shown(&|cell| self.fills[cell] == Some(fill));
        if let Some(Layer { level: Some(level), scale, .. }) = &self.layer {
            let quarter = |part: usize| scale.colour(part * COLOUR_STEPS / 4);
            // Cells whose points are all on one side have no line between them.
            let offset = |cell: usize| {
                self.layer.as_ref().map_or(f64::NAN, |layer| level.offset(layer.typical(cell)))
            };
            if shown(&|cell| offset(cell) >= 0.0) && shown(&|cell| offset(cell) < 0.0) {
                entries.push((LegendSymbol::Line(Stroke::solid(INK, 2.6)), level.line.clone()));
            }
            entries.push((LegendSymbol::Area(quarter(3)), level.above[1].clone()));
            entries.push((LegendSymbol::Area(quarter(1)), level.below[1].clone()));
            if filled(Fill::Both) {
                entries.push((LegendSymbol::Area(BOTH), level.both.clone()));
            }
        }
        for (kind, (name, points)) in self.kinds.iter().enumerate() {
            let text = format!("{} ({points})", name.replace('_', " "));
            entries.push((LegendSymbol::Area(self.status_colour(kind)), text));
        }
        if self.layer.is_none() && filled(Fill::Both) {
            entries.push((LegendSymbol::Area(BOTH), "points of several kinds".to_owned()));
        }
        let only_failed =
            |cell: usize| self.map.counts[cell].failed == self.map.counts[cell].points;
        if shown(&|cell| self.fills[cell] == Some(Fill::Failed) && !only_failed(cell)) {
            entries.push((LegendSymbol::Failed, "no result: failed or undefined".to_owned()));
        } else if filled(Fill::Failed) {
            entries.push((LegendSymbol::Failed, "failed: no result".to_owned()));
        }
        if shown(&|cell| self.partly_lost(cell)) {
            let some_failed = shown(&|cell| self.partly_lost(cell) && self.some_failed(cell));
            let undefined = |cell| self.layer.as_ref().is_some_and(|layer| layer.undefined(cell));
            let some_undefined = shown(&|cell| self.partly_lost(cell) && undefined(cell));
            let phrase = match (some_failed, some_undefined) {
                (true, false) => "some points failed",
                (true, true) => "some points failed or undefined",
                (false, _) => "some points undefined",
            };
            entries.push((LegendSymbol::Hatched(self.hatches[0].clone()), phrase.to_owned()));
        }
        if shown(&|cell| self.sensitive(cell)) {
            let phrase = if self.map.grid.merged() {
                "some points sensitive: chaotic"
            } else {
                "sensitive: motion is chaotic"
            };
            entries.push((LegendSymbol::Hatched(self.hatches[1].clone()), phrase.to_owned()));
        }
        if filled(Fill::Undefined) {
            entries.push((LegendSymbol::Undefined, "undefined: no excitation".to_owned()));
        }
        entries
    }
}

/// Returns whether a point of a panel, px from its corner, is as close to a line as neighbouring
/// samples of the search for a name's place are.
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
    let step = height / COLOUR_STEPS as f64;
    for level in 0..COLOUR_STEPS {
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
