//! The scatter matrix of a design: its points over every pair of parameters, and the quantity over
//! each parameter.

use crate::axis::{AxisScale, extremes};
use crate::chart::level_stroke;
use crate::colour::{BAD_SIDE_COLOUR, GOOD_SIDE_COLOUR};
use crate::frame::{
    BOTTOM_MARGIN, FIGURE_WIDTH, HEADING_HEIGHT, LABEL_SIZE, LegendSymbol, Panel, draw_heading,
    draw_legend, measure_legend_height,
};
use crate::label::Label;
use crate::layer::DividingLimit;
use crate::raster::text_width;
use crate::scatter::{Scatter, Side};
use crate::scene::{Colour, INK, MUTED_COLOUR, Outline, Scene, Stroke};

/// Maximum number of parameters shown. Basis: with more, panels are too small to read.
pub(crate) const MAX_MATRIX_PARAMETERS: usize = 5;
/// Approximate maximum number of points that are drawn. Basis: more points overlap. Doubling it
/// doubles the size of the figure.
pub(crate) const MAX_DRAWN_POINTS: usize = 4000;

/// Left margin for the numbers and labels of the y axes, px.
const LEFT_MARGIN: f64 = 100.0;
/// Right margin, px.
const RIGHT_MARGIN: f64 = 24.0;
/// Gap between two panels, px.
const PANEL_GAP: f64 = 20.0;
/// Maximum height of a panel, px.
const MAX_PANEL_HEIGHT: f64 = 330.0;

/// An axis of the scatter matrix: a parameter or the quantity.
pub(crate) struct MatrixAxis<'a> {
    /// The parameter's name in grid files; empty for the quantity.
    pub(crate) name: &'a str,
    pub(crate) label: &'a Label,
    pub(crate) values: &'a [f64],
    pub(crate) scale: AxisScale,
}

/// Returns the indices of the parameters shown in file order: all, or the most influential.
pub(crate) fn shown_parameters(scatter: &Scatter) -> Vec<usize> {
    let mut indices = scatter.indices_by_influence();
    indices.truncate(MAX_MATRIX_PARAMETERS);
    indices.sort_unstable();
    indices
}

/// Returns the notes on parameters and points that are left out.
pub(crate) fn matrix_notes(scatter: &Scatter) -> Vec<String> {
    let parameter_count = scatter.parameters.len();
    let shown_count = shown_parameters(scatter).len();
    let mut notes = Vec::new();
    if shown_count < parameter_count {
        notes.push(format!("the {shown_count} most influential of {parameter_count} parameters"));
    }
    let drawn_count = drawn_point_indices(scatter).len();
    if drawn_count < scatter.point_rows.len() {
        notes.push(format!("{drawn_count} drawn"));
    }
    notes
}

/// Returns the indices of the points drawn.
pub(crate) fn drawn_point_indices(scatter: &Scatter) -> Vec<usize> {
    let stride = scatter.point_rows.len().div_ceil(MAX_DRAWN_POINTS).max(1);
    scatter.pick_points(stride)
}

/// Returns the scale of some values, with a margin for the dots at its ends.
pub(crate) fn scale_with_margin(values: &[f64], is_log: bool) -> AxisScale {
    if !is_log {
        return AxisScale::around_values(values.iter().copied());
    }
    let positive_values = values.iter().copied().filter(|value| *value > 0.0);
    let (low, high) = extremes(positive_values).unwrap_or((1.0, 10.0));
    let margin_factor = (high / low).powf(0.05).max(1.02);
    AxisScale::logarithmic(low / margin_factor, high * margin_factor)
}

/// Returns the axes of the matrix: the parameters, and last the quantity.
pub(crate) fn matrix_axes(scatter: &Scatter) -> Vec<MatrixAxis<'_>> {
    let parameters = shown_parameters(scatter).into_iter().map(|k| &scatter.parameters[k]);
    let parameters = parameters.map(|parameter| {
        (&parameter.name[..], &parameter.label, &parameter.values[..], parameter.is_log)
    });
    let parameters_and_quantity = parameters.chain([(
        "",
        &scatter.short_label,
        &scatter.quantity_values[..],
        scatter.is_log,
    )]);
    let matrix_axis = |(name, label, values, is_log)| {
        let scale = scale_with_margin(values, is_log);
        MatrixAxis { name, label, values, scale }
    };
    parameters_and_quantity.map(matrix_axis).collect()
}

