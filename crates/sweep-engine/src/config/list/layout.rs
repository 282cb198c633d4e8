//! The layout of a table in text: its line of names, separator, units and rows.

use std::ops::Range;

use super::names::ColumnNames;
use super::notation::Notation;
use super::units::is_unit_name;
use super::{ListError, MAX_COLUMNS};

/// Maximum number of lines among which the line of names is searched. Basis: no logger writes a
/// preamble of that length. Doubling it accepts longer preambles.
const MAX_HEADER_SEARCH_LINES: usize = 200;

/// The separator of cells that are separated by white space.
pub(super) const WHITE_SPACE: char = ' ';

/// Returns the words for a separator in messages.
pub(super) fn separator_words(separator: char) -> &'static str {
    match separator {
        ';' => "semicolons",
        '\t' => "tabs",
        WHITE_SPACE => "spaces",
        _ => "commas",
    }
}

/// A line of the table.
#[derive(Clone, Copy)]
pub(super) struct TextLine<'t> {
    /// The byte at which the line begins.
    pub(super) line_start: usize,
    /// The text without byte order mark and line end.
    pub(super) text: &'t str,
    /// The byte at which `text` begins.
    pub(super) text_start: usize,
}

impl<'t> TextLine<'t> {
    /// Returns the line that begins at a byte of a text.
    pub(super) fn starting_at(text: &'t str, start: usize) -> Self {
        let line = text.get(start..).unwrap_or_default();
        let line = line.split_inclusive('\n').next().unwrap_or_default();
        let line_body = line.trim_end_matches(['\n', '\r']);
        let line_text =
            if start == 0 { line_body.trim_start_matches('\u{feff}') } else { line_body };
        Self {
            line_start: start,
            text: line_text,
            text_start: start + line_body.len() - line_text.len(),
        }
    }

    /// Yields the cells of the line without white space and quotation marks, with their positions.
    pub(super) fn cells(self, separator: char) -> LineCells<'t> {
        LineCells { line: self, separator, next: Some(0) }
    }
}

/// Yields the lines of a text from a byte on, without empty lines and comments.
pub(super) fn data_lines(text: &str, from: usize) -> impl Iterator<Item = TextLine<'_>> + Clone {
    let mut next_start = from;
    let all_lines = text[from..].split_inclusive('\n').map(move |line| {
        let start = next_start;
        next_start += line.len();
        TextLine::starting_at(text, start)
    });
    all_lines.filter(|line| {
        let line = line.text.trim();
        !line.is_empty() && !line.starts_with('#')
    })
}

/// An iterator over the cells of a line.
#[derive(Clone)]
pub(super) struct LineCells<'t> {
    line: TextLine<'t>,
    separator: char,
    /// The byte of the line at which the next cell begins.
    next: Option<usize>,
}

impl<'t> Iterator for LineCells<'t> {
    type Item = (&'t str, Range<usize>);

    fn next(&mut self) -> Option<Self::Item> {
        let mut from = self.next?;
        let text = self.line.text;
        if self.separator == WHITE_SPACE {
            from += text[from..].len() - text[from..].trim_start().len();
            if from == text.len() {
                self.next = None;
                return None;
            }
        }
        let rest_of_line = &text[from..];
        let end = end_of_cell(rest_of_line, self.separator);
        self.next = (end < rest_of_line.len()).then_some(from + end + 1);
        let cell = &rest_of_line[..end];
        let start = self.line.text_start + from + (cell.len() - cell.trim_start().len());
        let trimmed_cell = cell.trim();
        let is_quoted =
            trimmed_cell.len() >= 2 && trimmed_cell.starts_with('"') && trimmed_cell.ends_with('"');
        let unquoted_cell =
            if is_quoted { &trimmed_cell[1..trimmed_cell.len() - 1] } else { trimmed_cell };
        Some((unquoted_cell, start..start + trimmed_cell.len()))
    }
}

/// Returns the length of the first cell of a text. A separator between quotation marks belongs to
/// the cell.
fn end_of_cell(text: &str, separator: char) -> usize {
    let is_separator = |letter: char| match separator {
        WHITE_SPACE => letter == ' ' || letter == '\t',
        separator => letter == separator,
    };
    let mut is_quoted = false;
    let mut may_begin = true;
    let cell_end = text.find(|letter: char| {
        is_quoted ^= letter == '"' && (is_quoted || may_begin);
        may_begin = letter == '"' || may_begin && letter.is_whitespace();
        is_separator(letter) && !is_quoted
    });
    cell_end.unwrap_or(text.len())
}

/// The layout of a table in text.
pub(super) struct TableLayout<'t> {
    /// The separator of cells.
    pub(super) separator: char,
    /// The line of names.
    pub(super) header_line: TextLine<'t>,
    /// The units of the columns in order; shorter if some have none.
    pub(super) units: Vec<String>,
    /// The decimal mark that the file states.
    pub(super) stated_notation: Option<Notation>,
    /// The byte at which the rows begin.
    pub(super) rows_start: usize,
    /// Whether it is a LabVIEW file: the first column is the time, and the last one holds remarks,
    /// which rows may leave out.
    pub(super) is_labview: bool,
    /// The number of ignored lines before the line of names.
    pub(super) preamble_lines: usize,
}

