//! Examples of command lines, which `--help` prints before everything else because most readers
//! look for one that works. The examples of a subcommand are in its module.

/// Command lines, each with a description.
pub type Examples = Vec<[&'static str; 2]>;

/// The width of the widest line of help, in characters. Basis: the width of a terminal. Doubling it
/// prints lines that a terminal breaks.
pub const MAX_LINE_WIDTH: usize = 80;

/// Formats examples for the help; `None` if there are none.
pub fn format_examples(lines: &[[&str; 2]]) -> Option<String> {
    let width = lines.iter().map(|[line, _]| line.len()).max()?;
    let fit_on_one_line =
        lines.iter().all(|[_, description]| 2 + width + 3 + description.len() <= MAX_LINE_WIDTH);
    let mut text = String::from("Examples:");
    for [line, description] in lines {
        text += &if fit_on_one_line {
            format!("\n  {line:width$}   {description}")
        } else {
            format!("\n  {}\n      {description}", break_line(line))
        };
    }
    Some(text)
}

/// Breaks a long command line before its options, with backslashes so that it can be copied.
fn break_line(line: &str) -> String {
    let mut text = String::new();
    let mut column = 2;
    for (i, part) in line.split(" --").enumerate() {
        let part = if i == 0 { part.to_owned() } else { format!(" --{part}") };
        if i > 0 && column + part.len() + 2 > MAX_LINE_WIDTH {
            text += " \\\n   ";
            column = 3;
        }
        column += part.len();
        text += &part;
    }
    text
}
