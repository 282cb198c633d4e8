//! The columns of results, and the rows of outcomes.

use std::iter::once;

use sweep_engine::RowSink;
use sweep_engine::columns::{
    ComparisonColumns, ResultColumn, RowComparison, into_declarations, pass_rows,
};
use sweep_engine::store::{CellType, DeclaredColumn};
use sweep_parameter::{Limit, RatioLimits, Worse};
use washer_model::{Attractor, Channel, Disturbance, GeometryLimit, ModeMotion, StabilityKind};
use washer_row::{
    DwellPeaks, GrowingMode, Growth, Measures, MethodKind, Metric, MetricProperties, Outcome,
    ROW_STATUSES, Trajectory,
};

use crate::model::engine_channel;
use crate::plan::{Plan, compared_channels, has_friction};

type WasherColumn = ResultColumn<Outcome>;

/// The columns of a plan's rows.
pub(crate) struct Columns {
    columns: Vec<WasherColumn>,
}

impl Columns {
    /// Returns the columns of a plan's run.
    pub(crate) fn for_run(plan: &Plan) -> Self {
        let channels = compared_channels(plan);
        let limits = plan.reliability.limits;
        Self::for_measures(&channels, limits, &plan.model.measures, has_friction(plan))
    }

    /// Returns the columns of a run with these channels, limits and measures.
    pub(crate) fn for_measures(
        channels: &[Channel],
        limits: RatioLimits,
        measures: &Measures,
        has_friction: bool,
    ) -> Self {
        let criterion = measures.criterion;
        let channel_descriptions = engine_channels(channels);
        let comparison = comparison_columns(&channel_descriptions, limits);
        let mut columns = comparison
            .amplitude_columns(criterion.amplitude_description(), criterion.ratio_description());
        columns.extend(verdict_columns(&comparison));
        columns.extend(gap_columns());
        columns.extend(has_friction.then(friction_column));
        columns.extend(metric_columns(channels, measures));
        columns.extend(comparison.run_columns(ROW_STATUSES.to_vec()));
        Self { columns }
    }

    /// Returns the columns of periodic responses at held speeds.
    pub(crate) fn for_responses(plan: &Plan) -> Self {
        let channel_descriptions = engine_channels(&compared_channels(plan));
        let comparison = comparison_columns(&channel_descriptions, plan.reliability.limits);
        let mut columns = growth_columns("");
        let amplitude_description = "largest deviation from equilibrium over a turn";
        let ratio_description = "nonlinear over linear amplitude; null where that is zero";
        columns.extend(comparison.amplitude_columns(amplitude_description, ratio_description));
        // A response has only the verdict's first two columns, those of the greatest ratio.
        columns.extend(verdict_columns(&comparison).into_iter().take(2));
        let status_description = "ok, or why there is no response";
        let status_of = |row: &Outcome| Some(row.status);
        columns.push(ResultColumn::name(
            "status",
            status_description,
            ROW_STATUSES.to_vec(),
            status_of,
        ));
        Self { columns }
    }

    /// Returns the names, units and descriptions of the columns, as a file declares them.
    pub(crate) fn declared(self) -> Vec<DeclaredColumn> {
        into_declarations(self.columns)
    }

    /// Passes the rows of a point's outcome to a sink: its own, then those of coexisting outcomes.
    pub(crate) fn pass(&self, outcome: &Outcome, sink: &RowSink<'_>) {
        let outcomes = once(outcome).chain(&outcome.coexisting);
        pass_rows(&self.columns, outcome.point, outcomes, sink);
    }
}

/// Returns the comparison of both models in an outcome.
fn comparison_of_outcome(outcome: &Outcome) -> RowComparison<'_> {
    let models = [&outcome.nonlinear, &outcome.linear];
    RowComparison {
        amplitudes: models.map(|model| model.amplitudes.as_slice()),
        verdict: &outcome.verdict,
        is_converged: outcome.converged,
        is_sensitive: outcome.sensitive,
        method_index: outcome.method as usize,
        relative_error: outcome.error,
        status_index: outcome.status,
        fail_time_s: outcome.fail_time_s,
        accepted_steps: models.map(|model| model.steps),
        rejected_steps: models.map(|model| model.rejected),
    }
}

