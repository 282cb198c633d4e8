//! The columns of results of `sweep dwell`.

use std::sync::Arc;

use sweep_engine::columns::{MODEL_NAMES, ResultColumn};
use sweep_engine::store::{CellType, PointRows};
use washer_model::{
    Attractor, AttractorStatus, Attractors, COORDINATES, Channel, MotionKind, Response, STATE_LEN,
};
use washer_row::{Measures, MetricColumn, Status};

use super::carried_final_state;
use crate::engine::CarriedState;

/// The data of a row: a motion of a point at a held speed, and one of the motion's turns.
pub(crate) struct DwellRow {
    /// All motions of the point at this speed, or the reason why there are none.
    pub(super) attractors: Result<Arc<Attractors>, Status>,
    /// The number of the motion.
    pub(super) motion_index: usize,
    /// The number of the turn among the turns of which states are stored; 0 if there are none.
    pub(super) turn_index: usize,
}

pub(crate) type DwellColumn = ResultColumn<DwellRow>;

/// Number of the kinds of settled motions, which come first in [`Attractor::KIND_NAMES`].
const SETTLED_KIND_COUNT: usize = 5;

/// The statuses of rows.
const STATUS_NAMES: [&str; 9] = [
    "ok",
    "left_range",
    "not_settled",
    "transient",
    "no_equilibrium",
    "panicked",
    "no_multipliers",
    "too_slow",
    "no_response",
];

impl DwellRow {
    fn attractors(&self) -> Option<&Attractors> {
        self.attractors.as_deref().ok()
    }

    fn motion(&self) -> Option<&Attractor> {
        self.attractors()?.attractors.get(self.motion_index)
    }

    /// Returns the motion, if it stayed within the model's range.
    fn motion_in_range(&self) -> Option<&Attractor> {
        self.motion().filter(|motion| !matches!(motion.status, AttractorStatus::LeftRange { .. }))
    }

    /// Returns the periodic response of a machine that runs up.
    fn response(&self) -> Option<&Response> {
        self.attractors()?.responses.first()
    }

    fn settled_kind_index(&self) -> Option<usize> {
        Some(self.motion()?.kind_index()).filter(|kind| *kind < SETTLED_KIND_COUNT)
    }

    fn period_turns(&self) -> Option<u64> {
        match self.motion()?.motion_kind? {
            MotionKind::Periodic { turns } => Some(u64::from(turns)),
            MotionKind::QuasiPeriodic { .. } | MotionKind::Chaotic => None,
        }
    }

    fn frequency_cpm(&self) -> Option<f64> {
        match self.motion()?.motion_kind? {
            MotionKind::QuasiPeriodic { frequency_cpm } => Some(frequency_cpm),
            MotionKind::Periodic { .. } | MotionKind::Chaotic => None,
        }
    }

    fn transient_life_s(&self) -> Option<f64> {
        match self.motion()?.status {
            AttractorStatus::Transient { life_s } => Some(life_s),
            AttractorStatus::Ok
            | AttractorStatus::LeftRange { .. }
            | AttractorStatus::NotSettled => None,
        }
    }

    fn is_near_response(&self) -> Option<bool> {
        let motion = self.motion().filter(|motion| motion.status == AttractorStatus::NotSettled)?;
        Some(self.attractors()?.is_near_response(motion))
    }

    fn status_name(&self) -> &'static str {
        match self.attractors {
            Ok(_) => match self.motion().map(|motion| motion.status) {
                Some(AttractorStatus::Ok) => "ok",
                Some(AttractorStatus::LeftRange { .. }) => "left_range",
                Some(AttractorStatus::Transient { .. }) => "transient",
                Some(AttractorStatus::NotSettled) | None => "not_settled",
            },
            Err(Status::NoEquilibrium) => "no_equilibrium",
            Err(Status::NoMultipliers) => "no_multipliers",
            Err(Status::TooSlow) => "too_slow",
            Err(Status::NoResponse) => "no_response",
            Err(_) => "panicked",
        }
    }
}

/// Returns a column of counts, which are null where they are unknown.
fn count_column(name: &str, description: &str, count: fn(&DwellRow) -> Option<u64>) -> DwellColumn {
    ResultColumn::new(name, "1", description, CellType::KnownCount, count)
}

