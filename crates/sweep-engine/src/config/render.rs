//! Mistakes as text, in the form of rustc's messages.

use std::fmt;
use std::ops::Range;

use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};

use super::report::{Diagnostic, Diagnostics};
use super::section::format_count;
use super::source::{Location, SourceLine, Sources, floor_char_boundary};

/// Maximum length of a line that is shown whole, bytes; of a longer line, the part around the
/// mistake is shown. Basis: a few screens of a terminal. Doubling it shows longer lines whole.
const MAX_WHOLE_LINE_BYTES: usize = 4000;
/// Length of the part of a long line that is shown, bytes. Basis: a line of a terminal. Doubling it
/// shows twice as much.
const SHOWN_PART_BYTES: usize = 130;
/// Length of the shown part of a long line before the mistake, bytes. Basis: a third of
/// [`SHOWN_PART_BYTES`]. Doubling it leaves less room for the text after the mistake.
const SHOWN_LEAD_BYTES: usize = 40;

fn renderer(is_coloured: bool) -> Renderer {
    if is_coloured { Renderer::styled() } else { Renderer::plain() }
}

/// Renders one mistake, without a newline at its end.
fn render_diagnostic(diagnostic: &Diagnostic, sources: &Sources, is_coloured: bool) -> String {
    let mut group = Group::with_title(Level::ERROR.primary_title(diagnostic.title.as_str()));
    // Locations on one line share its snippet.
    let mut shown_locations: Vec<(usize, &Location)> = Vec::new();
    for (k, (location, _)) in diagnostic.locations.iter().enumerate() {
        let number = sources.line(location).number;
        if shown_locations
            .iter()
            .any(|&(line, other)| line == number && other.source == location.source)
        {
            continue;
        }
        shown_locations.push((number, location));
        group = add_snippet(group, diagnostic, sources, k);
    }
    let help = diagnostic.help_texts.iter().map(|help| Level::HELP.message(help.as_str()));
    renderer(is_coloured).render(&[group.elements(help)])
}

/// Adds the snippet of location `k`: its line, with every location on it marked.
fn add_snippet<'a>(
    group: Group<'a>,
    diagnostic: &'a Diagnostic,
    sources: &'a Sources,
    k: usize,
) -> Group<'a> {
    let location = &diagnostic.locations[k].0;
    let line = sources.line(location);
    let window = shown_window(&line);
    let column = line.text[..line.span.start].chars().count() + 1;
    let mut snippet = Snippet::source(&line.text[window.clone()]).line_start(line.number);
    for (j, (other, label)) in diagnostic.locations.iter().enumerate() {
        let marked_line = sources.line(other);
        let is_in_window = other.source == location.source
            && marked_line.number == line.number
            && window.start <= marked_line.span.start
            && marked_line.span.start <= window.end;
        if is_in_window {
            let kind = if j == 0 { AnnotationKind::Primary } else { AnnotationKind::Context };
            let span = marked_line.span.start - window.start
                ..marked_line.span.end.min(window.end) - window.start;
            snippet = snippet.annotation(kind.span(span).label(label.as_str()));
        }
    }
    let name = sources.name(location.source);
    if window == (0..line.text.len()) {
        group.element(snippet.path(name))
    } else {
        group.element(Origin::path(name).line(line.number).char_column(column)).element(snippet)
    }
}

/// Returns the part of a line that is shown, in its bytes.
fn shown_window(line: &SourceLine<'_>) -> Range<usize> {
    if line.text.len() <= MAX_WHOLE_LINE_BYTES {
        return 0..line.text.len();
    }
    let start = floor_char_boundary(line.text, line.span.start.saturating_sub(SHOWN_LEAD_BYTES));
    start..floor_char_boundary(line.text, start + SHOWN_PART_BYTES)
}

/// Returns the last line, which counts the mistakes.
fn render_summary(count: usize, beyond: usize, is_coloured: bool) -> String {
    let mistakes = format_count(count, "mistake");
    let shown_note =
        if beyond == 0 { String::new() } else { format!(" ({} shown)", count - beyond) };
    let title = format!("{mistakes}{shown_note}, nothing was done");
    renderer(is_coloured).render(&[Group::with_title(Level::ERROR.primary_title(title))])
}

impl Diagnostics {
    /// Returns the text with terminal colours.
    pub fn styled(&self) -> String {
        self.text(true)
    }

    fn text(&self, is_coloured: bool) -> String {
        let mut text = String::new();
        for diagnostic in &self.shown {
            text.push_str(&render_diagnostic(diagnostic, &self.sources, is_coloured));
            text.push_str("\n\n");
        }
        text.push_str(&render_summary(self.count(), self.omitted_count, is_coloured));
        text
    }
}

impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text(false))
    }
}

impl std::error::Error for Diagnostics {}
