//! The columns of results, and rows of outcomes: the one place that says what a file holds.

use serde_json::{Value, json};
use sweep_engine::columns::{
    Cell, Compared, ResultColumn, amplitude_columns, row, run_columns, verdict_columns,
};
use sweep_engine::store::read::FAR_OFF;
use sweep_engine::store::{Column, Done, Job, Kind as Cells, Layout, Row, Rows, axis_columns};
use sweep_files::{FileKind, key};
use sweep_parameter::{Limit, RatioLimits, Worse};
use washer_model::{Beyond, Channel, Disturbance, Ending, Kind, Motion};
use washer_row::{Level, Measures, Metric, Outcome, ROW_STATUSES, Trajectory, Verdict, row_status};

use crate::model::Washer;
use crate::plan::{Plan, has_friction};

impl Rows for Washer {
    fn layout(plan: &Plan) -> Layout {
        of_run(plan)
    }
}

/// What a row is about.
#[derive(Clone, Debug, PartialEq)]
enum RowKind {
    /// A point over the run's time: `sweep run`.
    Run,
    /// A point at one of these speeds (rpm), speeds varying fastest: `sweep stability`.
    Dwell(Vec<f64>),
}

/// What a row's cells are taken from.
struct ResultRow {
    outcome: Outcome,
    verdict: Verdict,
    /// Position in [`ROW_STATUSES`].
    status: usize,
    fail_time_s: Option<f64>,
}

/// The columns of a plan's rows.
pub(crate) struct Columns {
    columns: Vec<WasherColumn>,
    channels: usize,
    limits: RatioLimits,
}

impl Columns {
    /// Those of a run.
    pub(crate) fn of_run(plan: &Plan) -> Self {
        Self::of(&Asked::of(plan, RowKind::Run))
    }

    /// Those of dwells at constant speeds.
    pub(crate) fn of_dwells(plan: &Plan, speeds_rpm: &[f64]) -> Self {
        Self::of(&Asked::of(plan, RowKind::Dwell(speeds_rpm.to_vec())))
    }

    fn of(asked: &Asked) -> Self {
        Self { columns: asked.columns(), channels: asked.channels.len(), limits: asked.limits }
    }

    /// The rows of what came of a point.
    pub(crate) fn done(&self, outcome: Outcome) -> Done {
        let point = outcome.point;
        Done { point, rows: outcome.into_rows().map(|outcome| self.row(outcome)).collect() }
    }

    fn row(&self, outcome: Outcome) -> Row {
        row(&self.columns, &self.result(outcome))
    }

    /// The number of one column of what came of a point.
    pub(crate) fn number(&self, column: &str, outcome: &Outcome) -> Option<f64> {
        let column = self.columns.iter().find(|known| known.declared.name == column)?;
        column.number(&self.result(outcome.clone()))
    }

    fn result(&self, outcome: Outcome) -> ResultRow {
        let verdict = Verdict::new(&outcome, self.channels, self.limits);
        let (status, fail_time_s) = row_status(&outcome);
        ResultRow { outcome, verdict, status, fail_time_s }
    }
}

type WasherColumn = ResultColumn<ResultRow>;

impl ResultRow {
    fn model(&self, model: usize) -> &Trajectory {
        if model == 0 { &self.outcome.nonlinear } else { &self.outcome.linear }
    }
}

impl Compared for ResultRow {
    fn amplitude(&self, model: usize, channel: usize) -> Option<f64> {
        self.model(model).amplitudes.get(channel).copied()
    }

    fn ratio(&self, channel: usize) -> Option<f64> {
        self.verdict.ratios.get(channel).copied().flatten()
    }

    fn greatest(&self) -> Option<(usize, f64)> {
        self.verdict.greatest
    }

    fn least(&self) -> Option<(usize, f64)> {
        self.verdict.least
    }

    fn reliable(&self) -> Option<bool> {
        self.verdict.reliable
    }

    fn converged(&self) -> Option<bool> {
        self.outcome.converged
    }

    fn sensitive(&self) -> Option<bool> {
        self.outcome.sensitive
    }

    fn method(&self) -> usize {
        self.outcome.method as usize
    }

    fn error(&self) -> Option<f64> {
        self.outcome.error
    }

    fn status(&self) -> usize {
        self.status
    }

    fn fail_time_s(&self) -> Option<f64> {
        self.fail_time_s
    }

    fn steps(&self, model: usize) -> u64 {
        self.model(model).steps
    }

    fn rejected(&self, model: usize) -> u64 {
        self.model(model).rejected
    }
}

