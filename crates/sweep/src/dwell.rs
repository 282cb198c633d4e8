//! The motions in which machines at held speeds end (attractors), over a grid: the search of
//! `sweep dwell`, its rows, and the summary of a finished file.

pub(crate) mod columns;
pub(crate) mod summary;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use lane_ode::{Cancel, Simd};
use serde_json::{Value, json};
use sweep_parameter::named;
use washer_model::{AttractorStatus, Attractors, Gauge, HeldSpeed, Recorders, StartRule, decimal};
use washer_row::Status;

use crate::engine::{CarriedState, find_motions};
use crate::plan::{Plan, compared_channels};
use columns::{DwellColumn, DwellRow};
use sweep_engine::columns::{into_declarations, point_rows};
use sweep_engine::store::{DeclaredColumn, PointRows};
use sweep_engine::{Error, RunContext};

/// Maximum number of rows that a thread computes together. Basis: their starts fill the lanes.
/// Doubling it leaves threads without work at the end of a run.
const MAX_ROWS_PER_BATCH: u64 = 16;

/// Maximum number of starts of the rows that a thread computes together. Basis: the history of a
/// trajectory takes 0.1 MB. Doubling it doubles the memory of a thread.
const MAX_STARTS_PER_BATCH: u64 = 128;

named! {
    /// The direction in which the final state of a motion becomes the start at the next speed.
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

/// The expected value of a kick or of the longest time, in messages.
const EXPECTED_POSITIVE: &str = "a number above 0, at most 1e5";

fn is_accepted_positive(value: f64) -> bool {
    value > 0.0 && value <= 1e5
}

fn parse_positive(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value| is_accepted_positive(*value));
    value.ok_or_else(|| format!("expected {EXPECTED_POSITIVE}"))
}

/// The options of a search for motions at held speeds.
#[derive(Clone, Copy, Debug, PartialEq, clap::Args)]
pub struct AttractorSearch {
    /// Number of starts at each speed, the disturbed periodic response among them; at most 1024
    #[arg(long, value_name = "N", default_value_t = 12,
          value_parser = clap::value_parser!(u64).range(1..=AttractorSearch::MAX_STARTS))]
    pub starts: u64,
    /// Hardest kick, in rad/s of the tub's rocking
    #[arg(long, value_name = "RAD/S", default_value_t = 6.0, value_parser = parse_positive)]
    pub kick: f64,
    /// Start at each speed from the motion at the speed before, going up or down, instead of from
    /// several starts
    #[arg(long, value_name = "up|down", conflicts_with_all = ["starts", "kick", "threshold"])]
    pub carry: Option<Carry>,
    /// Search for the smallest kick after which the machine does not return, where there are
    /// several motions
    #[arg(long)]
    pub threshold: bool,
    /// Keep N states of each motion, at most 256, one a turn: each is a row with its coordinates
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true,
          value_parser = clap::value_parser!(u64).range(..=256))]
    pub sections: u64,
    /// Maximum time for which a motion that does not settle is followed, in s
    #[arg(long, value_name = "SECONDS", default_value_t = 600.0, value_parser = parse_positive)]
    pub longest: f64,
}

impl fmt::Display for AttractorSearch {
    /// Writes the options that differ from the defaults, as on a command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let defaults = StartRule::default();
        if let Some(carry) = self.carry {
            write!(f, " --carry {}", carry.name())?;
        }
        if self.starts != defaults.start_count as u64 {
            write!(f, " --starts {}", self.starts)?;
        }
        if self.kick != defaults.max_kick_rad_per_s {
            write!(f, " --kick {}", decimal(self.kick))?;
        }
        if self.longest != defaults.max_time_s {
            write!(f, " --longest {}", decimal(self.longest))?;
        }
        if self.sections > 0 {
            write!(f, " --sections {}", self.sections)?;
        }
        if self.threshold { f.write_str(" --threshold") } else { Ok(()) }
    }
}

impl AttractorSearch {
    /// Maximum number of starts at a speed. Basis: far more starts than lead to further motions.
    /// Doubling it doubles the longest time of a row.
    const MAX_STARTS: u64 = 1024;

    /// Checks that the options are within their bounds.
    ///
    /// # Errors
    /// Returns [`Error::Refused`] if one is not.
    pub(crate) fn check(&self) -> Result<(), Error> {
        if !(1..=Self::MAX_STARTS).contains(&self.starts) {
            return Err(Error::option("starts", self.starts, "a number from 1 to 1024"));
        }
        for (option, value) in [("kick", self.kick), ("longest", self.longest)] {
            if !is_accepted_positive(value) {
                return Err(Error::option(option, value, EXPECTED_POSITIVE));
            }
        }
        Ok(())
    }

