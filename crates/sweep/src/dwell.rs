//! What held speeds end in, over a grid: what `sweep dwell` asks of the engine of dwells, its rows,
//! and what a finished file says.

pub(crate) mod columns;
pub(crate) mod summary;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use lane_ode::Simd;
use serde_json::{Value, json};
use sweep_parameter::named;
use washer_model::{Dwell, Endings, Gauge, Recorders, Starts, State, decimal};
use washer_row::Status;

use crate::engine::{Carried, find_motions};
use crate::plan::Plan;
use columns::{DwellColumn, RowOf};
use sweep_engine::columns::{declared, row};
use sweep_engine::store::{Column, Done};
use sweep_engine::{Error, RunContext};

/// Rows that a thread takes at once, at most: their starts fill lanes. Where rows have more starts
/// than these, they are fewer: what is kept of a trajectory is 0.1 MB.
const MOST_AT_ONCE: u64 = 16;
const STARTS_AT_ONCE: u64 = 128;

named! {
    /// Which way the last motion is taken along from speed to speed.
    pub enum Carry {
        /// From the lowest speed up.
        Up = "up",
        /// From the highest speed down.
        Down = "down",
    }
}

impl FromStr for Carry {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::named(text).ok_or_else(|| "expected up or down".to_owned())
    }
}

/// What a kick and the longest time may be.
const POSITIVE: &str = "a number above 0, at most 1e5";

fn is_positive(value: f64) -> bool {
    value > 0.0 && value <= 1e5
}

fn positive(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value| is_positive(*value));
    value.ok_or_else(|| format!("expected {POSITIVE}"))
}

/// How motions are looked for.
#[derive(Clone, Copy, Debug, PartialEq, clap::Args)]
pub struct Search {
    /// Starts a speed, the disturbed periodic response among them; at most 1024
    #[arg(long, value_name = "N", default_value_t = 12,
          value_parser = clap::value_parser!(u64).range(1..=Search::MOST_STARTS))]
    pub starts: u64,
    /// Hardest kick, in rad/s of the tub's rocking
    #[arg(long, value_name = "RAD/S", default_value_t = 6.0, value_parser = positive)]
    pub kick: f64,
    /// Take the motion along from speed to speed, up or down, instead of starts at each
    #[arg(long, value_name = "up|down", conflicts_with_all = ["starts", "kick", "threshold"])]
    pub carry: Option<Carry>,
    /// Look for the smallest kick that does not come back, where there are several motions
    #[arg(long)]
    pub threshold: bool,
    /// Keep so many states of each motion, at most 256, once a turn: a row each, with its
    /// coordinates
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true,
          value_parser = clap::value_parser!(u64).range(..=256))]
    pub sections: u64,
    /// Follow a motion that does not settle for at most this long, in s
    #[arg(long, value_name = "SECONDS", default_value_t = 600.0, value_parser = positive)]
    pub longest: f64,
}

impl fmt::Display for Search {
    /// What differs from the defaults, as it is written on a command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let usual = Starts::default();
        if let Some(carry) = self.carry {
            write!(f, " --carry {}", carry.name())?;
        }
        if self.starts != usual.count as u64 {
            write!(f, " --starts {}", self.starts)?;
        }
        if self.kick != usual.kick_rad_per_s {
            write!(f, " --kick {}", decimal(self.kick))?;
        }
        if self.longest != usual.longest_s {
            write!(f, " --longest {}", decimal(self.longest))?;
        }
        if self.sections > 0 {
            write!(f, " --sections {}", self.sections)?;
        }
        if self.threshold { f.write_str(" --threshold") } else { Ok(()) }
    }
}

impl Search {
    /// Most starts a speed.
    const MOST_STARTS: u64 = 1024;

    /// Refuses what is out of bounds.
    ///
    /// # Errors
    /// [`Error::Refused`].
    pub(crate) fn check(&self) -> Result<(), Error> {
        if !(1..=Self::MOST_STARTS).contains(&self.starts) {
            return Err(Error::option("starts", self.starts, "a number from 1 to 1024"));
        }
        for (option, value) in [("kick", self.kick), ("longest", self.longest)] {
            if !is_positive(value) {
                return Err(Error::option(option, value, POSITIVE));
            }
        }
        Ok(())
    }

