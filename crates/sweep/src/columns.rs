//! The columns of results, and rows of outcomes: the one place that says what a file holds.

use std::mem::take;

use sweep_engine::columns::{
    Compared, ResultColumn, amplitude_columns, declared, row, run_columns, verdict_columns,
};
use sweep_engine::store::read::FAR_OFF;
use sweep_engine::store::{Column, Done, Holds};
use sweep_parameter::{Limit, RatioLimits, Worse};
use washer_model::{Beyond, Channel, Disturbance, Ending, Kind, ModeMotion};
use washer_row::{
    DwellPeaks, GrowingMode, Growth, Level, Measures, Metric, MetricFacts, Outcome, ROW_STATUSES,
    Trajectory, Verdict, row_status,
};

use crate::model::described;
use crate::plan::{Plan, compared_channels, has_friction};

/// What a row's cells are taken from.
struct ResultRow {
    outcome: Outcome,
    compared: Compared,
}

impl AsRef<Compared> for ResultRow {
    fn as_ref(&self) -> &Compared {
        &self.compared
    }
}

type WasherColumn = ResultColumn<ResultRow>;

/// The columns of a plan's rows.
pub(crate) struct Columns {
    columns: Vec<WasherColumn>,
    channels: usize,
    limits: RatioLimits,
}

impl Columns {
    /// Those of a run.
    pub(crate) fn of_run(plan: &Plan) -> Self {
        let channels = compared_channels(plan);
        let limits = plan.reliability.limits;
        Self::of_measures(&channels, limits, &plan.model.measures, has_friction(plan))
    }

    /// The same, by what they depend on.
    pub(crate) fn of_measures(
        channels: &[Channel],
        limits: RatioLimits,
        measures: &Measures,
        has_friction: bool,
    ) -> Self {
        let criterion = measures.criterion;
        let (amplitude, ratio) = (criterion.amplitude(), criterion.ratio());
        let mut columns = amplitude_columns(&all_described(channels), limits, amplitude, ratio);
        columns.extend(verdict(channels, limits));
        columns.extend(gap_columns());
        columns.extend(has_friction.then(friction_column));
        columns.extend(metric_columns(channels, measures));
        columns.extend(run_columns(ROW_STATUSES.to_vec()));
        Self { columns, channels: channels.len(), limits }
    }

    /// Those of dwells at constant speeds.
    pub(crate) fn of_dwells(plan: &Plan) -> Self {
        let channels = &compared_channels(plan);
        let limits = plan.reliability.limits;
        let mut columns = growth_columns("");
        let amplitude = "largest deviation from equilibrium over a turn";
        let ratio = "nonlinear over linear amplitude; null where that is zero";
        columns.extend(amplitude_columns(&all_described(channels), limits, amplitude, ratio));
        columns.extend(verdict(channels, limits).into_iter().take(2));
        let (text, statuses) = ("ok, or why there is no response", ROW_STATUSES.to_vec());
        let status = |row: &ResultRow| Some(row.compared.status);
        columns.push(ResultColumn::name("status", text, statuses, status));
        Self { columns, channels: channels.len(), limits }
    }

    /// What the file says of them.
    pub(crate) fn declared(self) -> Vec<Column> {
        declared(self.columns)
    }

    /// The rows of what came of a point.
    pub(crate) fn done(&self, outcome: Outcome) -> Done {
        let point = outcome.point;
        let rows = outcome.into_rows().map(|outcome| row(&self.columns, &self.result(outcome)));
        Done { point, rows: rows.collect() }
    }

