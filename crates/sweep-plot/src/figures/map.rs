//! The map over the first two axes, with the line that divides it (the paper's Fig. 12).

use std::collections::BTreeMap;

use crate::axis::AxisScale;
use crate::colour::{BOTH_SIDES_COLOUR, COLOUR_STEPS, DISTINCT_COLOURS};
use crate::contour::{MAX_LINE_POINTS, remove_shortest_lines, zero_lines};
use crate::cuts::Cuts;
use crate::error::Result;
use crate::figures::boundary::Overlay;
use crate::frame::{
    self, BOTTOM_MARGIN, FIGURE_WIDTH, HEADING_HEIGHT, LABEL_SIZE, LegendSymbol, Panel, TICK_SIZE,
    draw_failed_area, draw_heading, draw_undefined_cells, failed_hatch, measure_legend_height,
    sensitive_hatch,
};
use crate::gather::{CellMap, OK_STATUS};
use crate::grid::GridAxis;
use crate::layer::{DividingLimit, Layer, ShownColumn};
use crate::raster::text_width;
use crate::region::roomiest_position;
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
pub(crate) fn draw_map_scene(
    map: &CellMap,
    cuts: &Cuts,
    shown_column: Option<&ShownColumn>,
    overlay: Option<&Overlay>,
) -> Result<Scene> {
    let mut painter = match shown_column {
        Some(shown_column) => CellPainter::by_value(map, shown_column.create_layer(map)?),
        None => CellPainter::by_status(map),
    };
    let grid = &map.grid;

    let panel_columns = match cuts.cuts.len() {
        1 => 1,
        2..=4 => 2,
        _ => 3,
    };
    let panel_rows = cuts.cuts.len().div_ceil(panel_columns);
    let is_single = cuts.cuts.len() == 1;
    let right_margin = if painter.layer.is_some() { RIGHT_MARGIN } else { 24.0 };
    let (gap, name_height) = if is_single { (0.0, 0.0) } else { (22.0, 26.0) };
    let width = (FIGURE_WIDTH - LEFT_MARGIN - right_margin - gap * (panel_columns - 1) as f64)
        / panel_columns as f64;
    let height = if is_single { 440.0 } else { 0.78 * width };
    painter.refine_hatches([width, height]);
    let [column_count, row_count] = [0, 1].map(|k| grid.axes[k].values.len());
    let positions_in_cut = || {
        (0..column_count).flat_map(|x_index| (0..row_count).map(move |y_index| (x_index, y_index)))
    };
    let drawn_cells = cuts.cuts.iter().flat_map(|cut| {
        positions_in_cut()
            .map(|(x_index, y_index)| grid.cell(x_index, y_index, &cut.pick_positions))
    });
    let mut legend_entries = painter.legend_entries(&drawn_cells.collect::<Vec<_>>());
    let axis_scales = [0, 1].map(|k| grid.axes[k].scale());
    if let Some(overlay) = overlay.filter(|overlay| is_within(overlay, axis_scales)) {
        legend_entries.push((LegendSymbol::Line(overlay_stroke()), overlay.name.clone()));
    }
    let legend_height = measure_legend_height(&legend_entries, FIGURE_WIDTH - LEFT_MARGIN - 20.0);
    let panels_height = panel_rows as f64 * (height + name_height) + gap * (panel_rows - 1) as f64;
    let total_height = HEADING_HEIGHT + panels_height + BOTTOM_MARGIN + legend_height + 14.0;

    let [x_axis, y_axis] = [&grid.axes[0], &grid.axes[1]];
    let description = format!("{}: {} over {}", painter.title, y_axis.label(), x_axis.label());
    let mut scene = Scene::new(FIGURE_WIDTH, total_height, description);
    draw_heading(&mut scene, &painter.title, &map_subtitle(map, &cuts.notes));
    for (index, cut) in cuts.cuts.iter().enumerate() {
        let column = index % panel_columns;
        let row = index / panel_columns;
        let panel = Panel {
            x: LEFT_MARGIN + column as f64 * (width + gap),
            y: HEADING_HEIGHT + name_height + row as f64 * (height + name_height + gap),
            width,
            height,
            x_scale: x_axis.scale(),
            y_scale: y_axis.scale(),
        };
        painter.draw(&mut scene, &panel, &cut.pick_positions);
        let layer_and_limit =
            painter.layer.as_ref().and_then(|layer| Some((layer, layer.limit.as_ref()?)));
        let max_points = MAX_LINE_POINTS / cuts.cuts.len();
        let mut lines = layer_and_limit.map_or_else(Vec::new, |layer_and_limit| {
            painter.draw_limit_line(
                &mut scene,
                &panel,
                layer_and_limit,
                &cut.pick_positions,
                max_points,
            )
        });
        if let Some(overlay) = overlay {
            draw_overlay(&mut scene, &panel, overlay);
        }
        // The names of the sides are drawn over the lines, which they interrupt if there is no room
        // beside them.
        if let Some(layer_and_limit) = layer_and_limit {
            let overlay_lines = overlay.iter().flat_map(|overlay| &overlay.lines);
            lines.extend(overlay_lines.map(|line| curve_pixels(&panel, line)));
            painter.name_regions(
                &mut scene,
                &panel,
                layer_and_limit,
                (&cut.pick_positions, &lines),
            );
        }
        let is_lowest = index + panel_columns >= cuts.cuts.len();
        panel.draw_frame(&mut scene, is_lowest, column == 0);
        if let Some(name) = &cut.name {
            let text_position = [panel.x + width / 2.0, panel.y - 8.0];
            scene.draw_text(
                Text::new(name.clone(), text_position, TICK_SIZE)
                    .with_bold_face()
                    .with_anchor(Anchor::Middle),
            );
        }
        if is_lowest {
            panel.draw_x_label(&mut scene, &x_axis.label());
        }
        if column == 0 {
            panel.draw_y_label(&mut scene, &y_axis.label(), 60.0);
        }
    }
    if let Some(layer) = &painter.layer {
        let area = [
            FIGURE_WIDTH - RIGHT_MARGIN + 20.0,
            HEADING_HEIGHT + name_height,
            22.0,
            panels_height - name_height,
        ];
        draw_colour_bar(&mut scene, layer, area);
    }
    let legend_y = HEADING_HEIGHT + panels_height + BOTTOM_MARGIN;
    frame::draw_legend(
        &mut scene,
        &legend_entries,
        LEFT_MARGIN,
        legend_y,
        FIGURE_WIDTH - LEFT_MARGIN - 20.0,
    );
    Ok(scene)
}

