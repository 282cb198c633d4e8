//! The columns of results of `sweep dwell`.

use sweep_engine::columns::{Cell, MODELS, ResultColumn};
use washer_model::{Channel, Ending, Endings, Settled, State};
use washer_row::Status;

use crate::plan::Plan;

/// A row: one of the motions of a dwell, or none.
pub(super) enum RowOf {
    Motion(Endings, usize),
    Failed(Status),
}

pub(super) type DwellColumn = ResultColumn<RowOf>;

/// Kinds of motions. A motion of any other period is `periodic_m`.
const KINDS: [&str; 5] = ["periodic", "periodic_2", "periodic_m", "quasi_periodic", "chaotic"];

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
            Self::Motion(found, _) => Some(found),
            Self::Failed(_) => None,
        }
    }

    fn motion(&self) -> Option<&Ending> {
        match self {
            Self::Motion(found, motion) => found.motions.get(*motion),
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
        Some(match self.motion()?.settled? {
            Settled::Periodic { turns } => (turns as usize).min(3) - 1,
            Settled::QuasiPeriodic { .. } => 3,
            Settled::Chaotic => 4,
        })
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
pub(super) fn columns(plan: &Plan) -> Vec<DwellColumn> {
    let channels = &plan.reliability.channels;
    let mut columns = vec![
        ResultColumn::new(
            "motion",
            "1",
            "number of the motion at this speed: 0 is the one that the disturbed periodic response \
             ends in",
            Cell::Count(Box::new(|row: &RowOf| match row {
                RowOf::Motion(_, motion) => *motion as u64,
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
            Cell::Name(KINDS.to_vec(), Box::new(RowOf::kind)),
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
    columns
}
