//! Examples, printed by `--help` before everything else: most readers want to see one line that works.

/// Widest line of help that an ordinary terminal shows as it is.
const WIDEST: usize = 80;

/// Command, then lines with what each does. The empty name is the program's own help.
const EXAMPLES: &[(&str, &[[&str; 2]])] = &[
    (
        "",
        &[
            ["sweep init my.toml", "a commented grid file to start from"],
            ["sweep check my.toml", "every mistake in it, or what it would do"],
            ["sweep run my.toml", "do it; again after an interruption, it goes on"],
            ["sweep show results/first.parquet", "what came of it"],
            ["sweep plot results/first.parquet", "the map as a picture"],
            ["sweep parameters", "every number that can be set or swept"],
        ],
    ),
    (
        "run",
        &[
            ["sweep run my.toml", "to results/NAME.parquet, on every core"],
            ["sweep run my.toml --set tub_mass_kg=20 --out light.parquet", "the same with another tub"],
            ["sweep run my.toml --progress plain 2> run.log", "a line every 5 s, for a log"],
            ["sweep run my.toml --shard 3/16", "one sixteenth; `sweep merge` joins them"],
        ],
    ),
    (
        "check",
        &[
            ["sweep check my.toml", "the plan, or every mistake with its place"],
            ["sweep check my.toml --json", "the plan with every default in place"],
        ],
    ),
    ("merge", &[["sweep merge my.toml", "when `sweep status my.toml` finds no shard missing"]]),
    (
        "status",
        &[
            ["sweep status my.toml", "how far it is"],
            ["sweep status my.toml --json", "the same for a program, missing shards as a list"],
        ],
    ),
    ("slurm", &[["sweep slurm my.toml --shards 16 --time 30", "the script that submits them"]]),
    ("show", &[["sweep show results/first.parquet", "verdicts, extremes, columns with units and ranges"]]),
    (
        "trace",
        &[
            [
                "sweep trace my.toml --at unbalance_mass_kg=0.4 --at damping_n_s_per_m=100 --out rocking.parquet",
                "both models at one point",
            ],
            ["sweep plot rocking.parquet", "drawn over time and spin speed"],
        ],
    ),
    (
        "modes",
        &[
            ["sweep modes", "resonance speeds of the built-in machine"],
            [
                "sweep modes my.toml --speed 0:400:10 --out modes.parquet",
                "a Campbell diagram's data, for `sweep plot`",
            ],
        ],
    ),
    (
        "boundary",
        &[
            [
                "sweep boundary my.toml --out line.parquet",
                "the line on which the ratio is at its limit, without the map",
            ],
            ["sweep plot line.parquet", "drawn with the brackets it is known to lie in"],
        ],
    ),
    (
        "plot",
        &[
            ["sweep plot results/first.parquet", "results/first.svg: ratios, and the line of the limit"],
            ["sweep plot results/first.parquet -o map.html", "a page to point and click in"],
            [
                "sweep plot results/first.parquet --quantity nonlinear --channel tub_yaw",
                "one channel's amplitude",
            ],
        ],
    ),
    (
        "parameters",
        &[
            ["sweep parameters", "names, values, units, meaning and where each value is from"],
            ["sweep parameters my.toml", "the same with the values of this grid's machine"],
        ],
    ),
    (
        "init",
        &[
            ["sweep init my.toml", "a commented grid file"],
            ["sweep init --machine washer.toml", "the built-in machine, to be changed into one's own"],
        ],
    ),
    ("schema", &[["sweep schema", "for editors that complete and check TOML"]]),
    ("completions", &[["sweep completions bash", "to be sourced, or put where the shell looks"]]),
    ("man", &[["sweep man ~/.local/share/man/man1", "then `man sweep`, `man sweep-run`"]]),
];

/// The examples of one command: each a line to type, and what it does.
pub(super) fn lines(command: &str) -> &'static [[&'static str; 2]] {
    EXAMPLES.iter().find(|(name, _)| *name == command).map_or(&[], |(_, lines)| lines)
}

/// The examples of one command as its help shows them; `None` if it has none.
#[must_use]
pub fn of(command: &str) -> Option<String> {
    let lines = lines(command);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli;

    #[test]
    fn every_visible_command_has_examples_and_every_example_parses() {
        let command = cli::command();
        for visible in command.get_subcommands().filter(|command| !command.is_hide_set()) {
            assert!(of(visible.get_name()).is_some(), "no example of `sweep {}`", visible.get_name());
        }
        for (name, lines) in EXAMPLES {
            // A command's own first; what follows may go on with its output.
            let own = format!("sweep {name}");
            assert!(lines.first().is_some_and(|[line, _]| line.starts_with(&own)), "{name}");
            for [line, _] in *lines {
                let line = line.split(" 2>").next().unwrap_or_default();
                let parsed = cli::command().try_get_matches_from(line.split_whitespace());
                assert!(parsed.is_ok(), "{line}: {parsed:?}");
            }
        }
    }

    #[test]
    fn no_example_is_wider_than_a_terminal_or_changed_by_folding() {
        for (name, lines) in EXAMPLES {
            let shown = of(name).unwrap();
            assert!(shown.lines().all(|line| line.len() <= WIDEST), "{shown}");
            // As a shell reads it, which takes a folded line for one.
            let words = shown.replace("\\\n", "").split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(lines.iter().all(|[line, _]| words.contains(line)), "{shown}");
        }
    }

    #[test]
    fn help_of_a_command_begins_with_its_examples() {
        let mut command = cli::command();
        let run = command.find_subcommand_mut("run").unwrap();
        let help = run.render_help().to_string();
        let place = |text: &str| help.find(text).unwrap_or_else(|| panic!("no {text} in\n{help}"));
        assert!(place("--shard 3/16") < place("Usage:"));
    }
}
