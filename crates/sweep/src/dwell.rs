//! What held speeds end in, over a grid: what `sweep dwell` asks of the engine of dwells, its rows,
//! and what a finished file says.

mod columns;
pub(crate) mod summary;

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use lane_ode::Simd;
use serde_json::{Value, json};
use washer_model::{Dwell, Endings, Starts, State, Wanted};
use washer_row::Status;

use crate::columns::at_speeds;
use crate::engine::{Carried, motions as motions_of};
use crate::plan::Plan;
use columns::{DwellColumn, RowOf, columns};
use sweep_engine::Error;
use sweep_engine::columns::row;
use sweep_engine::store::{Column, Done, Job, Kind as Cells, Layout, axis_columns};
use sweep_files::{FileKind, key};

/// Rows that a thread takes at once, at most: their starts fill lanes. Where rows have more starts
/// than these, they are fewer: what is kept of a trajectory is 0.1 MB.
const MOST_AT_ONCE: u64 = 16;
const STARTS_AT_ONCE: u64 = 128;

/// Which way the last motion is taken along from speed to speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carry {
    /// From the lowest speed up.
    Up,
    /// From the highest speed down.
    Down,
}

impl FromStr for Carry {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "up" => Ok(Self::Up),
            "down" => Ok(Self::Down),
            _ => Err("expected up or down".to_owned()),
        }
    }
}

impl Carry {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Up => "up",
            Self::Down => "down",
        }
    }
}

/// What a kick and the longest time may be.
pub(crate) const POSITIVE: &str = "a number above 0, at most 1e5";

/// Whether it is that.
pub(crate) fn is_positive(value: f64) -> bool {
    value > 0.0 && value <= 1e5
}

/// How motions are looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// From where and for how long.
    pub starts: Starts,
    /// A motion that is taken along instead of starts at each speed.
    pub carry: Option<Carry>,
    /// How many states once a turn are kept of each motion, a row each.
    pub sections: usize,
}

impl Search {
    /// Most starts a speed.
    pub(crate) const MOST_STARTS: i64 = 1024;

    /// Refuses what is out of bounds.
    ///
    /// # Errors
    /// [`Error::Option`].
    pub(crate) fn check(&self) -> Result<(), Error> {
        let Starts { count, kick_rad_per_s, longest_s, .. } = self.starts;
        let refuse = |option, given: String, expected: &str| {
            Err(Error::Option { option, given, expected: expected.to_owned() })
        };
        if !(1..=Self::MOST_STARTS as usize).contains(&count) {
            return refuse("starts", count.to_string(), "a number from 1 to 1024");
        }
        for (option, value) in [("kick", kick_rad_per_s), ("longest", longest_s)] {
            if !is_positive(value) {
                return refuse(option, value.to_string(), POSITIVE);
            }
        }
        Ok(())
    }

    fn json(&self, speeds_rpm: &[f64]) -> Value {
        let mut json = json!({
            "speed_rpm": speeds_rpm,
            "longest_s": self.starts.longest_s,
            "threshold": self.starts.with_threshold,
        });
        if self.sections > 0 {
            json["sections"] = json!(self.sections);
        }
        match self.carry {
            Some(carry) => json["carry"] = json!(carry.name()),
            None => {
                json["starts"] = json!(self.starts.count);
                json["kick_rad_per_s"] = json!(self.starts.kick_rad_per_s);
            }
        }
        json
    }
}

/// The motions of a plan's points at these speeds (rpm), and where their result goes unless it is
/// said: a row for each point, speed and motion.
pub(crate) fn motions<'a>(
    plan: &'a Plan,
    speeds_rpm: &[f64],
    search: &Search,
    out: Option<&Path>,
) -> (Job<'a>, PathBuf) {
    let asked = search.json(speeds_rpm);
    let mut axes = axis_columns(plan);
    axes.push(Column::new("speed_rpm", "rpm", "constant spin of the shaft", Cells::Axis));
    let layout = Layout {
        axes,
        columns: columns(plan, search.sections).into_iter().map(|column| column.declared).collect(),
        kind: FileKind::Dwell,
        rows_a_point: speeds_rpm.len() as u64,
        has_several: true,
        metadata: vec![(key::DWELL, asked.clone())],
    };
    let default = || PathBuf::from(format!("results/{}-dwell.parquet", plan.name));
    let job = at_speeds(plan, speeds_rpm, layout, ("dwell", asked));
    (job, out.map_or_else(default, Path::to_owned))
}

/// What the engine is asked for.
pub(crate) struct Motions {
    search: Search,
    columns: Vec<DwellColumn>,
}