/// Returns the stroke of a boundary file's curve.
fn overlay_stroke() -> Stroke {
    Stroke { dash: vec![9.0, 5.0], ..Stroke::new_solid(OVERLAY_COLOUR, 3.0) }
}

/// Draws the curve of a boundary file as far as it lies within the panel.
fn draw_overlay(scene: &mut Scene, panel: &Panel, overlay: &Overlay) {
    let mut outline = Outline::default();
    let mut isolated_points = Vec::new();
    for line in &overlay.lines {
        isolated_points.extend(outline.add_runs(&curve_pixels(panel, line)));
    }
    scene.draw_line(outline.clone(), Stroke::new_solid(PAPER, 5.0));
    scene.draw_line(outline, overlay_stroke());
    for point in isolated_points {
        scene.fill_outline(Outline::circle(point, 4.5), PAPER);
        scene.fill_outline(Outline::circle(point, 3.5), OVERLAY_COLOUR);
    }
}

/// Returns whether a point of a boundary file's curve lies within these scales.
fn is_within(overlay: &Overlay, [x_scale, y_scale]: [AxisScale; 2]) -> bool {
    let is_inside = |&[x, y]: &[f64; 2]| {
        [x_scale.position(x), y_scale.position(y)]
            .iter()
            .all(|position| (0.0..=1.0).contains(position))
    };
    overlay.lines.iter().flatten().any(is_inside)
}