/// The layout of a run's result.
pub(crate) fn of_run(plan: &Plan) -> Layout {
    let reliability = &plan.reliability;
    let measures = plan.model.measures.clone();
    let rubs = has_friction(plan);
    of_measures(axis_columns(plan), &reliability.channels, reliability.limits, measures, rubs)
}

/// The same, by what it depends on.
pub(crate) fn of_measures(
    axes: Vec<Column>,
    channels: &[Channel],
    limits: RatioLimits,
    measures: Measures,
    has_friction: bool,
) -> Layout {
    let (channels, rows) = (channels.to_vec(), RowKind::Run);
    let asked = Asked { channels, limits, measures, has_friction, rows };
    let columns = Columns::of(&asked).columns;
    Layout {
        axes,
        columns: columns.into_iter().map(|column| column.declared).collect(),
        kind: FileKind::Map,
        rows_a_point: 1,
        has_several: false,
        metadata: Vec::new(),
    }
}

/// The layout of the dwells of a plan's points at these speeds (rpm), speeds varying fastest.
pub(crate) fn of_dwells(plan: &Plan, speeds_rpm: &[f64]) -> Layout {
    let columns = Columns::of_dwells(plan, speeds_rpm).columns;
    let mut axes = axis_columns(plan);
    axes.push(Column::new("speed_rpm", "rpm", "constant spin of the shaft", Cells::Axis));
    Layout {
        axes,
        columns: columns.into_iter().map(|column| column.declared).collect(),
        kind: FileKind::Stability,
        rows_a_point: speeds_rpm.len() as u64,
        has_several: true,
        metadata: vec![(key::STABILITY, json!({ "speeds_rpm": speeds_rpm }))],
    }
}

/// Rows of this layout for each point and speed; the plan says what was asked under a name.
pub(crate) fn at_speeds<'a>(
    plan: &'a Plan,
    speeds_rpm: &[f64],
    layout: Layout,
    (name, asked): (&str, Value),
) -> Job<'a> {
    let of_run = Job::of(plan);
    let mut json = of_run.plan;
    json[name] = asked;
    let speeds_rpm = speeds_rpm.to_vec();
    let speeds = speeds_rpm.len() as u64;
    Job {
        plan: json,
        points: plan.points() * speeds,
        layout,
        axis_values: Box::new(move |row| {
            let mut values = plan.axis_values(row / speeds);
            values.push(speeds_rpm[(row % speeds) as usize]);
            values
        }),
        ..of_run
    }
}

/// What the columns depend on.
struct Asked {
    channels: Vec<Channel>,
    limits: RatioLimits,
    measures: Measures,
    has_friction: bool,
    rows: RowKind,
}

/// The two models by name.
const MODELS: [(&str, fn(&Outcome) -> &Trajectory); 2] =
    [("nonlinear", |outcome| &outcome.nonlinear), ("linear", |outcome| &outcome.linear)];

impl Asked {
    fn of(plan: &Plan, rows: RowKind) -> Self {
        let measures = match rows {
            RowKind::Run => plan.model.measures.clone(),
            // What is measured of a run is not of a dwell.
            RowKind::Dwell(_) => Measures::default(),
        };
        let channels = plan.reliability.channels.clone();
        let (limits, has_friction) = (plan.reliability.limits, has_friction(plan));
        Self { channels, limits, measures, has_friction, rows }
    }

    /// Every column, in order: the one place that says what the file holds.
    fn columns(&self) -> Vec<WasherColumn> {
        let mut columns = Vec::new();
        if let RowKind::Dwell(_) = self.rows {
            columns.extend(growth_columns(""));
            let amplitude = "largest deviation from equilibrium over a turn";
            let ratio = "nonlinear over linear amplitude; null where that is zero";
            columns.extend(amplitude_columns(&self.channels, self.limits, amplitude, ratio));
            columns.extend(self.verdict_columns().into_iter().take(2));
            columns.push(dwell_status_column());
            return columns;
        }
        let criterion = self.measures.criterion;
        let (amplitude, ratio) = (criterion.amplitude(), criterion.ratio());
        columns.extend(amplitude_columns(&self.channels, self.limits, amplitude, ratio));
        columns.extend(self.verdict_columns());
        columns.extend(gap_columns());
        if self.has_friction {
            columns.push(friction_column());
        }
        columns.extend(self.metric_columns());
        columns.extend(run_columns(ROW_STATUSES.to_vec()));
        columns
    }

    fn verdict_columns(&self) -> Vec<WasherColumn> {
        let told = "what the row's numbers come from: fast, fine and finest are rungs of the fast \
                    method, the others methods of that name";
        verdict_columns(&self.channels, self.limits, Level::ALL.map(Level::name).to_vec(), told)
    }