/// The panels of the matrix, each by the indices of its x and y axis, and its left and top edge,
/// width and height, px.
pub(crate) type PanelPositions = Vec<(usize, usize, f64, f64, f64, f64)>;

/// Draws the matrix: every pair of parameters below its diagonal, and the quantity in its last row.
pub(crate) fn draw_matrix(scatter: &Scatter) -> (Scene, PanelPositions) {
    let axes = matrix_axes(scatter);
    let parameters = &axes[..axes.len() - 1];
    let parameter_count = parameters.len();
    let width =
        (FIGURE_WIDTH - LEFT_MARGIN - RIGHT_MARGIN - PANEL_GAP * (parameter_count - 1) as f64)
            / parameter_count as f64;
    let height = (0.8 * width).clamp(130.0, MAX_PANEL_HEIGHT);
    let legend_entries = legend_entries(scatter);
    let legend_width = FIGURE_WIDTH - LEFT_MARGIN - RIGHT_MARGIN;
    let legend_height = measure_legend_height(&legend_entries, legend_width);
    let label_lines = parameters.iter().map(|axis| wrap_label(axis.label, width).len()).max();
    let space_below =
        BOTTOM_MARGIN + 1.2 * LABEL_SIZE * label_lines.unwrap_or(1).saturating_sub(1) as f64;
    let panels_height = parameter_count as f64 * (height + PANEL_GAP) - PANEL_GAP;
    let total_height = HEADING_HEIGHT + panels_height + space_below + legend_height + 8.0;
    let title = &scatter.title;
    let subtitle = scatter.subtitle(&matrix_notes(scatter));
    let mut scene = Scene::new(FIGURE_WIDTH, total_height, format!("{title}. {subtitle}"));
    draw_heading(&mut scene, title, &subtitle);
    let dots = Dots::new(scatter, width);
    let mut positions = PanelPositions::new();
    for row in 0..parameter_count {
        let is_last_row = row + 1 == parameter_count;
        let y = &axes[row + 1];
        for (column, x) in
            parameters.iter().enumerate().take(if is_last_row { parameter_count } else { row + 1 })
        {
            let panel = Panel {
                x: LEFT_MARGIN + column as f64 * (width + PANEL_GAP),
                y: HEADING_HEIGHT + row as f64 * (height + PANEL_GAP),
                width,
                height,
                x_scale: x.scale,
                y_scale: y.scale,
            };
            positions.push((column, row + 1, panel.x, panel.y, width, height));
            panel.draw_grid_lines(&mut scene);
            scene.draw_clipped(panel.outline(), |scene| {
                if let (true, Some(limit)) = (is_last_row, &scatter.limit) {
                    let limit_y = panel.y_pixel(limit.value);
                    let limit_line =
                        Outline::line(&[[panel.x, limit_y], [panel.x + width, limit_y]]);
                    scene.draw_line(limit_line, level_stroke());
                }
                dots.draw(scene, &panel, x.values, y.values);
            });
            panel.draw_frame_beside_neighbours(&mut scene, is_last_row, column == 0);
            if is_last_row {
                draw_x_label(&mut scene, &panel, x.label);
            }
            if column == 0 {
                panel.draw_y_label(&mut scene, &y.label.to_string(), 66.0);
            }
        }
    }
    let y = HEADING_HEIGHT + panels_height + space_below;
    draw_legend(&mut scene, &legend_entries, LEFT_MARGIN, y, legend_width);
    (scene, positions)
}