    /// Returns the search and its speeds as JSON, for the plan of a result.
    pub(crate) fn to_json(self, speeds_rpm: &[f64]) -> Value {
        let mut search_json = json!({
            "speed_rpm": speeds_rpm,
            "longest_s": self.longest,
            "threshold": self.threshold,
        });
        if self.sections > 0 {
            search_json["sections"] = json!(self.sections);
        }
        match self.carry {
            Some(carry) => search_json["carry"] = json!(carry.name()),
            None => {
                search_json["starts"] = json!(self.starts);
                search_json["kick_rad_per_s"] = json!(self.kick);
            }
        }
        search_json
    }

    /// Returns the declared columns of a result.
    pub(crate) fn declared_columns(&self, plan: &Plan) -> Vec<DeclaredColumn> {
        into_declarations(self.row_columns(plan))
    }

    fn row_columns(&self, plan: &Plan) -> Vec<DwellColumn> {
        let channels = &compared_channels(plan);
        let measures = &plan.model.measures;
        let mut columns = columns::dwell_columns(channels, measures, self.sections > 0);
        columns.extend(self.carry.is_some().then(columns::carried_columns).into_iter().flatten());
        columns
    }
}

/// The search for attractors, prepared for the rows of a plan.
pub(crate) struct AttractorEngine {
    search: AttractorSearch,
    start_rule: StartRule,
    columns: Vec<DwellColumn>,
}

impl AttractorEngine {
    pub(crate) fn new(plan: &Plan, search: AttractorSearch) -> Self {
        // An attractor has no duration, so that metrics over times and windows are not recorded.
        let Recorders { mut gauges, .. } = plan.model.measures.recorders();
        gauges[Gauge::ClashTime as usize] = false;
        let recorders = Recorders { gauges, ..Recorders::default() };
        let start_rule = StartRule {
            start_count: if search.carry.is_some() { 1 } else { search.starts as usize },
            max_kick_rad_per_s: search.kick,
            max_time_s: search.longest,
            finds_threshold: search.threshold,
            recorders,
        };
        Self { search, start_rule, columns: search.row_columns(plan) }
    }

    /// Returns the number of rows that a thread computes together. `rows_per_thread` is its part of
    /// all rows, and `speeds` the number of speeds of a point.
    pub(crate) fn rows_per_batch(&self, rows_per_thread: u64, speeds: u64) -> u64 {
        match self.search.carry {
            // All speeds of a point are one sequence.
            Some(_) => speeds * (rows_per_thread / speeds).clamp(1, MAX_ROWS_PER_BATCH),
            None => rows_per_thread
                .min(MAX_STARTS_PER_BATCH / self.search.starts)
                .clamp(1, MAX_ROWS_PER_BATCH),
        }
    }

    /// Returns the row of a point at a speed for which no motion was found.
    pub(crate) fn failed_row(&self, row_index: u64, status: Status) -> PointRows {
        let failed = DwellRow { attractors: Err(status), motion_index: 0, turn_index: 0 };
        point_rows(&self.columns, row_index, [&failed])
    }

