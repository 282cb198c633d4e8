//! Arguments that several subcommands take.

use std::path::PathBuf;

use crate::config::written::name_of;
use crate::config::{self, NamedValues};
use crate::{Diagnostics, GridInput, Model, Plan, program, tell};

/// A grid file and changes to its constants, as most commands take them.
#[derive(Debug, clap::Args)]
pub struct GridArgs {
    /// Grid file
    #[arg(value_name = "GRID.toml")]
    pub grid: PathBuf,
    /// Set a constant, over those of the grid file, or an axis, which sweeps nothing then; may be
    /// repeated
    #[arg(long = "set", value_name = "NAME=VALUE")]
    pub sets: Vec<String>,
    /// The point, on the grid or between its points: a value for an axis, which sweeps nothing
    /// then, and for any other parameter; may be repeated
    #[arg(long, value_name = "NAME=VALUE")]
    pub at: Vec<String>,
    /// Call a ratio below this reliable, over the grid file's limit
    #[arg(long, value_name = "RATIO")]
    pub ratio_limit: Option<f64>,
    /// Name of the run, over the grid file's: a result's default file, and what figures say
    #[arg(long, value_name = "NAME", value_parser = config::plain_name)]
    pub name: Option<String>,
}

impl GridArgs {
    /// What is set beside `--at`, in one list.
    pub fn sets(&self) -> Vec<String> {
        let limit = self.ratio_limit.map(|limit| format!("ratio_limit={limit}"));
        self.sets.iter().cloned().chain(limit).collect()
    }

    /// The grid with all changes but `--at`.
    pub fn input<M: Model>(&self) -> GridInput<M> {
        GridInput::file(self.grid.clone(), self.sets()).with_name(self.name.clone())
    }

    /// The plan.
    ///
    /// # Errors
    /// Every mistake in the grid file and the constants.
    pub fn load<M: Model>(&self) -> Result<Plan<M>, Diagnostics> {
        let plan = self.input().with_fixed(&self.at).load()?;
        self.tell_aside(&plan);
        Ok(plan)
    }

    /// The plan at one point, with the values of its axes.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_point<M: Model>(
        &self,
        at: &[String],
    ) -> Result<(Plan<M>, NamedValues), Diagnostics> {
        let (plan, at) = self.input().load_point(at)?;
        self.tell_aside(&plan);
        Ok((plan, at))
    }

    /// Tells what was noticed when the grid was read; and that `--set end_s` leaves the window
    /// where the grid file puts it.
    fn tell_aside<M: Model>(&self, plan: &Plan<M>) {
        plan.aside.notes.iter().for_each(|note| tell(note));
        let is_set = |name| self.sets.iter().any(|set| name_of(set) == name);
        let ([from, to], end_s) = (plan.window_s, plan.end_s);
        if is_set("end_s") && !is_set("window_to_s") && to < end_s {
            tell(&format!(
                "the window stays at {from} to {to} s; --set window_to_s={end_s} moves its end"
            ));
        }
    }
}

/// A grid and where its result goes, as the commands about runs take them.
#[derive(Debug, clap::Args)]
pub struct ResultArgs {
    /// The grid.
    #[command(flatten)]
    pub grid: GridArgs,
    /// Result file [default: results/NAME.parquet]
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

impl ResultArgs {
    /// The result file.
    pub fn output<M: Model>(&self, plan: &Plan<M>) -> PathBuf {
        self.out.clone().unwrap_or_else(|| PathBuf::from(format!("results/{}.parquet", plan.name)))
    }

    /// A command line about the same run, for a user to copy.
    pub fn command(&self, verb: &str) -> String {
        let (grid, shown) = (&self.grid, |path: &PathBuf| path.display().to_string());
        let sets = grid.sets().into_iter().map(|set| ("set", set));
        let further = grid.at.iter().map(|at| ("at", at.clone()));
        let further = further.chain(grid.name.iter().map(|name| ("name", name.clone())));
        let further = further.chain(self.out.iter().map(|out| ("out", shown(out))));
        let line = format!("{} {verb} {}", program(), quoted(&shown(&grid.grid)));
        sets.chain(further)
            .fold(line, |line, (name, value)| line + &format!(" --{name} {}", quoted(&value)))
    }
}

/// The command line of this process, to copy: it goes on, so `--fresh` is no part of it.
pub fn typed() -> String {
    let words = std::env::args_os().skip(1).filter(|word| word != "--fresh");
    let words = words.map(|word| quoted(&word.to_string_lossy()));
    std::iter::once(program().to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// A word as a shell takes it.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-=:,+".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_to_copy_survives_the_shell() {
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