/// Returns the pixels of a curve's points; `None` for points outside the panel and for gaps.
fn curve_pixels(panel: &Panel, line: &[[f64; 2]]) -> Vec<Option<[f64; 2]>> {
    let is_inside = |x: f64, y: f64| {
        [panel.x_scale.position(x), panel.y_scale.position(y)]
            .iter()
            .all(|position| (0.0..=1.0).contains(position))
    };
    line.iter().map(|&[x, y]| is_inside(x, y).then(|| panel.pixel(x, y))).collect()
}

/// Returns the subtitle: the name of the run, the number of points and of failed ones, and notes on
/// fixed, omitted or merged values.
pub(crate) fn map_subtitle(map: &CellMap, notes: &[String]) -> String {
    let source = &map.table.source;
    let mut phrases = source.notes([format!("{} points", source.rows)]);
    let failed_rows = map.count_failed();
    if failed_rows > 0 {
        phrases.push(format!("{failed_rows} failed"));
    }
    phrases.extend(notes.iter().cloned());
    phrases.extend(map.grid.merge_note());
    phrases.join(" · ")
}

/// Returns the legend of all cells by a layer, or by status without one.
pub(crate) fn map_legend_entries(
    map: &CellMap,
    layer: Option<Layer>,
) -> Vec<(LegendSymbol, String)> {
    let painter = layer
        .map_or_else(|| CellPainter::by_status(map), |layer| CellPainter::by_value(map, layer));
    painter.legend_entries(&(0..map.point_counts.len()).collect::<Vec<_>>())
}

/// Returns the colour of each status.
pub(crate) fn status_colours(map: &CellMap) -> BTreeMap<String, String> {
    let painter = CellPainter::by_status(map);
    let name_and_colour =
        |index: usize| (painter.status_counts[index].0.clone(), painter.status_colour(index).css());
    (0..painter.status_counts.len()).map(name_and_colour).collect()
}

/// Returns the lines of a limit in several cuts of a map, in values of its axes, with at most
/// `max_points` points. If a ragged boundary has more, its shortest lines are left out: the cells
/// on either side show them. `cell` maps a cut and its indices along both axes to a cell.
pub(crate) fn limit_lines(
    map: &CellMap,
    (layer, limit): (&Layer, &DividingLimit),
    cuts: usize,
    cell: impl Fn(usize, usize, usize) -> usize,
    max_points: usize,
) -> Vec<Vec<Vec<[f64; 2]>>> {
    let [x_axis, y_axis] = [&map.grid.axes[0], &map.grid.axes[1]];
    let cut_lines = |cut: usize| {
        zero_lines(&x_axis.coordinates(), &y_axis.coordinates(), |x, y| {
            let cell = cell(cut, x, y);
            limit.offset(if map.has_points(cell) { layer.mean_value(cell) } else { f64::NAN })
        })
    };
    let mut lines: Vec<Vec<Vec<[f64; 2]>>> = (0..cuts).map(cut_lines).collect();
    remove_shortest_lines(&mut lines, max_points);
    for [x, y] in lines.iter_mut().flatten().flatten() {
        (*x, *y) = (x_axis.swept_axis.from_coordinate(*x), y_axis.swept_axis.from_coordinate(*y));
    }
    lines
}

/// The filling of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum CellFill {
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
    cell_fills: Vec<Option<CellFill>>,
    layer: Option<Layer>,
    /// The statuses that [`CellFill::Status`] refers to, with the number of points of each.
    status_counts: Vec<(String, usize)>,
    /// The hatch of cells in which some points have no value, and that of cells with sensitive
    /// points.
    hatches: [Hatch; 2],
}

impl<'a> CellPainter<'a> {
    fn new(map: &'a CellMap, title: String, cell_fill: impl Fn(usize) -> CellFill) -> Self {
        let cell_fill = |cell: usize| map.has_points(cell).then(|| cell_fill(cell));
        let cell_fills = (0..map.point_counts.len()).map(cell_fill).collect();
        let hatches = [failed_hatch(), sensitive_hatch()];
        Self { map, title, cell_fills, layer: None, status_counts: Vec::new(), hatches }
    }