    fn result(&self, mut outcome: Outcome) -> ResultRow {
        let Verdict { ratios, greatest, least, reliable } =
            Verdict::new(&outcome, self.channels, self.limits);
        let (status, fail_time_s) = row_status(&outcome);
        let models = [&mut outcome.nonlinear, &mut outcome.linear];
        let compared = Compared {
            steps: models.each_ref().map(|model| model.steps),
            rejected: models.each_ref().map(|model| model.rejected),
            amplitudes: models.map(|model| take(&mut model.amplitudes)),
            ratios,
            greatest,
            least,
            reliable,
            converged: outcome.converged,
            sensitive: outcome.sensitive,
            method: outcome.method as usize,
            error: outcome.error,
            status,
            fail_time_s,
        };
        ResultRow { outcome, compared }
    }
}

/// The two models by name.
const MODELS: [(&str, fn(&Outcome) -> &Trajectory); 2] =
    [("nonlinear", |outcome| &outcome.nonlinear), ("linear", |outcome| &outcome.linear)];

/// Returns what the engine knows of channels.
fn all_described(channels: &[Channel]) -> Vec<sweep_parameter::Channel> {
    channels.iter().map(|channel| described(*channel)).collect()
}

fn verdict(channels: &[Channel], limits: RatioLimits) -> Vec<WasherColumn> {
    let told = "the method of the row's nonlinear numbers; with the fast method its level: \
                capped_0 to capped_5, rk4, additive or dop853";
    verdict_columns(&all_described(channels), limits, Level::ALL.map(Level::name).to_vec(), told)
}

/// Columns of the metrics that are asked for, and no others.
fn metric_columns(channels: &[Channel], measures: &Measures) -> Vec<WasherColumn> {
    let mut columns = Vec::new();
    let mut position = 0;
    for &metric in &measures.metrics {
        match metric {
            Metric::Growth => columns.extend(growth_columns("growth_")),
            Metric::Dwell => columns.extend(dwelt_columns(channels)),
            Metric::StaticSag => {
                let of = |row: &ResultRow| row.outcome.static_sag_m;
                let text = metric.facts().description;
                columns.push(of_metric(metric, metric.column(""), text, of));
            }
            _ => {
                for number in measures.metric_columns(metric) {
                    for (model, of) in MODELS {
                        let text = number.description();
                        let text = format!("{text}, {model} model; null if it failed");
                        let of =
                            move |row: &ResultRow| of(&row.outcome).metrics.get(position).copied();
                        columns.push(of_metric(metric, number.column(model), text, of));
                    }
                    position += 1;
                }
            }
        }
    }
    columns
}

/// A column of a metric, with which way it is bad.
fn of_metric(
    metric: Metric,
    name: String,
    text: impl Into<String>,
    of: impl Fn(&ResultRow) -> Option<f64> + Send + Sync + 'static,
) -> WasherColumn {
    judged(metric, ResultColumn::measured(name, metric.facts().unit, text, of))
}

/// The column, with which way the metric is bad.
fn judged(metric: Metric, column: WasherColumn) -> WasherColumn {
    let MetricFacts { worse, limit, .. } = metric.facts();
    let column = column.worse(worse);
    match limit {
        Some(Limit { value, scale }) => column.limit(value, scale),
        None => column,
    }
}

/// Columns of how far motions at the plan's constant speeds go.
fn dwelt_columns(channels: &[Channel]) -> Vec<WasherColumn> {
    let dwelt = |row: &ResultRow| -> Option<DwellPeaks> { row.outcome.dwelt };
    let mut columns = Vec::new();
    for &channel in channels {
        let text = format!("{}: {}", channel.description(), Metric::Dwell.facts().description);
        let name = format!("dwell_{}", channel.name());
        let of = move |row: &ResultRow| Some(dwelt(row)?.deviations[channel.index()]);
        let column = ResultColumn::measured(name, channel.unit(), text, of);
        columns.push(judged(Metric::Dwell, column));
    }
    let text = "the speed at which yaw or pitch of the tub, whichever is larger, goes farthest";
    let speed = move |row: &ResultRow| Some(dwelt(row)?.speed_rpm);
    columns.push(ResultColumn::measured("dwell_speed_rpm", "rpm", text, speed));
    let text = "what that motion is, as in a file of `sweep dwell`, or that it left the model's \
                range or did not settle";
    let kind = move |row: &ResultRow| Some(dwelt(row)?.kind);
    columns.push(ResultColumn::name("dwell_kind", text, Ending::KINDS.to_vec(), kind));
    columns
}