impl<'t> TableLayout<'t> {
    /// Finds the layout of a table; `None` if the text has no line.
    ///
    /// # Errors
    /// A kind of LabVIEW file that is not supported.
    pub(super) fn detect(
        text: &'t str,
        names: &ColumnNames<'_>,
    ) -> Result<Option<Self>, ListError> {
        let mut first_lines: Vec<TextLine<'_>> =
            data_lines(text, 0).take(MAX_HEADER_SEARCH_LINES).collect();
        let Some(first_line) = first_lines.first().copied() else { return Ok(None) };
        if first_line.text.starts_with("LabVIEW Measurement") {
            return Self::find_labview(text, &first_lines).map(Some);
        }
        let stated_separator_char = stated_separator(first_line.text);
        if stated_separator_char.is_some() {
            first_lines.remove(0);
        }
        let Some(first_line) = first_lines.first().copied() else { return Ok(None) };
        let line_separator = |line: &TextLine<'_>| {
            stated_separator_char.unwrap_or_else(|| detect_separator(line.text))
        };
        let count_words = |line: &TextLine<'_>| line.cells(WHITE_SPACE).count();
        // A single name may have several words, whereas cells that spaces separate are separated so
        // in every row.
        let separator_at = |k: usize| match line_separator(&first_lines[k]) {
            WHITE_SPACE
                if first_lines.get(k + 1).map(count_words)
                    != Some(count_words(&first_lines[k])) =>
            {
                ','
            }
            found => found,
        };
        // The best line has known names and stands above rows of numbers. If there is no such line,
        // a line with one of these properties is taken.
        let rank_line = |k: usize| {
            let separator = separator_at(k);
            let Some(cells) = split_cells(first_lines[k], separator) else { return (0, false, 0) };
            let known_count = cells
                .into_iter()
                .filter(|cell| !is_number(cell) && names.is_known_header(cell))
                .count();
            (known_count.min(1), is_above_rows(&first_lines[k..], separator), known_count)
        };
        let mut header_index = 0;
        let mut best_rank = rank_line(0);
        for k in 1..first_lines.len() {
            // Rows follow this line, and a line of names cannot come after rows.
            if best_rank.0 == 1 && best_rank.1 {
                break;
            }
            let next_rank = rank_line(k);
            if next_rank > best_rank {
                (header_index, best_rank) = (k, next_rank);
            }
        }
        let header = first_lines.get(header_index).copied().unwrap_or(first_line);
        if let Some(commented_layout) = find_commented_header(text, header, &line_separator) {
            return Ok(Some(commented_layout));
        }
        let separator = separator_at(header_index);
        let next_line = first_lines.get(header_index + 1);
        let column_count = split_cells(header, separator).map_or(0, |names| names.len());
        let units = next_line.and_then(|line| parse_units(*line, separator, column_count));
        let last_header_line =
            if units.is_some() { next_line.copied().unwrap_or(header) } else { header };
        Ok(Some(Self {
            separator,
            header_line: header,
            units: units.unwrap_or_default(),
            stated_notation: None,
            rows_start: end_of_line(text, last_header_line),
            is_labview: false,
            preamble_lines: header_index,
        }))
    }

    /// Finds the layout of a LabVIEW measurement file (.lvm).
    fn find_labview(text: &'t str, first_lines: &[TextLine<'t>]) -> Result<Self, ListError> {
        /// The text of the line that ends a header.
        const HEADER_END: &str = "***End_of_Header***";
        let is_header_end = |line: &TextLine<'_>| line.text.starts_with(HEADER_END);
        let header_value = |key: &str| {
            let key_value = first_lines.iter().find_map(|line| line.text.strip_prefix(key));
            key_value.map(|key_value| key_value.trim_matches([',', '\t', ';']).to_owned())
        };
        let separator = match header_value("Separator").as_deref() {
            Some("Comma") => ',',
            _ => '\t',
        };
        let notation = match header_value("Decimal_Separator").as_deref() {
            // If commas separate cells, a comma at the end of the line is the value itself.
            Some(",") => Notation::DECIMAL_COMMA,
            Some("") if separator == '\t' => Notation::DECIMAL_COMMA,
            _ => Notation::DECIMAL_POINT,
        };
        let x_columns = header_value("X_Columns").unwrap_or_default();
        if x_columns != "One" && !x_columns.is_empty() {
            return Err(format!(
                "it is a LabVIEW file with X_Columns {x_columns}: write it again with one column \
                 of times"
            ));
        }
        /// The message about a file of several segments.
        const SEVERAL_SEGMENTS: &str =
            "it is a LabVIEW file of several segments: export one of them";
        let header_end_lines: Vec<usize> =
            (0..first_lines.len()).filter(|k| is_header_end(&first_lines[*k])).collect();
        // A file has two headers: its own and that of its segment.
        let header_end = match header_end_lines.as_slice() {
            [] => return Err("it is a LabVIEW file whose header has no end".to_owned()),
            [header_end] | [_, header_end] => *header_end,
            _ => return Err(SEVERAL_SEGMENTS.to_owned()),
        };
        let Some(header) = first_lines.get(header_end + 1).copied() else {
            return Err("it is a LabVIEW file without signals".to_owned());
        };
        let rows_start = end_of_line(text, header);
        if text[rows_start..].contains(HEADER_END) {
            return Err(SEVERAL_SEGMENTS.to_owned());
        }
        let mut units = vec!["s".to_owned()];
        let unit_labels = first_lines.iter().find(|line| line.text.starts_with("Y_Unit_Label"));
        let unit_labels = unit_labels.into_iter().flat_map(|line| line.cells(separator).skip(1));
        units.extend(unit_labels.map(|(unit, _)| unit.to_owned()));
        Ok(Self {
            separator,
            header_line: header,
            units,
            stated_notation: Some(notation),
            rows_start,
            is_labview: true,
            preamble_lines: header_end + 1,
        })
    }
}