    fn by_value(map: &'a CellMap, layer: Layer) -> Self {
        let cell_fill = |cell: usize| match (
            layer.values[cell].is_finite(),
            map.point_counts[cell].failed_points,
        ) {
            (true, _) if layer.is_divided(cell) => CellFill::Both,
            (true, _) => CellFill::Step(layer.scale.step_index(layer.values[cell])),
            (false, 0) => CellFill::Undefined,
            (false, _) => CellFill::Failed,
        };
        let painter = Self::new(map, layer.title.clone(), cell_fill);
        Self { layer: Some(layer), ..painter }
    }

    fn by_status(map: &'a CellMap) -> Self {
        let mut status_counts: Vec<(String, usize)> =
            map.rows_by_status.iter().map(|(name, points)| (name.clone(), *points)).collect();
        status_counts.sort_by_key(|(name, _)| (name != OK_STATUS, name.clone()));
        let cell_fill = |cell: usize| {
            map.common_status(cell).map_or(CellFill::Both, |status| {
                CellFill::Status(
                    status_counts.iter().position(|(name, _)| name == status).unwrap_or_default(),
                )
            })
        };
        let painter = Self::new(map, "How each point ended".to_owned(), cell_fill);
        Self { status_counts, ..painter }
    }

    /// Makes hatches fine enough to be visible on the smallest cell of a panel of this size, px.
    fn refine_hatches(&mut self, panel_size: [f64; 2]) {
        let smallest_cell = [0, 1].map(|k| {
            let axis = &self.map.grid.axes[k];
            let scale = axis.scale();
            let cell_extent = |pair: &[f64]| scale.position(pair[1]) - scale.position(pair[0]);
            axis.borders.windows(2).map(cell_extent).fold(1.0, f64::min) * panel_size[k]
        });
        self.hatches = self.hatches.clone().map(|hatch| hatch.with_spacing_for(smallest_cell));
    }

    fn status_colour(&self, index: usize) -> Colour {
        if self.status_counts[index].0 == OK_STATUS {
            Colour::hex(0xe8ebee)
        } else {
            DISTINCT_COLOURS[index % DISTINCT_COLOURS.len()]
        }
    }

    fn draw(&self, scene: &mut Scene, panel: &Panel, cut_indices: &[usize]) {
        // Cells of one colour are one shape, and runs of them along y one rectangle: the file is
        // small and has no seams.
        let mut outlines_by_fill: BTreeMap<CellFill, Outline> = BTreeMap::new();
        let mut undefined_areas: Vec<[f64; 4]> = Vec::new();
        let fill_at = |cell: usize| self.cell_fills[cell];
        let is_undefined = |fill_at| fill_at == Some(CellFill::Undefined);
        for ([x, y, width, height], fill_at) in
            self.strips(panel, cut_indices, fill_at, is_undefined)
        {
            match fill_at {
                Some(CellFill::Undefined) => undefined_areas.push([x, y, width, height]),
                Some(fill_at) => {
                    outlines_by_fill.entry(fill_at).or_default().add_rectangle(x, y, width, height)
                }
                None => {}
            }
        }
        for (fill_at, shape) in outlines_by_fill {
            match (fill_at, &self.layer) {
                (CellFill::Step(step), Some(layer)) => {
                    scene.fill_crisply(shape, layer.scale.colour(step))
                }
                (CellFill::Status(status), _) => {
                    scene.fill_crisply(shape, self.status_colour(status))
                }
                (CellFill::Both, _) => scene.fill_crisply(shape, BOTH_SIDES_COLOUR),
                _ => draw_failed_area(scene, shape),
            }
        }
        if !undefined_areas.is_empty() {
            draw_undefined_cells(scene, &undefined_areas);
        }
        scene.fill_with_hatch(
            self.cell_area(panel, cut_indices, |cell| self.has_missing_values(cell)),
            &self.hatches[0],
        );
        scene.fill_with_hatch(
            self.cell_area(panel, cut_indices, |cell| self.is_sensitive(cell)),
            &self.hatches[1],
        );
    }