/// Breaks a label into lines that fit below a panel; its unit stays on one line.
fn wrap_label(label: &Label, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let unit = (!label.unit.is_empty()).then(|| format!("({})", label.unit));
    for word in label.words.split(' ').chain(unit.as_deref()) {
        let longer_line = lines.last().map(|line| format!("{line} {word}"));
        match longer_line {
            Some(longer_line) if text_width(&longer_line, LABEL_SIZE, false) <= width => {
                lines.pop();
                lines.push(longer_line);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

fn draw_x_label(scene: &mut Scene, panel: &Panel, label: &Label) {
    for (k, line) in wrap_label(label, panel.width).iter().enumerate() {
        let panel_below = Panel { y: panel.y + 1.2 * LABEL_SIZE * k as f64, ..panel.clone() };
        panel_below.draw_x_label(scene, line);
    }
}

/// Returns the colour of a side.
pub(crate) const fn side_colour(side: Side) -> Colour {
    match side {
        Side::Good => GOOD_SIDE_COLOUR,
        Side::Bad => BAD_SIDE_COLOUR,
        Side::Undefined => MUTED_COLOUR,
        Side::Failed => INK,
    }
}

/// The dots of a design's points: shapes differ as well as colours.
struct Dots {
    /// The indices of the points drawn, by side.
    indices_by_side: Vec<(Side, Vec<usize>)>,
    /// Half the size of a dot, px.
    radius: f64,
}

impl Dots {
    fn new(scatter: &Scatter, width: f64) -> Self {
        let indices = drawn_point_indices(scatter);
        let points_on_side =
            |side: Side| indices.iter().copied().filter(|&k| scatter.sides[k] == side).collect();
        let indices_by_side =
            Side::ALL.into_iter().map(|side| (side, points_on_side(side))).collect();
        // Dots cover a quarter of the panel's area at most.
        let radius = (0.25 * width / (indices.len().max(1) as f64).sqrt()).clamp(1.1, 3.4);
        Self { indices_by_side, radius }
    }

    /// Draws the dots of a panel. Points without a value lie at its lower edge, so that failures
    /// are visible over their parameter.
    fn draw(&self, scene: &mut Scene, panel: &Panel, xs: &[f64], ys: &[f64]) {
        for (side, indices) in &self.indices_by_side {
            let mut outline = Outline::default();
            let has_no_value = matches!(side, Side::Failed | Side::Undefined);
            for &k in indices {
                let y = if ys[k].is_finite() {
                    panel.y_pixel(ys[k])
                } else {
                    panel.y + panel.height - 5.0
                };
                if xs[k].is_finite() && (has_no_value || ys[k].is_finite()) {
                    add_dot(&mut outline, *side, [panel.x_pixel(xs[k]), y], self.radius);
                }
            }
            if outline.0.is_empty() {
                continue;
            }
            match side {
                Side::Good | Side::Bad => {
                    scene.fill_outline(outline, side_colour(*side).with_alpha(210))
                }
                Side::Undefined | Side::Failed => {
                    scene.draw_line(outline, Stroke::new_solid(side_colour(*side), 1.2));
                }
            }
        }
    }
}

/// Adds a dot of a side: a round dot, a diamond, a ring or a cross.
fn add_dot(outline: &mut Outline, side: Side, [x, y]: [f64; 2], radius: f64) {
    match side {
        Side::Good | Side::Undefined => {
            let near_offset = 0.414 * radius;
            let far_offset = radius;
            let corners = [
                [near_offset, far_offset],
                [far_offset, near_offset],
                [far_offset, -near_offset],
                [near_offset, -far_offset],
                [-near_offset, -far_offset],
                [-far_offset, -near_offset],
                [-far_offset, near_offset],
                [-near_offset, far_offset],
            ];
            outline.add_polygon(&corners.map(|[dx, dy]| [x + dx, y + dy]));
        }
        Side::Bad => {
            let half_diagonal = 1.25 * radius;
            outline.add_polygon(&[
                [x + half_diagonal, y],
                [x, y + half_diagonal],
                [x - half_diagonal, y],
                [x, y - half_diagonal],
            ]);
        }
        Side::Failed => {
            let half_diagonal = radius.max(2.5);
            outline.add_line(&[
                [x - half_diagonal, y - half_diagonal],
                [x + half_diagonal, y + half_diagonal],
            ]);
            outline.add_line(&[
                [x - half_diagonal, y + half_diagonal],
                [x + half_diagonal, y - half_diagonal],
            ]);
        }
    }
}

fn legend_entries(scatter: &Scatter) -> Vec<(LegendSymbol, String)> {
    let mut entries = Vec::new();
    for (side, count) in Side::ALL.into_iter().zip(scatter.side_counts) {
        if count > 0 {
            let entry_text = format!("{} ({count})", scatter.side_meaning(side));
            entries.push((side_symbol(side), entry_text));
        }
    }
    let quantity_scale = scale_with_margin(&scatter.quantity_values, scatter.is_log);
    let is_drawn =
        |limit: &&DividingLimit| (0.0..=1.0).contains(&quantity_scale.position(limit.value));
    if let Some(limit) = scatter.limit.as_ref().filter(is_drawn) {
        entries.push((LegendSymbol::Line(level_stroke()), limit.line_name.clone()));
    }
    entries
}

/// Returns the legend symbol of a side.
fn side_symbol(side: Side) -> LegendSymbol {
    let mut outline = Outline::default();
    add_dot(&mut outline, side, [0.0, 0.0], 5.0);
    LegendSymbol::Shape(outline, matches!(side, Side::Good | Side::Bad), side_colour(side))
}