    /// Finds the motions of the requested points at held speeds, each with its row's index, and
    /// passes the rows to `sink`. After the context is stopped, they are meaningless.
    pub(crate) fn evaluate(
        &self,
        simd: Simd,
        speeds_rpm: &[f64],
        requested: &[(u64, HeldSpeed<'_>)],
        sink: &dyn Fn(PointRows),
        context: &RunContext<'_>,
    ) {
        let is_stopped = || context.must_stop();
        let Some(carry) = self.search.carry else {
            let held_speeds: Vec<(HeldSpeed<'_>, CarriedState)> =
                requested.iter().map(|(_, held_speed)| (*held_speed, None)).collect();
            let results =
                find_motions(simd, &held_speeds, &self.start_rule, Cancel::When(&is_stopped));
            for ((row, _), result) in requested.iter().zip(results) {
                sink(self.rows_of_motions(*row, result));
            }
            return;
        };
        let speed_count = speeds_rpm.len() as u64;
        let requests_by_point: Vec<&[(u64, HeldSpeed<'_>)]> =
            requested.chunk_by(|a, b| a.0 / speed_count == b.0 / speed_count).collect();
        let mut carried_states: Vec<CarriedState> = vec![None; requests_by_point.len()];
        for step in 0..speed_count {
            let position = if carry == Carry::Up { step } else { speed_count - 1 - step };
            // The speeds before the first requested row are needed for its start state.
            let must_still_compute = |(row, _): &(u64, HeldSpeed<'_>)| match carry {
                Carry::Up => row % speed_count >= position,
                Carry::Down => row % speed_count <= position,
            };
            let row_at_speed =
                |k: usize| requests_by_point[k][0].0 / speed_count * speed_count + position;
            let is_requested =
                |k: usize| requests_by_point[k].iter().any(|(row, _)| *row == row_at_speed(k));
            let mut groups_to_compute = Vec::new();
            for k in (0..requests_by_point.len())
                .filter(|k| requests_by_point[*k].iter().any(must_still_compute))
            {
                match Some(k)
                    .filter(|k| !is_requested(*k))
                    .and_then(|k| context.find_known_row(row_at_speed(k)))
                {
                    Some(known) => carried_states[k] = columns::read_carried_state(&known),
                    None => groups_to_compute.push(k),
                }
            }
            let held_speed_and_state = |k: &usize| {
                let speed_rpm = speeds_rpm[position as usize];
                (
                    HeldSpeed { point: requests_by_point[*k][0].1.point, speed_rpm },
                    carried_states[*k],
                )
            };
            let held_speeds: Vec<(HeldSpeed<'_>, CarriedState)> =
                groups_to_compute.iter().map(held_speed_and_state).collect();
            let results =
                find_motions(simd, &held_speeds, &self.start_rule, Cancel::When(&is_stopped));
            if is_stopped() {
                return;
            }
            for (k, result) in groups_to_compute.into_iter().zip(results) {
                carried_states[k] = result.as_ref().ok().and_then(carried_final_state);
                if is_requested(k) {
                    sink(self.rows_of_motions(row_at_speed(k), result));
                }
            }
        }
    }

    /// Returns the rows of the motions of a point at a speed.
    fn rows_of_motions(&self, row_index: u64, result: Result<Attractors, Status>) -> PointRows {
        let mut result = match result {
            Ok(result) => result,
            Err(status) => return self.failed_row(row_index, status),
        };
        for motion in &mut result.attractors {
            let surplus = motion.sections.len().saturating_sub(self.search.sections as usize);
            motion.sections.drain(..surplus);
        }
        let result = Arc::new(result);
        let mut rows = Vec::new();
        for motion in 0..result.attractors.len() {
            for turn in 0..result.attractors[motion].sections.len().max(1) {
                rows.push(DwellRow {
                    attractors: Ok(Arc::clone(&result)),
                    motion_index: motion,
                    turn_index: turn,
                });
            }
        }
        point_rows(&self.columns, row_index, &rows)
    }
}

/// Returns the state that the search carries to the next speed; `None` if the motion left the
/// model's range.
fn carried_final_state(attractors: &Attractors) -> CarriedState {
    let motion = attractors.attractors.first()?;
    (!matches!(motion.status, AttractorStatus::LeftRange { .. })).then_some(motion.end_state)
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::stability::HeldPlan;
    use sweep_engine::{Interrupt, RowLookup};
    use sweep_files::panics::{into_content, lock};

    #[test]
    fn a_carried_motion_starts_from_a_known_row() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/plateau.toml");
        let plan = crate::config::load(path.as_ref(), &[]).unwrap();
        let search = AttractorSearch {
            starts: 8,
            kick: 6.0,
            carry: Some(Carry::Up),
            threshold: false,
            sections: 0,
            longest: 5.0,
        };
        let speeds_rpm = &[300.0, 305.0, 310.0];
        let held_plan = HeldPlan { plan: &plan, speeds_rpm, search: Some(search) };
        let engine = held_plan.engine().unwrap();
        let interrupt = Interrupt::new();
        let evaluate_rows_with_known = |rows: std::ops::Range<u64>, known: &RowLookup<'_>| {
            let remaining_rows = Mutex::new(rows);
            let finished_rows = Mutex::new(Vec::new());
            let next_row = || lock(&remaining_rows).next().map(|row| (row, Vec::new()));
            engine.evaluator.evaluate(
                &next_row,
                &|row| lock(&finished_rows).push(row),
                &RunContext::with_known_rows(&interrupt, known),
            );
            let mut sorted_rows = into_content(finished_rows);
            sorted_rows.sort_by_key(|row: &PointRows| row.point);
            sorted_rows
        };
        let all_rows = evaluate_rows_with_known(0..3, &|_| None);
        assert_eq!(
            evaluate_rows_with_known(2..3, &|row| all_rows.get(row as usize).cloned()),
            all_rows[2..]
        );
        // With another known row the result differs, which shows that the row is used and not
        // computed again.
        assert_ne!(evaluate_rows_with_known(2..3, &|_| all_rows.first().cloned()), all_rows[2..]);
    }
}