/// Returns the columns that compare both models.
fn comparison_columns(
    channels: &[sweep_parameter::Channel],
    limits: RatioLimits,
) -> ComparisonColumns<'_, Outcome> {
    ComparisonColumns { channels, limits, row_comparison: comparison_of_outcome }
}

/// The two models, each with its name and its trajectory in an outcome.
const MODEL_TRAJECTORIES: [(&str, fn(&Outcome) -> &Trajectory); 2] =
    [("nonlinear", |outcome| &outcome.nonlinear), ("linear", |outcome| &outcome.linear)];

/// Returns the engine's descriptions of channels.
fn engine_channels(channels: &[Channel]) -> Vec<sweep_parameter::Channel> {
    channels.iter().map(|channel| engine_channel(*channel)).collect()
}

/// Returns the columns of the verdict, with the levels of this model's methods.
fn verdict_columns(comparison: &ComparisonColumns<'_, Outcome>) -> Vec<WasherColumn> {
    let method_description = "the method of the row's nonlinear numbers; with the fast method its \
    level: capped_0 to capped_5, rk4, additive, dop853_adaptive or dop853";
    comparison.verdict_columns(MethodKind::ALL.map(MethodKind::name).to_vec(), method_description)
}

/// Returns the columns of the metrics that the grid file requests.
fn metric_columns(channels: &[Channel], measures: &Measures) -> Vec<WasherColumn> {
    let mut columns = Vec::new();
    let mut metric_index = 0;
    for &metric in &measures.metrics {
        match metric {
            Metric::Growth => columns.extend(growth_columns("growth_")),
            Metric::Dwell => columns.extend(dwell_columns(channels)),
            Metric::StaticSag => {
                let static_sag_of = |row: &Outcome| row.static_sag_m;
                let description = metric.properties().description;
                columns.push(metric_column(metric, metric.column(""), description, static_sag_of));
            }
            _ => {
                for number in measures.metric_columns(metric) {
                    for (model, trajectory) in MODEL_TRAJECTORIES {
                        let text = number.description();
                        let text = format!("{text}, {model} model; null if it failed");
                        let value =
                            move |row: &Outcome| trajectory(row).metrics.get(metric_index).copied();
                        columns.push(metric_column(metric, number.column(model), text, value));
                    }
                    metric_index += 1;
                }
            }
        }
    }
    columns
}

/// Returns a column of a metric, with its bad direction and its limit.
fn metric_column(
    metric: Metric,
    name: String,
    text: impl Into<String>,
    value: impl Fn(&Outcome) -> Option<f64> + Send + Sync + 'static,
) -> WasherColumn {
    add_direction_and_limit(
        metric,
        ResultColumn::measured(name, metric.properties().unit, text, value),
    )
}

/// Returns a column with the bad direction and the limit of a metric.
fn add_direction_and_limit(metric: Metric, column: WasherColumn) -> WasherColumn {
    let MetricProperties { worse, limit, .. } = metric.properties();
    let column = column.worse(worse);
    match limit {
        Some(Limit { value, scale }) => column.limit(value, scale),
        None => column,
    }
}

/// Returns the columns of the largest deviations of attractors at the plan's held speeds.
fn dwell_columns(channels: &[Channel]) -> Vec<WasherColumn> {
    let peaks_of = |row: &Outcome| -> Option<DwellPeaks> { row.dwell_peaks };
    let mut columns = Vec::new();
    for &channel in channels {
        let description =
            format!("{}: {}", channel.description(), Metric::Dwell.properties().description);
        let name = format!("dwell_{}", channel.name());
        let deviation_of = move |row: &Outcome| Some(peaks_of(row)?.deviations[channel.index()]);
        let column = ResultColumn::measured(name, channel.unit(), description, deviation_of);
        columns.push(add_direction_and_limit(Metric::Dwell, column));
    }
    let text = "the speed at which yaw or pitch of the tub, whichever is larger, goes farthest";
    let speed_of = move |row: &Outcome| Some(peaks_of(row)?.speed_rpm);
    columns.push(ResultColumn::measured("dwell_speed_rpm", "rpm", text, speed_of));
    let text = "what that motion is, as in a file of `sweep dwell`, or that it left the model's \
                range or did not settle";
    let kind_of = move |row: &Outcome| Some(peaks_of(row)?.kind);
    columns.push(ResultColumn::name("dwell_kind", text, Attractor::KIND_NAMES.to_vec(), kind_of));
    columns
}