/// What the linear model's friction was taken at.
fn friction_column() -> WasherColumn {
    let text = "by what factor the speed amplitude at which the linear model takes the friction of \
                a damper is off from those of the motions in the window, the greatest of all \
                dampers: of both models where it is given, of the linear model where it is \
                \"auto\", 1 where that found it; null without friction or if the models failed";
    let off = |row: &ResultRow| {
        let models = [&row.outcome.nonlinear, &row.outcome.linear];
        models.iter().filter_map(|model| model.friction_speed_off).reduce(f64::max)
    };
    let column = ResultColumn::measured("friction_speed_off", "1", text, off);
    column.worse(Worse::Greater).limit(FAR_OFF, 1.0)
}

fn growth(row: &ResultRow) -> Option<&Growth> {
    row.outcome.growth.as_ref()
}

/// Columns of the fastest growing disturbance at a constant speed. In maps they stand behind a
/// prefix, and the speed is one of them.
fn growth_columns(prefix: &str) -> Vec<WasherColumn> {
    let in_map = !prefix.is_empty();
    let mut columns = Vec::new();
    let numbers: [(&str, &str, &str, fn(&Disturbance) -> f64); 6] = [
        ("speed_rpm", "rpm", "the plan's speed at which a disturbance grows fastest", |fastest| {
            fastest.speed_rpm
        }),
        (
            "growth_per_s",
            "1/s",
            "how fast the fastest growing disturbance of the nonlinear response grows; negative \
             where all decay",
            Disturbance::growth_per_s,
        ),
        (
            "frequency_cpm",
            "1/min",
            "its frequency in cycles per minute, known up to whole multiples of the speed and \
             sign: the one from 0 to half the speed",
            Disturbance::frequency_cpm,
        ),
        (
            "other_frequency_cpm",
            "1/min",
            "the speed less frequency_cpm",
            Disturbance::other_frequency_cpm,
        ),
        (
            "multiplier_re",
            "1",
            "the suspension's largest Floquet multiplier, real part",
            |fastest| fastest.multiplier[0],
        ),
        ("multiplier_im", "1", "its imaginary part, not negative", |fastest| fastest.multiplier[1]),
    ];
    let of_dwell = usize::from(!in_map);
    for (name, unit, text, of) in numbers.into_iter().skip(of_dwell) {
        let of = move |row: &ResultRow| Some(of(&growth(row)?.fastest));
        let name =
            if name.starts_with(prefix) { name.to_owned() } else { format!("{prefix}{name}") };
        let column = ResultColumn::measured(name, unit, text, of);
        let is_growth = unit == Metric::Growth.facts().unit;
        columns.push(if is_growth { judged(Metric::Growth, column) } else { column });
    }
    let kind = |row: &ResultRow| Some(growth(row)?.fastest.kind());
    let place = move |row: &ResultRow| Some(kind(row)? as usize);
    let text =
        "what a disturbance turns the response into: stable, period_doubling, quasi_periodic, fold";
    let names = Kind::ALL.map(Kind::name).to_vec();
    columns.push(ResultColumn::name(format!("{prefix}kind"), text, names, place));
    if !in_map {
        let stable = move |row: &ResultRow| Some(kind(row)? == Kind::Stable);
        let text = "true where every disturbance decays";
        columns.push(ResultColumn::flag("stable", text, stable));
    }
    for place in 0..2 {
        columns.extend(growing_mode_columns(prefix, place));
    }
    columns.extend(branch_columns(prefix));
    let on_curve = |row: &ResultRow| Some(growth(row)?.is_on_curve);
    let text = if in_map {
        "false where at any of the plan's speeds no response on that curve was found: a machine \
         that runs up may be in another motion there"
    } else {
        "false where the response is not on that curve, but was found from the linear model's \
         response; branch then counts on, and where it is the first of its speed, a machine that \
         runs up may be in another motion"
    };
    columns.push(ResultColumn::flag(format!("{prefix}on_curve"), text, on_curve));
    columns
}