/// Returns the columns of the amplitudes of both models, by channel.
fn channel_columns(channels: &[Channel]) -> Vec<DwellColumn> {
    type AmplitudesOf = fn(&DwellRow) -> Option<&[f64; Channel::ALL.len()]>;
    let amplitude_sources: [(&str, &str, AmplitudesOf); 3] = [
        (
            MODEL_NAMES[0],
            "largest deviation from equilibrium over the motion's last turns; null where it left \
             the model's range",
            |row| Some(&row.motion_in_range()?.peaks),
        ),
        (MODEL_NAMES[1], "the same by the linear model, which repeats every turn", |row| {
            Some(&row.response()?.linear_peaks)
        }),
        ("periodic", "the same of the nonlinear model's periodic response, stable or not", |row| {
            Some(&row.response()?.nonlinear_peaks)
        }),
    ];
    let mut columns = Vec::new();
    for (prefix, description, amplitudes) in amplitude_sources {
        for &channel in channels {
            let description = format!("{}: {description}", channel.description());
            let name = format!("{prefix}_{}", channel.name());
            let amplitude_of = move |row: &DwellRow| Some(amplitudes(row)?[channel.index()]);
            columns.push(ResultColumn::measured(name, channel.unit(), description, amplitude_of));
        }
    }
    columns
}

/// Returns all columns in order. `with_sections` adds those of the states at successive turns.
pub(crate) fn dwell_columns(
    channels: &[Channel],
    measures: &Measures,
    with_sections: bool,
) -> Vec<DwellColumn> {
    let motion_number_of = |row: &DwellRow| Some(row.motion_index as u64);
    let description = "number of the motion at this speed: 0 is the one that the disturbed \
                periodic response ends in";
    let mut columns =
        vec![ResultColumn::new("motion", "1", description, CellType::Count, motion_number_of)];
    let description = "how many starts ended in it; 0 where only a transient did";
    columns.push(count_column("starts", description, |row| Some(u64::from(row.motion()?.starts))));
    let description = "how many starts there were: the disturbed periodic responses, then kicks, \
                two thirds of them along the modes that rock most, the others in random \
                directions, every other one of the machine at rest";
    columns.push(count_column("starts_made", description, |row| {
        Some(u64::from(row.attractors()?.starts))
    }));
    let description = "smallest kick off the periodic response that led to it; 0: a disturbed \
                periodic response did; null where only a kick of the machine at rest, a \
                transient or the last speed's motion did";
    columns.push(ResultColumn::measured(
        "least_kick_rad_per_s",
        "rad/s",
        description,
        |row: &DwellRow| row.motion()?.least_kick_rad_per_s,
    ));
    let description = "periodic: it repeats every turn; periodic_2: every second; periodic_m: \
                every period_turns; quasi_periodic: two frequencies; chaotic: neighbours part, \
                and eight trajectories from its states stayed in it for 240 s; null where it \
                did not settle";
    columns.push(ResultColumn::name(
        "kind",
        description,
        Attractor::KIND_NAMES[..SETTLED_KIND_COUNT].to_vec(),
        DwellRow::settled_kind_index,
    ));
    let description = "after how many turns it repeats; null where it does not";
    columns.push(count_column("period_turns", description, DwellRow::period_turns));
    columns.extend(channel_columns(channels));
    let has_periodic_value = |number: &MetricColumn| number.metric.has_periodic_value();
    for column in measures.model_columns().filter(has_periodic_value) {
        let description = format!("{}, over 128 further turns of the motion", column.description());
        let description = description.replace(" in the window", "");
        let name = column.column(MODEL_NAMES[0]);
        let unit = column.metric.properties().unit;
        let value_of = move |row: &DwellRow| column.value(&row.motion_in_range()?.extra_reading);
        columns.push(ResultColumn::measured(name, unit, description, value_of));
    }
    let measured_columns: [(&str, &str, &str, fn(&DwellRow) -> Option<f64>); 7] = [
        (
            "growth_per_s",
            "1/s",
            "how fast the fastest growing disturbance of the periodic response grows; negative \
             where all decay",
            |row| Some(row.response()?.growth_per_s()),
        ),
        (
            "frequency_cpm",
            "1/min",
            "of two frequencies the strongest line once a turn, from 0 to half the speed",
            DwellRow::frequency_cpm,
        ),
        ("other_frequency_cpm", "1/min", "the speed less frequency_cpm", |row| {
            Some(row.response()?.speed_rpm - row.frequency_cpm()?)
        }),
        (
            "exponent_per_s",
            "1/s",
            "largest Lyapunov exponent: of a periodic motion by its Floquet multipliers, below 0; \
             null where the spectrum shows two frequencies",
            |row| Some(row.motion()?.exponent?.rate_per_s),
        ),
        ("exponent_error_per_s", "1/s", "its standard error", |row| {
            Some(row.motion()?.exponent?.error_per_s)
        }),
        (
            "min_gap_m",
            "m",
            "least gap between drum and tub over the motion's last turns; negative where they \
             clash",
            |row| Some(row.motion_in_range()?.min_gap_m),
        ),
        (
            "threshold_rad_per_s",
            "rad/s",
            "smallest kick that does not come back to motion 0, of those tried; null where all do \
             or --threshold was not given",
            |row| row.attractors()?.threshold_rad_per_s,
        ),
    ];
    for (name, unit, description, value) in measured_columns {
        columns.push(ResultColumn::measured(name, unit, description, value));
    }
    let description = "of a motion that did not settle: whether its largest deviations are \
                within a factor of two of the periodic response's, which it then comes to or \
                leaves slowly";
    columns.push(ResultColumn::flag("near_response", description, DwellRow::is_near_response));
    let description = "mean life of a transient; null of other motions";
    columns.push(ResultColumn::measured("life_s", "s", description, DwellRow::transient_life_s));
    let description = "how long its first trajectory was followed";
    columns.push(ResultColumn::measured("followed_s", "s", description, |row: &DwellRow| {
        Some(row.motion()?.time_s)
    }));
    let description = "ok; left_range: it went farther than the model is good for, after \
                followed_s; not_settled: the largest deviations still change; transient: it \
                wanders as chaos does, but ends elsewhere after life_s; or why there is no motion";
    columns.push(ResultColumn::name(
        "status",
        description,
        STATUS_NAMES.to_vec(),
        |row: &DwellRow| STATUS_NAMES.iter().position(|status| *status == row.status_name()),
    ));
    if with_sections {
        columns.extend(section_columns());
    }
    columns
}

