//! Parts that all figures share: panels with axes, headings and legends.

use super::axis::{AxisScale, Tick};
use super::colour::FAILED_COLOUR;
use super::raster::text_width;
use super::scene::{
    Anchor, Colour, FAINT_COLOUR, Hatch, INK, MUTED_COLOUR, Outline, PAPER, Scene, Stroke, Text,
};

/// Width of a figure, px. Basis: a figure across a page. Twice the width halves the type in print.
pub(crate) const FIGURE_WIDTH: f64 = 880.0;
/// Margin below panels for the numbers and the label of the x axis, px.
pub(crate) const BOTTOM_MARGIN: f64 = 64.0;

/// Type size of titles, px. Basis: legible at half a figure's size.
pub(crate) const TITLE_SIZE: f64 = 20.0;
/// Type size of axis labels, legends and panel texts, px.
pub(crate) const LABEL_SIZE: f64 = 16.0;
/// Type size of the numbers at ticks and of subtitles, px.
pub(crate) const TICK_SIZE: f64 = 14.5;

/// Maximum overhang of the numbers at an x axis beyond its ends, px.
const NUMBER_OVERHANG: f64 = 7.0;
/// Minimum gap between two numbers at an x axis, px.
const NUMBER_GAP: f64 = 6.0;

/// A rectangle of a figure with an x and a y scale.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Panel {
    /// The left edge, px.
    pub(crate) x: f64,
    /// The top edge, px.
    pub(crate) y: f64,
    pub(crate) width: f64,
    pub(crate) height: f64,
    /// The scale from left to right.
    pub(crate) x_scale: AxisScale,
    /// The scale from bottom to top.
    pub(crate) y_scale: AxisScale,
}

impl Panel {
    /// Returns the pixel of a pair of values.
    pub(crate) fn pixel(&self, x: f64, y: f64) -> [f64; 2] {
        [self.x_pixel(x), self.y_pixel(y)]
    }

    /// Returns the horizontal pixel of an x value.
    pub(crate) fn x_pixel(&self, x: f64) -> f64 {
        self.x + self.x_scale.position(x) * self.width
    }

    /// Returns the vertical pixel of a y value.
    pub(crate) fn y_pixel(&self, y: f64) -> f64 {
        self.y + (1.0 - self.y_scale.position(y)) * self.height
    }

    /// Returns the edge of the panel.
    pub(crate) fn outline(&self) -> Outline {
        Outline::rectangle(self.x, self.y, self.width, self.height)
    }

    fn x_ticks(&self) -> Vec<Tick> {
        self.x_scale.ticks((self.width / 75.0) as usize)
    }

    fn y_ticks(&self) -> Vec<Tick> {
        self.y_scale.ticks((self.height / 36.0).max(3.0) as usize)
    }

    /// Draws faint lines at the ticks; the data is drawn over them.
    pub(crate) fn draw_grid_lines(&self, scene: &mut Scene) {
        let mut lines = Outline::default();
        for tick in self.x_ticks() {
            let x = self.x_pixel(tick.value);
            lines.add_line(&[[x, self.y], [x, self.y + self.height]]);
        }
        for tick in self.y_ticks() {
            let y = self.y_pixel(tick.value);
            lines.add_line(&[[self.x, y], [self.x + self.width, y]]);
        }
        scene.draw_line(lines, Stroke::new_solid(FAINT_COLOUR, 1.0));
    }