impl Motions {
    pub(crate) fn new(plan: &Plan, mut search: Search) -> Self {
        // A motion that goes on for ever has no times and no windows.
        search.starts.wanted = Wanted {
            root_mean_squares: false,
            turns: false,
            clash_time: false,
            ..plan.model.measures.wanted()
        };
        Self { columns: columns(plan, search.sections), search }
    }

    /// Rows that a thread takes at once, of its share and of a number of speeds a point.
    pub(crate) fn at_once(&self, share: u64, speeds: u64) -> u64 {
        match self.search.carry {
            // The motion goes through all speeds of its point.
            Some(_) => speeds * (share / speeds).clamp(1, MOST_AT_ONCE),
            None => {
                share.min(STARTS_AT_ONCE / self.search.starts.count as u64).clamp(1, MOST_AT_ONCE)
            }
        }
    }

    /// The row of a point at a speed where nothing was found.
    pub(crate) fn failed(&self, number: u64, status: Status) -> Done {
        Done { point: number, rows: vec![row(&self.columns, &RowOf::Failed(status))] }
    }

    /// The rows of these dwells, each with its number. Once `is_stopped` says so, what comes means
    /// nothing.
    pub(crate) fn find(
        &self,
        simd: Simd,
        speeds_rpm: &[f64],
        asked: &[(u64, Dwell<'_>)],
        is_stopped: &dyn Fn() -> bool,
    ) -> Vec<Done> {
        let Some(carry) = self.search.carry else {
            let dwells: Vec<(Dwell<'_>, Carried)> =
                asked.iter().map(|(_, dwell)| (*dwell, None)).collect();
            let found = self.ask(simd, &dwells, is_stopped);
            return asked
                .iter()
                .zip(found)
                .map(|((row, _), found)| self.done(*row, found))
                .collect();
        };
        let speeds = speeds_rpm.len() as u64;
        let mut done = Vec::with_capacity(asked.len());
        let groups: Vec<&[(u64, Dwell<'_>)]> =
            asked.chunk_by(|a, b| a.0 / speeds == b.0 / speeds).collect();
        let mut carried: Vec<Carried> = vec![None; groups.len()];
        for step in 0..speeds {
            let place = if carry == Carry::Up { step } else { speeds - 1 - step };
            // Speeds before the first that is asked for lead to it.
            let is_needed = |group: &[(u64, Dwell<'_>)]| {
                let is_further = |row: &u64| match carry {
                    Carry::Up => row % speeds >= place,
                    Carry::Down => row % speeds <= place,
                };
                group.iter().any(|(row, _)| is_further(row))
            };
            let needed: Vec<usize> = (0..groups.len()).filter(|&k| is_needed(groups[k])).collect();
            let dwell = |k: &usize| {
                let speed_rpm = speeds_rpm[place as usize];
                (Dwell { point: groups[*k][0].1.point, speed_rpm }, carried[*k])
            };
            let dwells: Vec<(Dwell<'_>, Carried)> = needed.iter().map(dwell).collect();
            for (k, found) in needed.into_iter().zip(self.ask(simd, &dwells, is_stopped)) {
                carried[k] = found.as_ref().ok().and_then(last_state);
                let row = groups[k][0].0 / speeds * speeds + place;
                if groups[k].iter().any(|(asked, _)| *asked == row) {
                    done.push(self.done(row, found));
                }
            }
        }
        done
    }

    fn ask(
        &self,
        simd: Simd,
        dwells: &[(Dwell<'_>, Carried)],
        is_stopped: &dyn Fn() -> bool,
    ) -> Vec<Result<Endings, Status>> {
        let mut starts = self.search.starts;
        if self.search.carry.is_some() {
            starts.count = 1;
        }
        motions_of(simd, dwells, &starts, is_stopped)
    }

    fn with_last_sections(&self, mut found: Endings) -> Endings {
        for motion in &mut found.motions {
            let others = motion.sections.len().saturating_sub(self.search.sections);
            motion.sections.drain(..others);
        }
        found
    }

    fn done(&self, number: u64, found: Result<Endings, Status>) -> Done {
        match found {
            Ok(found) => {
                let found = Arc::new(self.with_last_sections(found));
                let turns = |motion: usize| 0..found.motions[motion].sections.len().max(1);
                let places = (0..found.motions.len())
                    .flat_map(|motion| turns(motion).map(move |turn| (motion, turn)));
                let of = |(motion, turn)| {
                    row(&self.columns, &RowOf::Motion(Arc::clone(&found), motion, turn))
                };
                Done { point: number, rows: places.map(of).collect() }
            }
            Err(status) => self.failed(number, status),
        }
    }
}

/// Where a machine is that is taken to the next speed.
fn last_state(found: &Endings) -> Carried {
    let motion = found.motions.first()?;
    (!matches!(motion.state, State::LeftRange { .. })).then_some(motion.end)
}