    /// Returns the outline of the cells for which `is_included` is true.
    fn cell_area(
        &self,
        panel: &Panel,
        cut_indices: &[usize],
        is_included: impl Fn(usize) -> bool,
    ) -> Outline {
        let mut area = Outline::default();
        for ([x, y, width, height], is_included) in
            self.strips(panel, cut_indices, is_included, |_| false)
        {
            if is_included {
                area.add_rectangle(x, y, width, height);
            }
        }
        area
    }

    /// Returns rectangles `[x, y, width, height]` (px) of runs of cells along y with the same
    /// content. A cell for whose content `is_separate` is true has its own rectangle.
    fn strips<T: Copy + PartialEq>(
        &self,
        panel: &Panel,
        cut_indices: &[usize],
        content: impl Fn(usize) -> T,
        is_separate: impl Fn(T) -> bool,
    ) -> Vec<([f64; 4], T)> {
        let [x_axis, y_axis] = [&self.map.grid.axes[0], &self.map.grid.axes[1]];
        let ys: Vec<f64> = y_axis.borders.iter().map(|&border| panel.y_pixel(border)).collect();
        let mut strips = Vec::new();
        for (x, borders) in x_axis.borders.windows(2).enumerate() {
            let left_x = panel.x_pixel(borders[0]);
            let right_x = panel.x_pixel(borders[1]);
            let content_at = |y: usize| content(self.map.grid.cell(x, y, cut_indices));
            let mut start = 0;
            while start + 1 < ys.len() {
                let first_content = content_at(start);
                let mut end = start + 1;
                while !is_separate(first_content)
                    && end + 1 < ys.len()
                    && content_at(end) == first_content
                {
                    end += 1;
                }
                strips.push((
                    [left_x, ys[end], right_x - left_x, ys[start] - ys[end]],
                    first_content,
                ));
                start = end;
            }
        }
        strips
    }

    /// Returns whether a cell has points that failed or have no value beside others with a value.
    fn has_missing_values(&self, cell: usize) -> bool {
        matches!(self.cell_fills[cell], Some(CellFill::Step(_) | CellFill::Both))
            && self
                .layer
                .as_ref()
                .is_some_and(|layer| self.has_failed(cell) || layer.has_undefined(cell))
    }

    fn has_failed(&self, cell: usize) -> bool {
        self.map.point_counts[cell].failed_points > 0
    }

    /// Returns whether a cell's colour depends on a chaotic motion.
    fn is_sensitive(&self, cell: usize) -> bool {
        self.layer.as_ref().is_some_and(|layer| layer.is_nonlinear)
            && self.map.point_counts[cell].sensitive_points > 0
    }

    /// Draws the lines of the limit with at most `max_points` points. Returns their points, px.
    fn draw_limit_line(
        &self,
        scene: &mut Scene,
        panel: &Panel,
        layer_and_limit: (&Layer, &DividingLimit),
        cut_indices: &[usize],
        max_points: usize,
    ) -> Vec<Vec<Option<[f64; 2]>>> {
        let cell = |_, x, y| self.map.grid.cell(x, y, cut_indices);
        let lines =
            limit_lines(self.map, layer_and_limit, 1, cell, max_points).into_iter().flatten();
        let mut outline = Outline::default();
        let lines = lines.map(|line| {
            let pixels: Vec<[f64; 2]> = line.iter().map(|&[x, y]| panel.pixel(x, y)).collect();
            outline.add_line(&pixels);
            pixels.into_iter().map(Some).collect()
        });
        let lines = lines.collect();
        scene.draw_line(outline.clone(), Stroke::new_solid(PAPER, 5.0));
        scene.draw_line(outline, Stroke::new_solid(INK, 2.6));
        lines
    }