    /// Returns the numbers at the x axis that fit, with their centres (px): those at every tick, or
    /// at every second one, and so on. Numbers at the ends do not reach into neighbouring panels.
    fn numbers_that_fit(&self) -> Vec<(f64, String)> {
        let placed_numbers = self.x_ticks().into_iter().map(|tick| {
            let width = text_width(&tick.label, TICK_SIZE, false);
            let left_limit = self.x - NUMBER_OVERHANG;
            let right_limit = self.x + self.width + NUMBER_OVERHANG;
            let middle = self
                .x_pixel(tick.value)
                .min(right_limit - width / 2.0)
                .max(left_limit + width / 2.0);
            (middle, width, tick.label)
        });
        let placed_numbers: Vec<_> = placed_numbers.collect();
        let select_numbers =
            |stride: usize, first: usize| placed_numbers.iter().skip(first).step_by(stride);
        let labels_fit = |&(stride, first): &(usize, usize)| {
            select_numbers(stride, first).zip(select_numbers(stride, first).skip(1)).all(
                |(number, next_number)| {
                    (next_number.0 - number.0).abs()
                        >= (number.1 + next_number.1) / 2.0 + NUMBER_GAP
                },
            )
        };
        let candidates =
            (1..=placed_numbers.len()).flat_map(|stride| (0..stride).map(move |k| (stride, k)));
        let best_selection = candidates.filter(labels_fit).max_by_key(|&(stride, first)| {
            (select_numbers(stride, first).count(), std::cmp::Reverse((stride, first)))
        });
        let Some((stride, first)) = best_selection else { return Vec::new() };
        select_numbers(stride, first).map(|(middle, _, number)| (*middle, number.clone())).collect()
    }

    /// Draws the edge, ticks and numbers. An axis shared with the panel below or to the left has no
    /// numbers here.
    pub(crate) fn draw_frame(&self, scene: &mut Scene, has_x_numbers: bool, has_y_numbers: bool) {
        let numbers = self.x_ticks().into_iter().map(|tick| (self.x_pixel(tick.value), tick.label));
        self.draw_frame_with(scene, numbers.filter(|_| has_x_numbers).collect(), has_y_numbers);
    }

    /// Draws the same as [`Self::draw_frame`] for a panel with close neighbours: numbers that would
    /// touch are left out.
    pub(crate) fn draw_frame_beside_neighbours(
        &self,
        scene: &mut Scene,
        has_x_numbers: bool,
        has_y_numbers: bool,
    ) {
        let numbers = if has_x_numbers { self.numbers_that_fit() } else { Vec::new() };
        self.draw_frame_with(scene, numbers, has_y_numbers);
    }

    fn draw_frame_with(
        &self,
        scene: &mut Scene,
        x_numbers: Vec<(f64, String)>,
        has_y_numbers: bool,
    ) {
        let bottom_y = self.y + self.height;
        let stroke = Stroke::new_solid(INK, 1.2);
        scene.draw_line(self.outline(), stroke.clone());
        let mut tick_marks = Outline::default();
        for tick in self.x_ticks() {
            let x = self.x_pixel(tick.value);
            tick_marks.add_line(&[[x, bottom_y], [x, bottom_y + 5.0]]);
        }
        for (x, number) in x_numbers {
            let text = Text::new(number, [x, bottom_y + 21.0], TICK_SIZE);
            scene.draw_text(text.with_anchor(Anchor::Middle));
        }
        for tick in self.y_ticks() {
            let y = self.y_pixel(tick.value);
            tick_marks.add_line(&[[self.x - 5.0, y], [self.x, y]]);
            if has_y_numbers {
                let text_position = [self.x - 9.0, y + 0.35 * TICK_SIZE];
                scene.draw_text(
                    Text::new(tick.label, text_position, TICK_SIZE).with_anchor(Anchor::End),
                );
            }
        }
        scene.draw_line(tick_marks, stroke);
    }

    /// Writes a line of text in the middle of the panel: the reason for an empty panel.
    pub(crate) fn write_centred(&self, scene: &mut Scene, text: &str) {
        let text_position =
            [self.x + self.width / 2.0, self.y + self.height / 2.0 + 0.35 * LABEL_SIZE];
        let text = Text::new(text, text_position, LABEL_SIZE).with_anchor(Anchor::Middle);
        scene.draw_text(Text { colour: MUTED_COLOUR, ..text });
    }