/// Returns the layout of a table whose line of names is a comment above its first row, as NumPy
/// writes it.
fn find_commented_header<'t>(
    text: &'t str,
    row: TextLine<'t>,
    separator: &dyn Fn(&TextLine<'_>) -> char,
) -> Option<TableLayout<'t>> {
    let preceding_text = text[..row.line_start].trim_end();
    let start = preceding_text.rfind('\n').map_or(0, |end| end + 1);
    let line = TextLine::starting_at(text, start);
    let name_text = line.text.trim_start().strip_prefix('#')?;
    let offset = line.text_start + line.text.len() - name_text.len();
    let name_line = TextLine { line_start: start, text: name_text, text_start: offset };
    let separator = separator(&name_line);
    let column_count = split_cells(name_line, separator)?.len();
    let row_cells = split_cells(row, separator)?;
    let is_row = row_cells.len() == column_count && row_cells.into_iter().all(is_number);
    is_row.then_some(TableLayout {
        separator,
        header_line: name_line,
        units: Vec::new(),
        stated_notation: None,
        rows_start: row.line_start,
        is_labview: false,
        preamble_lines: 0,
    })
}

/// Returns the cells of a line; `None` if there are more than a table may have.
fn split_cells(line: TextLine<'_>, separator: char) -> Option<Vec<&str>> {
    let cells = line.cells(separator).take(MAX_COLUMNS + 2).map(|(cell, _)| cell);
    let cells: Vec<&str> = cells.collect();
    (cells.len() <= MAX_COLUMNS + 1).then_some(cells)
}