/// Returns the column of the factor between the speed at which the linear model linearises friction
/// and the speed of the motion.
fn friction_column() -> WasherColumn {
    let description = "by what factor the speed amplitude at which the linear model takes the \
    friction of a damper is off from those of the motions in the window, the greatest of all \
                dampers: of both models where it is given, of the linear model where it is \
                \"auto\", 1 where that found it; null without friction or if the models failed";
    let greatest_factor_of = |row: &Outcome| {
        let models = [&row.nonlinear, &row.linear];
        models.iter().filter_map(|model| model.friction_speed_off).reduce(f64::max)
    };
    let column = ResultColumn::measured("friction_speed_off", "1", description, greatest_factor_of);
    column.worse(Worse::Greater).limit(MAX_FRICTION_SPEED_FACTOR, 1.0).in_summary()
}

/// The factor by which the speed amplitude that the linear model assumes for friction may differ
/// from that of the motion. Basis: with more than twice the speed, the friction is that of another
/// motion. Doubling it reports fewer rows.
const MAX_FRICTION_SPEED_FACTOR: f64 = 2.0;

fn growth_of(row: &Outcome) -> Option<&Growth> {
    row.growth.as_ref()
}

/// Returns the columns of the fastest growing disturbance at a held speed. Maps give them a prefix
/// and a column of the speed, which in files of responses is an axis.
fn growth_columns(prefix: &str) -> Vec<WasherColumn> {
    let is_map = !prefix.is_empty();
    let mut columns = Vec::new();
    let mut number_columns: Vec<(&str, &str, &str, fn(&Disturbance) -> f64)> = Vec::new();
    if is_map {
        let text = "the plan's speed at which a disturbance grows fastest";
        number_columns.push(("speed_rpm", "rpm", text, |fastest| fastest.speed_rpm));
    }
    number_columns.extend::<[(&str, &str, &str, fn(&Disturbance) -> f64); 5]>([
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
            Disturbance::complementary_frequency_cpm,
        ),
        (
            "multiplier_re",
            "1",
            "the suspension's largest Floquet multiplier, real part",
            |fastest| fastest.multiplier[0],
        ),
        ("multiplier_im", "1", "its imaginary part, not negative", |fastest| fastest.multiplier[1]),
    ]);
    for (name, unit, text, number) in number_columns {
        let value_of = move |row: &Outcome| Some(number(&growth_of(row)?.fastest));
        let name =
            if name.starts_with(prefix) { name.to_owned() } else { format!("{prefix}{name}") };
        let column = ResultColumn::measured(name, unit, text, value_of);
        let is_growth_rate = unit == Metric::Growth.properties().unit;
        columns.push(if is_growth_rate {
            add_direction_and_limit(Metric::Growth, column)
        } else {
            column
        });
    }
    let kind_of = |row: &Outcome| Some(growth_of(row)?.fastest.kind());
    let kind_index_of = move |row: &Outcome| Some(kind_of(row)? as usize);
    let text =
        "what a disturbance turns the response into: stable, period_doubling, quasi_periodic, fold";
    let kind_names = StabilityKind::ALL.map(StabilityKind::name).to_vec();
    columns.push(ResultColumn::name(format!("{prefix}kind"), text, kind_names, kind_index_of));
    if !is_map {
        let is_stable = move |row: &Outcome| Some(kind_of(row)? == StabilityKind::Stable);
        let text = "true where every disturbance decays";
        columns.push(ResultColumn::flag("stable", text, is_stable));
    }
    for rank in 0..2 {
        columns.extend(growing_mode_columns(prefix, rank));
    }
    columns.extend(branch_columns(prefix));
    let is_on_curve = |row: &Outcome| Some(growth_of(row)?.is_on_curve);
    let text = if is_map {
        "false where at any of the plan's speeds no response on that curve was found: a machine \
         that runs up may be in another motion there"
    } else {
        "false where the response is not on that curve, but was found from the linear model's \
         response; branch then counts on, and where it is the first of its speed, a machine that \
         runs up may be in another motion"
    };
    columns.push(ResultColumn::flag(format!("{prefix}on_curve"), text, is_on_curve));
    columns
}