    /// Writes the label of the x axis.
    pub(crate) fn draw_x_label(&self, scene: &mut Scene, label: &str) {
        let text_position = [self.x + self.width / 2.0, self.y + self.height + 44.0];
        scene.draw_text(Text::new(label, text_position, LABEL_SIZE).with_anchor(Anchor::Middle));
    }

    /// Writes the label of the y axis, `distance` px left of the panel; in two lines if it is
    /// longer than the panel is high.
    pub(crate) fn draw_y_label(&self, scene: &mut Scene, label: &str, distance: f64) {
        let fits_height = |text: &str| text_width(text, LABEL_SIZE, false) <= self.height;
        // A unit, in brackets, stays on one line.
        let words_end = label.rfind(" (").map_or(label.len(), |index| index + 1);
        let space_indices = label[..words_end].match_indices(' ').map(|(index, _)| index);
        let break_index = { space_indices }.rfind(|&index| fits_height(&label[..index]));
        let label_lines = match break_index {
            Some(index) if !fits_height(label) => vec![&label[..index], &label[index + 1..]],
            _ => vec![label],
        };
        let first_x = self.x - distance - (label_lines.len() - 1) as f64 * 0.62 * LABEL_SIZE;
        for (k, line) in label_lines.into_iter().enumerate() {
            let text_position = [first_x + 1.2 * LABEL_SIZE * k as f64, self.y + self.height / 2.0];
            scene.draw_text(
                Text::new(line, text_position, LABEL_SIZE)
                    .with_anchor(Anchor::Middle)
                    .with_rotation(),
            );
        }
    }
}

/// Writes the title, and below it the subtitle, shortened to fit.
pub(crate) fn draw_heading(scene: &mut Scene, title: &str, subtitle: &str) {
    let max_width = scene.width - 40.0;
    scene.draw_text(
        Text::new(cut_to_fit(title, TITLE_SIZE, true, max_width), [20.0, 32.0], TITLE_SIZE)
            .with_bold_face(),
    );
    let subtitle = cut_to_fit(subtitle, TICK_SIZE, false, max_width);
    scene.draw_text(Text { colour: MUTED_COLOUR, ..Text::new(subtitle, [20.0, 55.0], TICK_SIZE) });
}

/// Height of [`draw_heading`], px.
pub(crate) const HEADING_HEIGHT: f64 = 72.0;

/// Returns `text`, cut short to fit `max_width` px.
fn cut_to_fit(text: &str, size: f64, is_bold: bool, max_width: f64) -> String {
    let mut shortened_text: String = text.to_owned();
    while text_width(&shortened_text, size, is_bold) > max_width {
        let kept_letters = shortened_text.trim_end_matches('…').chars().count().saturating_sub(1);
        shortened_text =
            shortened_text.chars().take(kept_letters).collect::<String>().trim_end().to_owned()
                + "…";
    }
    shortened_text
}

/// The symbol before a legend's text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum LegendSymbol {
    /// A line as drawn in the figure.
    Line(Stroke),
    Area(Colour),
    /// A hatched grey area: failed points.
    Failed,
    /// A hatch without a background.
    Hatched(Hatch),
    /// A white area with a dot: undefined points.
    Undefined,
    /// A shape around the origin, whether it is filled, and its colour.
    Shape(Outline, bool, Colour),
}

/// Height of a row of a legend, px.
const LEGEND_ROW_HEIGHT: f64 = 25.0;

/// Returns the height of a legend in `width` px, px.
pub(crate) fn measure_legend_height(entries: &[(LegendSymbol, String)], width: f64) -> f64 {
    LEGEND_ROW_HEIGHT * lay_out_legend(entries, width).last().map_or(0, |(_, row)| row + 1) as f64
}

