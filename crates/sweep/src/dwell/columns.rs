//! The columns of results of `sweep dwell`.

use std::sync::Arc;

use sweep_engine::columns::{Cell, MODELS, ResultColumn};
use washer_model::{COORDINATES, Channel, Ending, Endings, STATE_LEN, Settled, State};
use washer_row::{Measured, Status};

use crate::plan::Plan;

/// A row: one of the motions of a dwell, at one of its turns from 0 if these are kept; or none.
pub(super) enum RowOf {
    Motion(Arc<Endings>, usize, usize),
    Failed(Status),
}

pub(super) type DwellColumn = ResultColumn<RowOf>;

/// Kinds of motions that have settled, of [`Ending::KINDS`].
const SETTLED: usize = 5;

/// How a row came about.
const STATUSES: [&str; 8] = [
    "ok",
    "left_range",
    "not_settled",
    "no_equilibrium",
    "panicked",
    "no_multipliers",
    "too_slow",
    "no_response",
];

impl RowOf {
    fn found(&self) -> Option<&Endings> {
        match self {
            Self::Motion(found, ..) => Some(found),
            Self::Failed(_) => None,
        }
    }

    fn motion(&self) -> Option<&Ending> {
        match self {
            Self::Motion(found, motion, _) => found.motions.get(*motion),
            Self::Failed(_) => None,
        }
    }

    /// The motion, if it stayed within what the model is good for.
    fn within(&self) -> Option<&Ending> {
        self.motion().filter(|motion| !matches!(motion.state, State::LeftRange { .. }))
    }

    fn amplitude(&self, model: usize, channel: Channel) -> Option<f64> {
        if model == 0 {
            return Some(self.within()?.peaks[channel.index()]);
        }
        Some(self.found()?.responses.first()?.linear[channel.index()])
    }

    fn kind(&self) -> Option<usize> {
        Some(self.motion()?.kind()).filter(|kind| *kind < SETTLED)
    }

    fn frequency_cpm(&self) -> Option<f64> {
        match self.motion()?.settled? {
            Settled::QuasiPeriodic { frequency_cpm } => Some(frequency_cpm),
            Settled::Periodic { .. } | Settled::Chaotic => None,
        }
    }

    fn status(&self) -> usize {
        match self {
            Self::Motion(..) => match self.motion().map(|motion| motion.state) {
                Some(State::Ok) => 0,
                Some(State::LeftRange { .. }) => 1,
                Some(State::NotSettled) | None => 2,
            },
            Self::Failed(Status::NoEquilibrium) => 3,
            Self::Failed(Status::NoMultipliers) => 5,
            Self::Failed(Status::TooSlow) => 6,
            Self::Failed(Status::NoResponse) => 7,
            Self::Failed(_) => 4,
        }
    }
}

type Number = fn(&RowOf) -> Option<f64>;

fn measured(name: &str, unit: &str, text: &str, of: Number) -> DwellColumn {
    ResultColumn::new(name, unit, text, Cell::Measured(Box::new(of)))
}

