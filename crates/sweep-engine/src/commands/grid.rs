//! The arguments for a grid file and its result, which several subcommands share.

use std::path::PathBuf;

use crate::config::arguments::argument_name;
use crate::config::{self, NamedValues};
use crate::{Diagnostics, GridInput, Model, Plan, program, tell};

/// A grid file and changes to its constants, as most commands take them.
#[derive(Debug, clap::Args)]
pub struct GridArgs {
    /// Grid file
    #[arg(value_name = "GRID.toml")]
    pub grid: PathBuf,
    /// Set a constant, in place of the grid file's value, or fix an axis at a value; may be
    /// repeated
    #[arg(long = "set", value_name = "NAME=VALUE")]
    pub sets: Vec<String>,
    /// Fix an axis at a value, on the grid or between its points, or set any other parameter; may
    /// be repeated
    #[arg(long, value_name = "NAME=VALUE")]
    pub at: Vec<String>,
    /// Ratio below which a point is reliable, in place of the grid file's limit
    #[arg(long, value_name = "RATIO")]
    pub ratio_limit: Option<f64>,
    /// Name of the run, in place of the grid file's: it names the result file and titles figures
    #[arg(long, value_name = "NAME", value_parser = config::parse_name)]
    pub name: Option<String>,
}

impl GridArgs {
    /// Returns the values of `--set` and `--ratio-limit` in one list.
    pub fn sets(&self) -> Vec<String> {
        let ratio_limit_set =
            self.ratio_limit.map(|ratio_limit_set| format!("ratio_limit={ratio_limit_set}"));
        self.sets.iter().cloned().chain(ratio_limit_set).collect()
    }

    /// Returns the grid with all changes except those of `--at`.
    pub fn input<M: Model>(&self) -> GridInput<M> {
        GridInput::file(self.grid.clone(), self.sets()).with_name(self.name.clone())
    }

    /// Returns the plan with all changes, and shows the notes of reading it.
    ///
    /// # Errors
    /// Every mistake in the grid file and the constants.
    pub fn load<M: Model>(&self) -> Result<Plan<M>, Diagnostics> {
        let plan = self.input().with_fixed(&self.at).load()?;
        self.show_notes(&plan);
        Ok(plan)
    }

    /// Returns the plan of one point, with the values of `at` by name.
    ///
    /// # Errors
    /// The errors of [`Self::load`].
    pub fn load_point<M: Model>(
        &self,
        at: &[String],
    ) -> Result<(Plan<M>, NamedValues), Diagnostics> {
        let (plan, at) = self.input().load_point(at)?;
        self.show_notes(&plan);
        Ok((plan, at))
    }

    /// Shows the notes of reading the grid file, and a note if `--set end_s` leaves the end of the
    /// window unchanged.
    fn show_notes<M: Model>(&self, plan: &Plan<M>) {
        plan.reading_notes.notes.iter().for_each(|note| tell(note));
        let is_set = |name| self.sets.iter().any(|set| argument_name(set) == name);
        let ([from, to], end_s) = (plan.window_s, plan.end_s);
        if is_set("end_s") && !is_set("window_to_s") && to < end_s {
            tell(&format!(
                "the window stays at {from} to {to} s; --set window_to_s={end_s} moves its end"
            ));
        }
    }
}

/// The arguments for a grid file and its result.
#[derive(Debug, clap::Args)]
pub struct ResultArgs {
    /// The grid file.
    #[command(flatten)]
    pub grid: GridArgs,
    /// Result file [default: results/NAME.parquet]
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

impl ResultArgs {
    /// Returns the path of the result.
    pub fn output<M: Model>(&self, plan: &Plan<M>) -> PathBuf {
        self.out.clone().unwrap_or_else(|| PathBuf::from(format!("results/{}.parquet", plan.name)))
    }

    /// Returns a command line with these arguments, for the user to copy.
    pub fn command(&self, verb: &str) -> String {
        let grid = &self.grid;
        let format_path = |path: &PathBuf| path.display().to_string();
        let sets = grid.sets().into_iter().map(|set| ("set", set));
        let other_options = grid.at.iter().map(|argument| ("at", argument.clone()));
        let other_options =
            other_options.chain(grid.name.iter().map(|name| ("name", name.clone())));
        let other_options =
            other_options.chain(self.out.iter().map(|out| ("out", format_path(out))));
        let command_line =
            format!("{} {verb} {}", program(), quote_for_shell(&format_path(&grid.grid)));
        sets.chain(other_options).fold(command_line, |command_line, (name, value)| {
            command_line + &format!(" --{name} {}", quote_for_shell(&value))
        })
    }
}

/// Returns the command line of this process without `--fresh`, for the user to resume it.
pub fn resume_command() -> String {
    let arguments = std::env::args_os().skip(1).filter(|word| word != "--fresh");
    let arguments = arguments.map(|word| quote_for_shell(&word.to_string_lossy()));
    std::iter::once(program().to_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}

/// Quotes a word for the shell, if it needs quotes.
pub fn quote_for_shell(word: &str) -> String {
    let is_unquoted = |c: char| c.is_alphanumeric() || "/._-=:,+".contains(c);
    if !word.is_empty() && word.chars().all(is_unquoted) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_line_is_quoted_for_the_shell() {
        let grid = GridArgs {
            grid: "my grids/it's.toml".into(),
            sets: vec!["mass_kg=20".into()],
            at: vec!["damping=9".into()],
            ratio_limit: Some(1.5),
            name: Some("light".into()),
        };
        let target = ResultArgs { grid, out: Some("x.parquet".into()) };
        assert_eq!(
            target.command("merge"),
            "sweep merge 'my grids/it'\\''s.toml' --set mass_kg=20 --set ratio_limit=1.5 \
             --at damping=9 --name light --out x.parquet"
        );
    }
}