/// Returns the columns of the state that the search carries to the next speed. Chunks contain them,
/// so that an interrupted run can continue.
pub(super) fn carried_columns() -> impl Iterator<Item = DwellColumn> {
    let state_bits_of =
        |i: usize| move |row: &DwellRow| Some(carried_final_state(row.attractors()?)?[i].to_bits());
    (0..STATE_LEN).map(move |i| {
        ResultColumn::new(format!("carried_{i}"), "", "", CellType::Kept, state_bits_of(i))
    })
}

/// Returns the state of a known row that the search carries to the next speed.
pub(super) fn read_carried_state(known: &PointRows) -> CarriedState {
    let cells = known.rows.first()?.last_chunk::<STATE_LEN>()?;
    let state: Option<Vec<f64>> = cells.iter().map(|cell| cell.map(f64::from_bits)).collect();
    state?.try_into().ok()
}

/// Returns the columns of states at successive turns.
fn section_columns() -> Vec<DwellColumn> {
    let description = "number of the turn among those kept, from 0: what follows is where it ends";
    let mut columns = vec![count_column("turn", description, |row| {
        row.attractors().map(|_| row.turn_index as u64)
    })];
    for i in 0..STATE_LEN {
        let coordinate_index = i % COORDINATES;
        let unit = if coordinate_index < 4 { "m" } else { "rad" };
        let (name, unit, description) = match i < COORDINATES {
            true => (
                format!("q{}_{unit}", coordinate_index + 1),
                unit.to_owned(),
                "coordinate from equilibrium",
            ),
            false => (
                format!("u{}_{unit}_per_s", coordinate_index + 1),
                format!("{unit}/s"),
                "its speed",
            ),
        };
        let value_of = move |row: &DwellRow| Some(row.motion()?.sections.get(row.turn_index)?[i]);
        let description = format!("{description}, where the unbalance is up");
        columns.push(ResultColumn::measured(name, &unit, description, value_of));
    }
    columns
}