/// Every column, in order.
pub(super) fn columns(plan: &Plan, sections: usize) -> Vec<DwellColumn> {
    let channels = &plan.reliability.channels;
    let mut columns = vec![
        ResultColumn::new(
            "motion",
            "1",
            "number of the motion at this speed: 0 is the one that the disturbed periodic response \
             ends in",
            Cell::Count(Box::new(|row: &RowOf| match row {
                RowOf::Motion(_, motion, _) => *motion as u64,
                RowOf::Failed(_) => 0,
            })),
        ),
        ResultColumn::new(
            "starts",
            "1",
            "how many starts ended in it",
            Cell::KnownCount(Box::new(|row: &RowOf| Some(u64::from(row.motion()?.starts)))),
        ),
        ResultColumn::new(
            "starts_made",
            "1",
            "how many starts there were",
            Cell::KnownCount(Box::new(|row: &RowOf| Some(u64::from(row.found()?.starts)))),
        ),
        ResultColumn::new(
            "kind",
            "",
            "periodic: it repeats every turn; periodic_2: every second; periodic_m: every \
             period_turns; quasi_periodic: two frequencies; chaotic: neighbours part; null where \
             it did not settle",
            Cell::Name(Ending::KINDS[..SETTLED].to_vec(), Box::new(RowOf::kind)),
        ),
        ResultColumn::new(
            "period_turns",
            "1",
            "after how many turns it repeats; null where it does not",
            Cell::KnownCount(Box::new(|row: &RowOf| match row.motion()?.settled? {
                Settled::Periodic { turns } => Some(u64::from(turns)),
                Settled::QuasiPeriodic { .. } | Settled::Chaotic => None,
            })),
        ),
    ];
    for (k, model) in MODELS.into_iter().enumerate() {
        for &channel in channels {
            let what = channel.description();
            let text = match k {
                0 => format!(
                    "{what}: largest deviation from equilibrium over the motion's last turns; \
                     null where it left the model's range"
                ),
                _ => format!("{what}: the same by the linear model, which repeats every turn"),
            };
            let cell = Cell::Measured(Box::new(move |row: &RowOf| row.amplitude(k, channel)));
            let name = format!("{model}_{}", channel.name());
            columns.push(ResultColumn::new(name, channel.unit(), text, cell));
        }
    }
    for &channel in channels {
        let text = format!(
            "{}: the same of the nonlinear model's periodic response, stable or not",
            channel.description()
        );
        let cell = Cell::Measured(Box::new(move |row: &RowOf| {
            Some(row.found()?.responses.first()?.nonlinear[channel.index()])
        }));
        let name = format!("periodic_{}", channel.name());
        columns.push(ResultColumn::new(name, channel.unit(), text, cell));
    }
    let of_turns = |number: &Measured| number.metric.is_of_turns();
    for number in plan.model.measures.of_model().filter(of_turns) {
        let text = format!("{}, over 128 further turns of the motion", number.description());
        let text = text.replace(" in the window", "");
        let cell = Cell::Measured(Box::new(move |row: &RowOf| number.of(&row.within()?.extra)));
        columns.push(ResultColumn::new(
            number.column("nonlinear"),
            number.metric.unit(),
            text,
            cell,
        ));
    }
    columns.extend([
        measured(
            "growth_per_s",
            "1/s",
            "how fast the fastest growing disturbance of the periodic response grows; negative \
             where all decay",
            |row| Some(row.found()?.responses.first()?.growth_per_s()),
        ),
        measured(
            "frequency_cpm",
            "1/min",
            "of two frequencies the strongest line once a turn, from 0 to half the speed",
            RowOf::frequency_cpm,
        ),
        measured("other_frequency_cpm", "1/min", "the speed less frequency_cpm", |row| {
            Some(row.found()?.responses.first()?.speed_rpm - row.frequency_cpm()?)
        }),
        measured(
            "exponent_per_s",
            "1/s",
            "largest Lyapunov exponent; null where the motion's spectrum says what it is",
            |row| Some(row.motion()?.exponent?.per_s),
        ),
        measured("exponent_error_per_s", "1/s", "its standard error", |row| {
            Some(row.motion()?.exponent?.error_per_s)
        }),
        measured(
            "min_gap_m",
            "m",
            "least gap between drum and tub over the motion's last turns; negative where they \
             clash",
            |row| Some(row.within()?.min_gap_m),
        ),
        measured(
            "threshold_rad_per_s",
            "rad/s",
            "smallest kick that does not come back to motion 0, of those tried; null where all do \
             or --threshold was not given",
            |row| row.found()?.threshold_rad_per_s,
        ),
        ResultColumn::new(
            "near_response",
            "",
            "of a motion that did not settle: whether its largest deviations are within a factor \
             of two of the periodic response's, which it then comes to or leaves slowly",
            Cell::Flag(Box::new(|row: &RowOf| {
                let motion = row.motion().filter(|motion| motion.state == State::NotSettled)?;
                Some(row.found()?.is_near_response(motion))
            })),
        ),
        measured("followed_s", "s", "how long its first trajectory was followed", |row| {
            Some(row.motion()?.time_s)
        }),
        ResultColumn::new(
            "status",
            "",
            "ok; left_range: it went farther than the model is good for, after followed_s; \
             not_settled: the largest deviations still change; or why there is no motion",
            Cell::Name(STATUSES.to_vec(), Box::new(|row: &RowOf| Some(row.status()))),
        ),
    ]);
    if sections > 0 {
        columns.extend(section_columns());
    }
    columns
}

/// Columns of states once a turn.
fn section_columns() -> Vec<DwellColumn> {
    let turn = |row: &RowOf| match row {
        RowOf::Motion(_, _, turn) => Some(*turn as u64),
        RowOf::Failed(_) => None,
    };
    let text = "number of the turn among those kept, from 0: what follows is where it ends";
    let mut columns = vec![ResultColumn::new("turn", "1", text, Cell::KnownCount(Box::new(turn)))];
    for i in 0..STATE_LEN {
        let q = i % COORDINATES;
        let unit = if q < 4 { "m" } else { "rad" };
        let (name, unit, text) = match i < COORDINATES {
            true => (format!("q{}_{unit}", q + 1), unit.to_owned(), "coordinate from equilibrium"),
            false => (format!("u{}_{unit}_per_s", q + 1), format!("{unit}/s"), "its speed"),
        };
        let cell = Cell::Measured(Box::new(move |row: &RowOf| match row {
            RowOf::Motion(found, motion, turn) => {
                Some(found.motions.get(*motion)?.sections.get(*turn)?[i])
            }
            RowOf::Failed(_) => None,
        }));
        let text = format!("{text}, where the unbalance is up");
        columns.push(ResultColumn::new(name, &unit, text, cell));
    }
    columns
}