    /// As a plan says what was asked at these speeds.
    pub(crate) fn json(&self, speeds_rpm: &[f64]) -> Value {
        let mut json = json!({
            "speed_rpm": speeds_rpm,
            "longest_s": self.longest,
            "threshold": self.threshold,
        });
        if self.sections > 0 {
            json["sections"] = json!(self.sections);
        }
        match self.carry {
            Some(carry) => json["carry"] = json!(carry.name()),
            None => {
                json["starts"] = json!(self.starts);
                json["kick_rad_per_s"] = json!(self.kick);
            }
        }
        json
    }

    /// The columns of a file.
    pub(crate) fn columns(&self, plan: &Plan) -> Vec<Column> {
        declared(self.columns_of_rows(plan))
    }

    fn columns_of_rows(&self, plan: &Plan) -> Vec<DwellColumn> {
        let (channels, measures) = (&plan.reliability.channels, &plan.model.measures);
        let mut columns = columns::columns(channels, measures, self.sections > 0);
        columns.extend(self.carry.is_some().then(columns::carried).into_iter().flatten());
        columns
    }
}

/// What the engine is asked for.
pub(crate) struct Motions {
    search: Search,
    starts: Starts,
    columns: Vec<DwellColumn>,
}

impl Motions {
    pub(crate) fn new(plan: &Plan, search: Search) -> Self {
        // A motion that goes on for ever has no times and no windows.
        let Recorders { mut gauges, .. } = plan.model.measures.recorders();
        gauges[Gauge::ClashTime as usize] = false;
        let wanted = Recorders { gauges, ..Recorders::default() };
        let starts = Starts {
            count: if search.carry.is_some() { 1 } else { search.starts as usize },
            kick_rad_per_s: search.kick,
            longest_s: search.longest,
            with_threshold: search.threshold,
            wanted,
        };
        Self { search, starts, columns: search.columns_of_rows(plan) }
    }

    /// Rows that a thread takes at once, of its share and of a number of speeds a point.
    pub(crate) fn at_once(&self, share: u64, speeds: u64) -> u64 {
        match self.search.carry {
            // The motion goes through all speeds of its point.
            Some(_) => speeds * (share / speeds).clamp(1, MOST_AT_ONCE),
            None => share.min(STARTS_AT_ONCE / self.search.starts).clamp(1, MOST_AT_ONCE),
        }
    }

    /// The row of a point at a speed where nothing was found.
    pub(crate) fn failed(&self, number: u64, status: Status) -> Done {
        let none = RowOf { found: Err(status), motion: 0, turn: 0 };
        Done { point: number, rows: vec![row(&self.columns, &none)] }
    }