    fn name_regions(
        &self,
        scene: &mut Scene,
        panel: &Panel,
        (layer, limit): (&Layer, &DividingLimit),
        (cut_indices, lines): (&[usize], &[Vec<Option<[f64; 2]>>]),
    ) {
        let cell_index_at = |axis: &GridAxis, scale: AxisScale, fraction: f64| {
            let index = axis.borders.partition_point(|&border| scale.position(border) <= fraction);
            index.clamp(1, axis.borders.len() - 1) - 1
        };
        let axes = &self.map.grid.axes;
        let limit_offset = |[x, y]: [f64; 2]| {
            let x = cell_index_at(&axes[0], panel.x_scale, x / panel.width);
            let y = cell_index_at(&axes[1], panel.y_scale, 1.0 - y / panel.height);
            let cell = self.map.cell(x, y, cut_indices).filter(|&cell| !layer.is_divided(cell));
            limit.offset(cell.map_or(f64::NAN, |cell| layer.values[cell]))
        };
        for (name, wanted_above) in
            [(&limit.above_meanings[0], true), (&limit.below_meanings[0], false)]
        {
            // A cell without a value lies on neither side.
            let is_inside = |point: [f64; 2]| {
                let limit_offset = limit_offset(point);
                limit_offset.is_finite() && (limit_offset >= 0.0) == wanted_above
            };
            let name_size = [text_width(name, LABEL_SIZE, true) + 10.0, LABEL_SIZE + 8.0];
            let panel_size = [panel.width, panel.height];
            // A name is kept away from the lines if there is room.
            let is_clear = |point: [f64; 2]| is_inside(point) && !is_near_line(panel, lines, point);
            let name_position = roomiest_position(panel_size, name_size, is_clear)
                .or_else(|| roomiest_position(panel_size, name_size, is_inside));
            if let Some([x, y]) = name_position {
                let text_position = [panel.x + x, panel.y + y + 0.35 * LABEL_SIZE];
                let text = Text::new(name, text_position, LABEL_SIZE)
                    .with_bold_face()
                    .with_anchor(Anchor::Middle);
                scene.draw_text(Text { halo: Some(PAPER), ..text });
            }
        }
    }

    /// Returns the legend of the cells that are drawn.
    fn legend_entries(&self, drawn_cells: &[usize]) -> Vec<(LegendSymbol, String)> {
        let mut entries = Vec::new();
        let is_any_drawn =
            |condition: &dyn Fn(usize) -> bool| drawn_cells.iter().any(|&cell| condition(cell));
        let is_fill_drawn =
            |fill: CellFill| is_any_drawn(&|cell| self.cell_fills[cell] == Some(fill));
        if let Some(Layer { limit: Some(limit), scale, .. }) = &self.layer {
            let colour_at_quarter = |quarters: usize| scale.colour(quarters * COLOUR_STEPS / 4);
            // Cells whose points are all on one side have no line between them.
            let limit_offset = |cell: usize| {
                self.layer.as_ref().map_or(f64::NAN, |layer| limit.offset(layer.mean_value(cell)))
            };
            if is_any_drawn(&|cell| limit_offset(cell) >= 0.0)
                && is_any_drawn(&|cell| limit_offset(cell) < 0.0)
            {
                entries.push((
                    LegendSymbol::Line(Stroke::new_solid(INK, 2.6)),
                    limit.line_name.clone(),
                ));
            }
            entries
                .push((LegendSymbol::Area(colour_at_quarter(3)), limit.above_meanings[1].clone()));
            entries
                .push((LegendSymbol::Area(colour_at_quarter(1)), limit.below_meanings[1].clone()));
            if is_fill_drawn(CellFill::Both) {
                entries.push((LegendSymbol::Area(BOTH_SIDES_COLOUR), limit.both_meaning.clone()));
            }
        }
        for (index, (name, points)) in self.status_counts.iter().enumerate() {
            let text = format!("{} ({points})", name.replace('_', " "));
            entries.push((LegendSymbol::Area(self.status_colour(index)), text));
        }
        if self.layer.is_none() && is_fill_drawn(CellFill::Both) {
            entries.push((
                LegendSymbol::Area(BOTH_SIDES_COLOUR),
                "points of several kinds".to_owned(),
            ));
        }
        let has_only_failed = |cell: usize| {
            self.map.point_counts[cell].failed_points == self.map.point_counts[cell].points
        };
        if is_any_drawn(&|cell| {
            self.cell_fills[cell] == Some(CellFill::Failed) && !has_only_failed(cell)
        }) {
            entries.push((LegendSymbol::Failed, "no result: failed or undefined".to_owned()));
        } else if is_fill_drawn(CellFill::Failed) {
            entries.push((LegendSymbol::Failed, "failed: no result".to_owned()));
        }
        if is_any_drawn(&|cell| self.has_missing_values(cell)) {
            let is_any_failed =
                is_any_drawn(&|cell| self.has_missing_values(cell) && self.has_failed(cell));
            let is_undefined =
                |cell| self.layer.as_ref().is_some_and(|layer| layer.has_undefined(cell));
            let is_any_undefined =
                is_any_drawn(&|cell| self.has_missing_values(cell) && is_undefined(cell));
            let phrase = match (is_any_failed, is_any_undefined) {
                (true, false) => "some points failed",
                (true, true) => "some points failed or undefined",
                (false, _) => "some points undefined",
            };
            entries.push((LegendSymbol::Hatched(self.hatches[0].clone()), phrase.to_owned()));
        }
        if is_any_drawn(&|cell| self.is_sensitive(cell)) {
            let phrase = if self.map.grid.merges_points() {
                "some points sensitive: chaotic"
            } else {
                "sensitive: motion is chaotic"
            };
            entries.push((LegendSymbol::Hatched(self.hatches[1].clone()), phrase.to_owned()));
        }
        if is_fill_drawn(CellFill::Undefined) {
            entries.push((LegendSymbol::Undefined, "undefined: no excitation".to_owned()));
        }
        entries
    }
}