/// Returns the columns of the branch of a response.
fn branch_columns(prefix: &str) -> [WasherColumn; 4] {
    let branch_number_of = |row: &Outcome| Some(u64::from(growth_of(row)?.branch));
    // In files of responses the branch tells the rows of a speed apart, so it is never null there.
    let tells_rows_apart = prefix.is_empty();
    let cell_type = if tells_rows_apart { CellType::Count } else { CellType::KnownCount };
    let branch_of = move |row: &Outcome| branch_number_of(row).or(tells_rows_apart.then_some(0));
    let branch_description = "how many folds the point's curve of responses has before this one, \
    followed from a low speed up; of those on the curve, a machine that runs up is on the least \
                 branch that there is at a speed";
    let fold_column = |name: &str, side: &str, index: usize| {
        let text =
            format!("speed of the fold {side} which the branch is not; null where it has none");
        let fold_speed_of = move |row: &Outcome| growth_of(row)?.fold_speeds_rpm[index];
        ResultColumn::measured(format!("{prefix}branch_{name}_rpm"), "rpm", text, fold_speed_of)
    };
    let limit_description = "what of the machine's geometry the response passes, and so is no \
    motion of the machine: spring_hooks, damper_ends, clearance; null where nothing";
    let exceeded_limit_of = |row: &Outcome| Some(growth_of(row)?.exceeded_limit? as usize);
    let limit_names = GeometryLimit::ALL.map(GeometryLimit::name).to_vec();
    [
        ResultColumn::new(format!("{prefix}branch"), "1", branch_description, cell_type, branch_of),
        fold_column("from", "below", 0),
        fold_column("to", "above", 1),
        ResultColumn::name(
            format!("{prefix}beyond"),
            limit_description,
            limit_names,
            exceeded_limit_of,
        ),
    ]
}

/// Returns the columns of the first or the second mode (`rank` 0 or 1) of the growing disturbance.
fn growing_mode_columns(prefix: &str, rank: usize) -> [WasherColumn; 3] {
    let mode_of = move |row: &Outcome| -> Option<GrowingMode> { growth_of(row)?.modes[rank] };
    let rank_text = if rank == 0 { "that takes most part in" } else { "next to that in" };
    let column_prefix = format!("{prefix}mode_{}", rank + 1);
    let text = format!(
        "number, by frequency at this speed, of the linear model's mode {rank_text} what grows; \
         null where nothing grows, or no such mode is needed"
    );
    let mode_number_of = move |row: &Outcome| Some(u64::from(mode_of(row)?.number));
    let motion_description = "what moves in it";
    let motion_names = ModeMotion::NAMES.to_vec();
    let frequency_description = "its damped natural frequency at this speed in cycles per minute";
    [
        ResultColumn::new(column_prefix.clone(), "1", text, CellType::KnownCount, mode_number_of),
        ResultColumn::name(
            format!("{column_prefix}_name"),
            motion_description,
            motion_names,
            move |row| Some(mode_of(row)?.name as usize),
        ),
        ResultColumn::measured(
            format!("{column_prefix}_cpm"),
            "1/min",
            frequency_description,
            move |row| Some(mode_of(row)?.frequency_cpm),
        ),
    ]
}

/// Scale of gaps (m) beside ratios: a gap that is smaller by it is as much worse as a ratio that is
/// greater by a factor of e. Basis: the paper's machine has a clearance of 0.010 m. Doubling it
/// halves the weight of gaps.
const GAP_SCALE_M: f64 = 0.010;

/// Returns the columns of the least gap of each model, which every run has.
fn gap_columns() -> [WasherColumn; 2] {
    MODEL_TRAJECTORIES.map(|(model, trajectory)| {
        let text = format!(
            "least gap between drum and tub over the whole run, {model} model; negative where \
             they clash; null if it failed"
        );
        let gap_of = move |row: &Outcome| trajectory(row).min_gap_m;
        let column = ResultColumn::measured(format!("min_gap_{model}_m"), "m", text, gap_of);
        let column = column.worse(Worse::Less).limit(0.0, GAP_SCALE_M);
        // The nonlinear model's gap is the better estimate of the machine's.
        if model == MODEL_TRAJECTORIES[0].0 { column.in_summary() } else { column }
    })
}

#[cfg(test)]
mod tests;