    /// Columns of the metrics that are asked for, and no others.
    fn metric_columns(&self) -> Vec<WasherColumn> {
        let mut columns = Vec::new();
        let mut position = 0;
        for metric in &self.measures.metrics {
            if let Metric::Growth = metric {
                columns.extend(growth_columns("growth_"));
                continue;
            }
            if let Metric::Dwell = metric {
                columns.extend(dwelt_columns(&self.channels));
                continue;
            }
            if !metric.is_of_model() {
                let cell = Cell::Measured(Box::new(|row: &ResultRow| row.outcome.static_sag_m));
                let (name, text) = (metric.column(""), metric.description());
                columns
                    .push(of_metric(*metric, ResultColumn::new(name, metric.unit(), text, cell)));
                continue;
            }
            for number in self.measures.numbers_of(*metric) {
                for (model, of) in MODELS {
                    let text =
                        format!("{}, {model} model; null if it failed", number.description());
                    let cell = Cell::Measured(Box::new(move |row: &ResultRow| {
                        of(&row.outcome).metrics.get(position).copied()
                    }));
                    let name = number.column(model);
                    let column = ResultColumn::new(name, metric.unit(), text, cell);
                    columns.push(of_metric(*metric, column));
                }
                position += 1;
            }
        }
        columns
    }
}

/// A column of a metric, with which way it is bad.
fn of_metric(metric: Metric, column: WasherColumn) -> WasherColumn {
    let column = column.worse(metric.worse());
    match metric.limit() {
        Some(Limit { value, scale }) => column.limit(value, scale),
        None => column,
    }
}

/// Columns of how far motions at the plan's constant speeds go.
fn dwelt_columns(channels: &[Channel]) -> Vec<WasherColumn> {
    let mut columns: Vec<WasherColumn> = Vec::new();
    for &channel in channels {
        let cell = Cell::Measured(Box::new(move |row: &ResultRow| {
            Some(row.outcome.dwelt?.deviations[channel.index()])
        }));
        let text = format!("{}: {}", channel.description(), Metric::Dwell.description());
        let name = format!("dwell_{}", channel.name());
        let column = ResultColumn::new(name, channel.unit(), text, cell);
        columns.push(of_metric(Metric::Dwell, column));
    }
    columns.push(ResultColumn::new(
        "dwell_speed_rpm",
        "rpm",
        "the speed at which yaw or pitch of the tub, whichever is larger, goes farthest",
        Cell::Measured(Box::new(|row: &ResultRow| Some(row.outcome.dwelt?.speed_rpm))),
    ));
    columns.push(ResultColumn::new(
        "dwell_kind",
        "",
        "what that motion is, as in a file of `sweep dwell`, or that it left the model's range or \
         did not settle",
        Cell::Name(Ending::KINDS.to_vec(), Box::new(|row| Some(row.outcome.dwelt.as_ref()?.kind))),
    ));
    columns
}

/// What the linear model's friction was taken at.
fn friction_column() -> WasherColumn {
    ResultColumn::new(
        "friction_speed_off",
        "1",
        "by what factor the speed amplitude at which the linear model takes the friction of a \
         damper is off from that of its own motion in the window, the greatest of all dampers; 1 \
         where \"auto\" found it, null without friction or if the linear model failed",
        Cell::Measured(Box::new(|row: &ResultRow| row.outcome.linear.friction_speed_off)),
    )
    .worse(Worse::Greater)
    .limit(FAR_OFF, 1.0)
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
        let cell = Cell::Measured(Box::new(move |row: &ResultRow| {
            Some(of(&row.outcome.growth.as_ref()?.fastest))
        }));
        let name =
            if name.starts_with(prefix) { name.to_owned() } else { format!("{prefix}{name}") };
        let column = ResultColumn::new(name, unit, text, cell);
        let is_growth = unit == Metric::Growth.unit();
        columns.push(if is_growth { of_metric(Metric::Growth, column) } else { column });
    }
    let kind = |row: &ResultRow| {
        let kind = row.outcome.growth.as_ref()?.fastest.kind();
        Kind::ALL.iter().position(|known| *known == kind)
    };
    columns.push(ResultColumn::new(
        format!("{prefix}kind"),
        "",
        "what a disturbance turns the response into: stable, period_doubling, quasi_periodic, fold",
        Cell::Name(Kind::ALL.map(Kind::name).to_vec(), Box::new(kind)),
    ));
    if !in_map {
        let stable =
            |row: &ResultRow| Some(row.outcome.growth.as_ref()?.fastest.kind() == Kind::Stable);
        let text = "true where every disturbance decays";
        columns.push(ResultColumn::new("stable", "", text, Cell::Flag(Box::new(stable))));
    }
    for place in 0..2 {
        columns.extend(growing_mode_columns(prefix, place));
    }
    columns.extend(branch_columns(prefix));
    columns
}