/// Returns whether a point of a panel (px from its corner) is closer to a line than neighbouring
/// samples are to each other in the search for a name's position.
fn is_near_line(panel: &Panel, lines: &[Vec<Option<[f64; 2]>>], [x, y]: [f64; 2]) -> bool {
    let point = [panel.x + x, panel.y + y];
    let max_distance = (panel.width / 44.0).max(panel.height / 33.0);
    let is_near_segment = |from: [f64; 2], to: [f64; 2]| {
        let [[dx, px], [dy, py]] = [0, 1].map(|k| [to[k] - from[k], point[k] - from[k]]);
        let squared_length = (dx * dx + dy * dy).max(f64::MIN_POSITIVE);
        let fraction = ((px * dx + py * dy) / squared_length).clamp(0.0, 1.0);
        (px - fraction * dx).hypot(py - fraction * dy) < max_distance
    };
    let pixel_pairs = lines.iter().flat_map(|line| line.windows(2));
    let mut segments = pixel_pairs.filter_map(|pair| pair[0].zip(pair[1]));
    segments.any(|(from, to)| is_near_segment(from, to))
}

fn draw_colour_bar(scene: &mut Scene, layer: &Layer, [x, y, width, height]: [f64; 4]) {
    let step_height = height / COLOUR_STEPS as f64;
    for step in 0..COLOUR_STEPS {
        let step_top = y + height - (step + 1) as f64 * step_height;
        scene.fill_crisply(
            Outline::rectangle(x, step_top, width, step_height),
            layer.scale.colour(step),
        );
    }
    scene.draw_line(Outline::rectangle(x, y, width, height), Stroke::new_solid(INK, 1.2));
    let mut marks = Outline::default();
    for tick in layer.scale.ticks() {
        let tick_y = y + (1.0 - layer.scale.position(tick.value)) * height;
        marks.add_line(&[[x + width, tick_y], [x + width + 5.0, tick_y]]);
        let is_centre = layer.scale.centre == Some(tick.value);
        let text = Text::new(tick.label, [x + width + 8.0, tick_y + 0.35 * TICK_SIZE], TICK_SIZE);
        scene.draw_text(if is_centre { text.with_bold_face() } else { text });
        if is_centre {
            marks.add_line(&[[x, tick_y], [x + width, tick_y]]);
        }
    }
    scene.draw_line(marks, Stroke::new_solid(INK, 1.4));
    let label_position = [x + width + 72.0, y + height / 2.0];
    scene.draw_text(
        Text::new(layer.label.clone(), label_position, TICK_SIZE)
            .with_anchor(Anchor::Middle)
            .with_rotation(),
    );
}
