//! Examples, printed by `--help` before everything else: most readers want to see one line that
//! works. Each subcommand's are in its module.

/// Lines to type, each with what it does.
pub type Examples = Vec<[&'static str; 2]>;

/// Widest line of help that an ordinary terminal shows as it is.
pub const WIDEST: usize = 80;

/// Examples as help shows them; `None` if there are none.
pub fn shown(lines: &[[&str; 2]]) -> Option<String> {
    let width = lines.iter().map(|[line, _]| line.len()).max()?;
    let fits = lines.iter().all(|[_, does]| 2 + width + 3 + does.len() <= WIDEST);
    let mut text = String::from("Examples:");
    for [line, does] in lines {
        text += &if fits {
            format!("\n  {line:width$}   {does}")
        } else {
            format!("\n  {}\n      {does}", folded(line))
        };
    }
    Some(text)
}

/// A line to type, on as many as it takes, so that it can still be copied.
fn folded(line: &str) -> String {
    let mut text = String::new();
    let mut column = 2;
    for (i, part) in line.split(" --").enumerate() {
        let part = if i == 0 { part.to_owned() } else { format!(" --{part}") };
        if i > 0 && column + part.len() + 2 > WIDEST {
            text += " \\\n   ";
            column = 3;
        }
        column += part.len();
        text += &part;
    }
    text
}