/// Columns of the branch that a response is on.
fn branch_columns(prefix: &str) -> [WasherColumn; 4] {
    let end = |place: usize| move |row: &ResultRow| row.outcome.growth.as_ref()?.between_rpm[place];
    let number = |row: &ResultRow| Some(u64::from(row.outcome.growth.as_ref()?.branch));
    // It says which of a speed's rows a row is, and so is never null there.
    let branch = if prefix.is_empty() {
        Cell::Count(Box::new(move |row: &ResultRow| number(row).unwrap_or(0)))
    } else {
        Cell::KnownCount(Box::new(number))
    };
    let beyond = |row: &ResultRow| {
        let beyond = row.outcome.growth.as_ref()?.beyond?;
        Beyond::ALL.iter().position(|known| *known == beyond)
    };
    [
        ResultColumn::new(
            format!("{prefix}branch"),
            "1",
            "how many folds the point's curve of responses has before this one, followed from a \
             low speed up; a machine that runs up is on the least branch that there is at a speed",
            branch,
        ),
        ResultColumn::new(
            format!("{prefix}branch_from_rpm"),
            "rpm",
            "speed of the fold below which the branch is not; null where it has none",
            Cell::Measured(Box::new(end(0))),
        ),
        ResultColumn::new(
            format!("{prefix}branch_to_rpm"),
            "rpm",
            "speed of the fold above which the branch is not; null where it has none",
            Cell::Measured(Box::new(end(1))),
        ),
        ResultColumn::new(
            format!("{prefix}beyond"),
            "",
            "what of the machine's geometry the response passes, and so is no motion of the \
             machine: spring_hooks, damper_ends, clearance; null where nothing",
            Cell::Name(Beyond::ALL.map(Beyond::name).to_vec(), Box::new(beyond)),
        ),
    ]
}

/// Columns of one of the modes that take part in what grows.
fn growing_mode_columns(prefix: &str, place: usize) -> [WasherColumn; 3] {
    let mode = move |row: &ResultRow| row.outcome.growth.as_ref()?.modes[place];
    let which = if place == 0 { "that takes most part in" } else { "next to that in" };
    let name = format!("{prefix}mode_{}", place + 1);
    [
        ResultColumn::new(
            name.clone(),
            "1",
            format!(
                "number, by frequency at this speed, of the linear model's mode {which} what \
                 grows; null where nothing grows, or no such mode is needed"
            ),
            Cell::KnownCount(Box::new(move |row: &ResultRow| Some(u64::from(mode(row)?.number)))),
        ),
        ResultColumn::new(
            format!("{name}_name"),
            "",
            "what moves in it",
            Cell::Name(
                Motion::NAMES.to_vec(),
                Box::new(move |row: &ResultRow| Some(mode(row)?.name as usize)),
            ),
        ),
        ResultColumn::new(
            format!("{name}_cpm"),
            "1/min",
            "its damped natural frequency at this speed in cycles per minute",
            Cell::Measured(Box::new(move |row: &ResultRow| Some(mode(row)?.frequency_cpm))),
        ),
    ]
}

/// The status of a dwell.
fn dwell_status_column() -> WasherColumn {
    ResultColumn::new(
        "status",
        "",
        "ok, or why there is no response",
        Cell::Name(ROW_STATUSES.to_vec(), Box::new(|row: &ResultRow| Some(row.status))),
    )
}

/// A gap that is by so much smaller is as much worse as a ratio that is greater by a factor of e.
const GAP_SCALE_M: f64 = 0.010;

/// Columns of the least gaps, the same for every plan.
fn gap_columns() -> Vec<WasherColumn> {
    let mut columns = Vec::new();
    for (model, of) in MODELS {
        let text = format!(
            "least gap between drum and tub over the whole run, {model} model; negative where \
             they clash; null if \
             it failed"
        );
        let cell = Cell::Measured(Box::new(move |row: &ResultRow| of(&row.outcome).min_gap_m));
        let column = ResultColumn::new(format!("min_gap_{model}_m"), "m", text, cell);
        columns.push(column.worse(Worse::Less).limit(0.0, GAP_SCALE_M));
    }
    columns
}

#[cfg(test)]
mod tests;