/// Columns of the branch that a response is on.
fn branch_columns(prefix: &str) -> [WasherColumn; 4] {
    let number = |row: &ResultRow| Some(u64::from(growth(row)?.branch));
    // It says which of a speed's rows a row is, and so is never null there.
    let is_of_speed = prefix.is_empty();
    let kind = if is_of_speed { Holds::Count } else { Holds::KnownCount };
    let branch = move |row: &ResultRow| number(row).or(is_of_speed.then_some(0));
    let folds = "how many folds the point's curve of responses has before this one, followed from \
                 a low speed up; of those on the curve, a machine that runs up is on the least \
                 branch that there is at a speed";
    let end = |name: &str, side: &str, place: usize| {
        let text =
            format!("speed of the fold {side} which the branch is not; null where it has none");
        let of = move |row: &ResultRow| growth(row)?.between_rpm[place];
        ResultColumn::measured(format!("{prefix}branch_{name}_rpm"), "rpm", text, of)
    };
    let passed = "what of the machine's geometry the response passes, and so is no motion of the \
                  machine: spring_hooks, damper_ends, clearance; null where nothing";
    let beyond = |row: &ResultRow| Some(growth(row)?.beyond? as usize);
    let names = Beyond::ALL.map(Beyond::name).to_vec();
    [
        ResultColumn::new(format!("{prefix}branch"), "1", folds, kind, branch),
        end("from", "below", 0),
        end("to", "above", 1),
        ResultColumn::name(format!("{prefix}beyond"), passed, names, beyond),
    ]
}

/// Columns of one of the modes that take part in what grows.
fn growing_mode_columns(prefix: &str, place: usize) -> [WasherColumn; 3] {
    let mode = move |row: &ResultRow| -> Option<GrowingMode> { growth(row)?.modes[place] };
    let which = if place == 0 { "that takes most part in" } else { "next to that in" };
    let name = format!("{prefix}mode_{}", place + 1);
    let text = format!(
        "number, by frequency at this speed, of the linear model's mode {which} what grows; null \
         where nothing grows, or no such mode is needed"
    );
    let number = move |row: &ResultRow| Some(u64::from(mode(row)?.number));
    let moves = "what moves in it";
    let names = ModeMotion::NAMES.to_vec();
    let frequency = "its damped natural frequency at this speed in cycles per minute";
    [
        ResultColumn::new(name.clone(), "1", text, Holds::KnownCount, number),
        ResultColumn::name(format!("{name}_name"), moves, names, move |row| {
            Some(mode(row)?.name as usize)
        }),
        ResultColumn::measured(format!("{name}_cpm"), "1/min", frequency, move |row| {
            Some(mode(row)?.frequency_cpm)
        }),
    ]
}

/// A gap that is by so much smaller is as much worse as a ratio that is greater by a factor of e.
const GAP_SCALE_M: f64 = 0.010;

/// Columns of the least gaps, the same for every plan.
fn gap_columns() -> [WasherColumn; 2] {
    MODELS.map(|(model, of)| {
        let text = format!(
            "least gap between drum and tub over the whole run, {model} model; negative where \
             they clash; null if it failed"
        );
        let gap = move |row: &ResultRow| of(&row.outcome).min_gap_m;
        let column = ResultColumn::measured(format!("min_gap_{model}_m"), "m", text, gap);
        column.worse(Worse::Less).limit(0.0, GAP_SCALE_M)
    })
}

#[cfg(test)]
mod tests;