    /// Keeps the rows of these dwells, each with its number, as they come. Once the watch has
    /// stopped, what comes means nothing.
    pub(crate) fn find(
        &self,
        simd: Simd,
        speeds_rpm: &[f64],
        asked: &[(u64, Dwell<'_>)],
        keep: &dyn Fn(Done),
        watch: &RunContext<'_>,
    ) {
        let is_stopped = || watch.stopped();
        let Some(carry) = self.search.carry else {
            let dwells: Vec<(Dwell<'_>, Carried)> =
                asked.iter().map(|(_, dwell)| (*dwell, None)).collect();
            let found = find_motions(simd, &dwells, &self.starts, &is_stopped);
            let each = asked.iter().zip(found);
            return each.for_each(|((row, _), found)| keep(self.done(*row, found)));
        };
        let speeds = speeds_rpm.len() as u64;
        let groups: Vec<&[(u64, Dwell<'_>)]> =
            asked.chunk_by(|a, b| a.0 / speeds == b.0 / speeds).collect();
        let mut carried: Vec<Carried> = vec![None; groups.len()];
        for step in 0..speeds {
            let place = if carry == Carry::Up { step } else { speeds - 1 - step };
            // Speeds before the first that is asked for lead to it.
            let is_further = |(row, _): &(u64, Dwell<'_>)| match carry {
                Carry::Up => row % speeds >= place,
                Carry::Down => row % speeds <= place,
            };
            let row_of = |k: usize| groups[k][0].0 / speeds * speeds + place;
            let is_asked = |k: usize| groups[k].iter().any(|(asked, _)| *asked == row_of(k));
            let mut needed = Vec::new();
            for k in (0..groups.len()).filter(|k| groups[*k].iter().any(is_further)) {
                match Some(k).filter(|k| !is_asked(*k)).and_then(|k| watch.known(row_of(k))) {
                    Some(known) => carried[k] = columns::carried_by(&known),
                    None => needed.push(k),
                }
            }
            let dwell = |k: &usize| {
                let speed_rpm = speeds_rpm[place as usize];
                (Dwell { point: groups[*k][0].1.point, speed_rpm }, carried[*k])
            };
            let dwells: Vec<(Dwell<'_>, Carried)> = needed.iter().map(dwell).collect();
            let found = find_motions(simd, &dwells, &self.starts, &is_stopped);
            if is_stopped() {
                return;
            }
            for (k, found) in needed.into_iter().zip(found) {
                carried[k] = found.as_ref().ok().and_then(last_state);
                if is_asked(k) {
                    keep(self.done(row_of(k), found));
                }
            }
        }
    }

    fn done(&self, number: u64, found: Result<Endings, Status>) -> Done {
        let mut found = match found {
            Ok(found) => found,
            Err(status) => return self.failed(number, status),
        };
        for motion in &mut found.motions {
            let others = motion.sections.len().saturating_sub(self.search.sections as usize);
            motion.sections.drain(..others);
        }
        let found = Arc::new(found);
        let turns = |motion: usize| 0..found.motions[motion].sections.len().max(1);
        let places = (0..found.motions.len())
            .flat_map(|motion| turns(motion).map(move |turn| (motion, turn)));
        let of = |(motion, turn)| {
            row(&self.columns, &RowOf { found: Ok(Arc::clone(&found)), motion, turn })
        };
        Done { point: number, rows: places.map(of).collect() }
    }
}

/// Where a machine is that is taken to the next speed.
fn last_state(found: &Endings) -> Carried {
    let motion = found.motions.first()?;
    (!matches!(motion.state, State::LeftRange { .. })).then_some(motion.end)
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::stability::Held;
    use sweep_engine::{Engine as _, Interrupt, RowLookup};
    use sweep_files::panics::{lock, unlocked};

    #[test]
    fn a_motion_is_taken_along_from_a_row_that_was_kept() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/plateau.toml");
        let plan = crate::config::load(path.as_ref(), &[]).unwrap();
        let (carry, longest) = (Some(Carry::Up), 5.0);
        let search = Search { starts: 8, kick: 6.0, carry, threshold: false, sections: 0, longest };
        let held = Held { plan: &plan, speeds_rpm: &[300.0, 305.0, 310.0], search: Some(search) };
        let (engine, calm) = (held.engine().unwrap(), Interrupt::new());
        let found = |rows: std::ops::Range<u64>, known: &RowLookup<'_>| {
            let (left, done) = (Mutex::new(rows), Mutex::new(Vec::new()));
            let next = || lock(&left).next().map(|row| (row, Vec::new()));
            engine.evaluate(
                &next,
                &|one| lock(&done).push(one),
                &RunContext::with_known_rows(&calm, known),
            );
            let mut done = unlocked(done);
            done.sort_by_key(|one: &Done| one.point);
            done
        };
        let whole = found(0..3, &|_| None);
        assert_eq!(found(2..3, &|row| whole.get(row as usize).cloned()), whole[2..]);
        // It is taken from there, and not found again.
        assert_ne!(found(2..3, &|_| whole.first().cloned()), whole[2..]);
    }
}