/// Draws a legend below `y`, px.
pub(crate) fn draw_legend(
    scene: &mut Scene,
    entries: &[(LegendSymbol, String)],
    x: f64,
    y: f64,
    width: f64,
) {
    for ((symbol, text), (offset, row)) in entries.iter().zip(lay_out_legend(entries, width)) {
        let x = x + offset;
        let y = y + LEGEND_ROW_HEIGHT / 2.0 + row as f64 * LEGEND_ROW_HEIGHT;
        let area = Outline::rectangle(x, y - 8.0, 28.0, 16.0);
        match symbol {
            LegendSymbol::Line(stroke) => {
                scene.draw_line(Outline::line(&[[x, y], [x + 28.0, y]]), stroke.clone())
            }
            LegendSymbol::Area(colour) => {
                scene.fill_outline(area.clone(), *colour);
                scene.draw_line(area, Stroke::new_solid(MUTED_COLOUR, 1.0));
            }
            LegendSymbol::Failed => draw_failed_area(scene, area),
            LegendSymbol::Hatched(hatch) => {
                scene.fill_with_hatch(area.clone(), hatch);
                scene.draw_line(area, Stroke::new_solid(MUTED_COLOUR, 1.0));
            }
            LegendSymbol::Undefined => draw_undefined_cells(scene, &[[x, y - 8.0, 28.0, 16.0]]),
            LegendSymbol::Shape(outline, is_filled, colour) => {
                let outline = outline.with_offset([x + 14.0, y]);
                if *is_filled {
                    scene.fill_outline(outline, *colour);
                } else {
                    scene.draw_line(outline, Stroke::new_solid(*colour, 1.4));
                }
            }
        }
        scene.draw_text(Text::new(text.clone(), [x + 36.0, y + 0.35 * TICK_SIZE], TICK_SIZE));
    }
}

/// Returns the horizontal offset (px) and the row of each entry.
fn lay_out_legend(entries: &[(LegendSymbol, String)], width: f64) -> Vec<(f64, usize)> {
    let mut x = 0.0;
    let mut row = 0;
    let next_position = |(_, text): &(LegendSymbol, String)| {
        let entry_width = 36.0 + text_width(text, TICK_SIZE, false);
        if x > 0.0 && x + entry_width > width {
            (x, row) = (0.0, row + 1);
        }
        let next_position = (x, row);
        x += entry_width + 26.0;
        next_position
    };
    entries.iter().map(next_position).collect()
}

/// Draws an area of failed points: grey and hatched.
pub(crate) fn draw_failed_area(scene: &mut Scene, area: Outline) {
    scene.fill_crisply(area.clone(), FAILED_COLOUR);
    scene.fill_with_hatch(area, &failed_hatch());
}

/// Returns the hatch of cells with failed points.
pub(crate) fn failed_hatch() -> Hatch {
    Hatch { strokes: vec![Stroke::new_solid(INK, 1.2)], spacing: 9.0, is_falling: false }
}

/// Returns the hatch of cells with chaotic motion: light and dark lines, which show on every
/// colour.
pub(crate) fn sensitive_hatch() -> Hatch {
    let strokes = vec![Stroke::new_solid(INK, 2.4), Stroke::new_solid(PAPER, 1.0)];
    Hatch { strokes, spacing: 7.0, is_falling: true }
}

/// Draws cells `[x, y, width, height]` of undefined points: white with a dot in the middle.
pub(crate) fn draw_undefined_cells(scene: &mut Scene, cell_areas: &[[f64; 4]]) {
    let mut areas = Outline::default();
    let mut dots = Outline::default();
    for &[x, y, width, height] in cell_areas {
        areas.add_rectangle(x, y, width, height);
        let dot_side = 4.0_f64.min(0.4 * width.min(height));
        dots.add_rectangle(
            x + (width - dot_side) / 2.0,
            y + (height - dot_side) / 2.0,
            dot_side,
            dot_side,
        );
    }
    scene.fill_crisply(areas.clone(), PAPER);
    scene.draw_line(areas, Stroke::new_solid(FAINT_COLOUR, 1.0));
    scene.fill_outline(dots, MUTED_COLOUR);
}