/// Returns the byte after a line.
fn end_of_line(text: &str, line: TextLine<'_>) -> usize {
    let end = text[line.line_start..].find('\n');
    end.map_or(text.len(), |end| line.line_start + end + 1)
}

/// Returns the separator that a first line `sep=;` states, a convention of Excel.
fn stated_separator(line: &str) -> Option<char> {
    let stated_text = line.trim().trim_matches('"').strip_prefix("sep=")?;
    let mut letters = stated_text.chars();
    let separator = letters.next().unwrap_or('\t');
    letters.next().is_none().then_some(separator)
}

/// Returns the separator of a line of names.
fn detect_separator(line: &str) -> char {
    let occurs_unquoted = |wanted: &char| {
        let mut is_quoted = false;
        line.chars().any(|letter| {
            is_quoted ^= letter == '"';
            letter == *wanted && !is_quoted
        })
    };
    let first_separator = [';', '\t', ','].into_iter().find(occurs_unquoted);
    let has_several_words = line.split_whitespace().nth(1).is_some() && !line.contains('"');
    first_separator.unwrap_or(if has_several_words { WHITE_SPACE } else { ',' })
}

/// Returns whether a cell is a number in any notation.
fn is_number(cell: &str) -> bool {
    cell.contains(|letter: char| letter.is_ascii_digit())
        && [Notation::DECIMAL_POINT, Notation::DECIMAL_COMMA]
            .into_iter()
            .any(|notation| notation.parse_number(cell).is_some())
}

/// Returns whether the first of these lines has as many names as the next row has numbers.
fn is_above_rows(lines: &[TextLine<'_>], separator: char) -> bool {
    let [header, following_lines @ ..] = lines else { return false };
    let Some(header_cells) = split_cells(*header, separator) else { return false };
    if header_cells.iter().any(|name| is_number(name)) {
        return false;
    }
    let has_units =
        |line: &&TextLine<'_>| parse_units(**line, separator, header_cells.len()).is_some();
    let following_lines = if following_lines.first().as_ref().is_some_and(has_units) {
        &following_lines[1..]
    } else {
        following_lines
    };
    let Some(row) = following_lines.first() else { return false };
    let Some(row) = split_cells(*row, separator) else { return false };
    let header_cells =
        header_cells.iter().rposition(|name| !name.is_empty()).map_or(0, |last| last + 1);
    row.len() >= header_cells
        && row[header_cells..].iter().all(|cell| cell.is_empty())
        && row.iter().any(|cell| is_number(cell))
}

/// Returns the units in a row of units: units and empty cells, with or without brackets. Returns
/// `None` if the line is no such row.
fn parse_units(line: TextLine<'_>, separator: char, columns: usize) -> Option<Vec<String>> {
    let strip_brackets = |cell: &str| cell.trim_matches(['[', ']', '(', ')', ' ']).to_owned();
    let cells: Vec<String> =
        split_cells(line, separator)?.into_iter().map(strip_brackets).collect();
    let is_empty = |cell: &String| ["", "-", "1"].contains(&cell.as_str());
    let is_row_of_units = cells.len() == columns
        && cells.iter().all(|cell| is_empty(cell) || !is_number(cell))
        && cells.iter().any(|cell| is_unit_name(cell));
    let known_count = cells.iter().filter(|cell| is_empty(cell) || is_unit_name(cell)).count();
    // Units of ignored columns may be unknown, such as volts or degrees Celsius.
    let is_row_of_units = is_row_of_units && 2 * known_count > cells.len();
    is_row_of_units.then(|| {
        cells.into_iter().map(|cell| if is_empty(&cell) { String::new() } else { cell }).collect()
    })
}
