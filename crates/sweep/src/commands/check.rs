//! `sweep check GRID.toml` describes a run before it starts, and ranks the assumed numbers of its
//! machine by their effect.

use arrow_array::Array;
use sweep_engine::commands::check as engine_check;
use sweep_engine::config::section::format_count;
use sweep_engine::{
    AxisValues, Design, Error, Estimate, Execution, Exit, Interrupt, ProgressMode, format_duration,
    show, tell, threads,
};
use sweep_files::cells;
use washer_model::{MachineParameter, Range, decimal};
use washer_row::Metric;

use crate::estimate::{LONG_WORK_S, estimate};
use crate::library::PlanEvaluator;
use crate::model::Washer;
use crate::plan::Plan;

/// Arguments of `sweep check`.
#[derive(Debug, clap::Args)]
pub struct WasherCheckArgs {
    #[command(flatten)]
    check: engine_check::CheckArgs,
    /// Vary each number that the machine file leaves out within its expected range, and list these
    /// numbers by their effect, first those that change the verdict
    #[arg(long, conflicts_with = "json")]
    assumed: bool,
}

/// Maximum number of points of a grid at which assumed numbers are varied. Basis: three values of
/// each of two axes. Doubling it doubles the time.
const MAX_TRIAL_POINTS: u64 = 9;

/// Checks a grid and shows its plan, or ranks its assumed numbers.
///
/// # Errors
/// Returns an error for mistakes in the grid file, if there is no engine for it, and if standard
/// output cannot be written.
pub(crate) fn run(args: &WasherCheckArgs) -> Result<Exit, Error> {
    if !args.assumed {
        return engine_check::run::<Washer>(&args.check);
    }
    let plan: Plan = args.check.grid.load()?;
    let assumed_numbers = AssumedNumber::find_all(&plan);
    if assumed_numbers.is_empty() {
        return show("the machine file leaves out no number: nothing is assumed\n");
    }
    let assumption_trial = AssumptionTrial::new(&plan, assumed_numbers);
    let estimate =
        estimate(&assumption_trial.plan, threads::choose_count(None, &threads::read_variable)?)?;
    tell(&assumption_trial.describe_work(&estimate));
    let interrupt = Interrupt::install().map_err(Error::signal_handlers)?;
    let execution =
        Execution { threads: None, progress: ProgressMode::default(), interrupt: &interrupt };
    let Some(outcomes) = assumption_trial.compute_outcomes(execution)? else {
        return Ok(Exit::from_signal(interrupt.signal()));
    };
    show(&assumption_trial.format_table(&outcomes))
}

/// A number that the machine file leaves out.
struct AssumedNumber {
    parameter: MachineParameter,
    value: f64,
    /// The ends of the number's expected range, without those at which no machine exists, such as
    /// moments of inertia of no rigid body.
    range_ends: Vec<f64>,
}

impl AssumedNumber {
    /// Returns every assumed number of a plan's machine that no axis sweeps.
    fn find_all(plan: &Plan) -> Vec<Self> {
        let Washer { machine, spin, .. } = &plan.model;
        let mut assumed_numbers = Vec::new();
        for parameter in MachineParameter::all(machine, spin) {
            let is_swept = plan.axes.iter().any(|axis| {
                axis.parameter.number_names.iter().any(|part| part == parameter.name())
            });
            let Some(assumption) = parameter.assumption() else { continue };
            if is_swept || !plan.sources.is_assumed(parameter.name()) {
                continue;
            }
            let Some(value) = parameter.get(machine, spin) else { continue };
            let end_is_possible = |end: &f64| {
                if *end == value {
                    return false;
                }
                let mut changed_machine = machine.clone();
                parameter.set(&mut changed_machine, &mut spin.clone(), *end);
                parameter.range().contains(*end) && changed_machine.violations().is_empty()
            };
            let range_ends = assumption
                .expected_bounds(value, machine)
                .into_iter()
                .filter(end_is_possible)
                .collect();
            assumed_numbers.push(Self { parameter, value, range_ends });
        }
        assumed_numbers
    }
}

/// Points of a plan, each with the assumed values and with each number at the ends of its range.
struct AssumptionTrial {
    /// The plan as a list of rows: for each point the machine with all assumed values, then the
    /// machines with one number at an end of its range.
    plan: Plan,
    numbers: Vec<AssumedNumber>,
    /// The number of rows of a point.
    rows_per_point: usize,
    /// The speed at which growth is computed (rpm): the greatest of the spin.
    plateau_rpm: f64,
}

/// The results of a row that are compared.
#[derive(Clone, Copy, Debug, Default)]
struct RowOutcome {
    /// Whether the row is reliable; `None` if its verdict is undefined.
    is_reliable: Option<bool>,
    greatest_ratio: Option<f64>,
    growth_per_s: Option<f64>,
}

/// The greatest effect of an assumed number, over all points and both ends of its range.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
struct Effect {
    /// The number of points whose verdict changes or becomes undefined.
    changed_verdicts: usize,
    /// The relative change of the greatest ratio.
    ratio_change: f64,
    /// The change of the growth (1/s); `None` if it is not known at any point.
    growth_change_per_s: Option<f64>,
}

impl AssumptionTrial {
    fn new(plan: &Plan, numbers: Vec<AssumedNumber>) -> Self {
        let point_count = plan.points().min(MAX_TRIAL_POINTS);
        let point_index =
            |k: u64| if point_count > 1 { k * (plan.points() - 1) / (point_count - 1) } else { 0 };
        let points: Vec<Vec<f64>> =
            (0..point_count).map(|k| plan.axis_values(point_index(k))).collect();
        let rows_per_point =
            1 + numbers.iter().map(|number| number.range_ends.len()).sum::<usize>();
        let mut trial_plan = plan.clone();
        let plateau_rpm =
            plan.model.spin.max_speed_rad_per_s(plan.end_s) * 60.0 / std::f64::consts::TAU;
        if !plan.model.measures.metrics.contains(&Metric::Growth) {
            trial_plan.model.measures.metrics.push(Metric::Growth);
        }
        trial_plan.model.held_speeds = format!("{plateau_rpm}").parse().ok();
        if trial_plan.model.held_speeds.is_none() {
            trial_plan.model.measures.metrics.retain(|metric| !metric.is_at_held_speeds());
        }
        for (k, axis) in trial_plan.axes.iter_mut().enumerate() {
            let values =
                points.iter().flat_map(|point| std::iter::repeat_n(point[k], rows_per_point));
            axis.values = AxisValues::List(values.collect());
        }
        let mut first_row = 1;
        for number in &numbers {
            let mut axis_values = vec![number.value; rows_per_point];
            for (k, end) in number.range_ends.iter().enumerate() {
                axis_values[first_row + k] = *end;
            }
            first_row += number.range_ends.len();
            let values = AxisValues::List(axis_values.repeat(points.len()));
            trial_plan.axes.push(sweep_engine::Axis {
                parameter: plan.model.parameter(number.parameter.clone()),
                values,
                tolerance: None,
            });
        }
        let row_count = (rows_per_point * points.len()) as u64;
        let list_name = "assumed numbers".to_owned();
        trial_plan.design =
            Some(Design::List { file: list_name, points: row_count, hash: String::new() });
        Self { plan: trial_plan, numbers, rows_per_point, plateau_rpm }
    }

    fn row_count(&self) -> u64 {
        self.plan.points()
    }

    /// Describes the number of rows and the time that they take, with advice that shortens a long
    /// time.
    fn describe_work(&self, estimate: &Estimate) -> String {
        let points = format_count(self.row_count() as usize / self.rows_per_point, "point");
        let threads = format_count(estimate.threads, "thread");
        let duration_text = format_duration(estimate.wall_s);
        let rows = self.row_count();
        let mut text = format!(
            "{rows} rows, {} for each of {points}, take about {duration_text} on {threads}",
            self.rows_per_point
        );
        if estimate.wall_s > LONG_WORK_S {
            text += "\nit is shorter with fewer points (--at NAME=VALUE fixes an axis), with an \
                     earlier end of [time], and for each number that the machine file gives";
        }
        text
    }

    /// Computes every row. Returns `None` if the work was interrupted.
    fn compute_outcomes(&self, execution: Execution<'_>) -> Result<Option<Vec<RowOutcome>>, Error> {
        let evaluator = PlanEvaluator::new(self.plan.clone());
        let result = evaluator.task_for_all_points()?.compute_in_memory(execution)?;
        let mut outcomes: Vec<RowOutcome> = Vec::new();
        for batch in result.batches() {
            let numbers = |name: &str| {
                let column = batch.column_by_name(name);
                let numbers = column.and_then(|column| cells::numbers(column).ok());
                numbers.unwrap_or_else(|| vec![None; batch.num_rows()])
            };
            let [ratios, growths] = ["ratio_max", "growth_per_s"].map(numbers);
            let reliable_array = batch.column_by_name("reliable");
            let verdicts = reliable_array.and_then(|column| cells::flags(column).ok());
            for row in 0..batch.num_rows() {
                let defined_verdicts = verdicts.filter(|column| !column.is_null(row));
                outcomes.push(RowOutcome {
                    is_reliable: defined_verdicts.map(|column| column.value(row)),
                    greatest_ratio: ratios[row],
                    growth_per_s: growths[row],
                });
            }
        }
        Ok((outcomes.len() as u64 == self.row_count()).then_some(outcomes))
    }

    /// Returns the assumed numbers with their effects, the greatest effect first.
    fn rank_numbers(&self, outcomes: &[RowOutcome]) -> Vec<(&AssumedNumber, Effect)> {
        let mut first_row = 1;
        let mut ranked_numbers = Vec::new();
        for number in &self.numbers {
            let mut effect = Effect::default();
            for point_outcomes in outcomes.chunks(self.rows_per_point) {
                let end_outcomes = &point_outcomes[first_row..first_row + number.range_ends.len()];
                effect.add(point_outcomes[0], end_outcomes);
            }
            first_row += number.range_ends.len();
            ranked_numbers.push((number, effect));
        }
        ranked_numbers
            .sort_by(|(_, a), (_, b)| b.partial_cmp(a).unwrap_or(std::cmp::Ordering::Equal));
        ranked_numbers
    }

    /// Returns the table of effects as text.
    fn format_table(&self, outcomes: &[RowOutcome]) -> String {
        let ranked_numbers = self.rank_numbers(outcomes);
        let name_of = |number: &AssumedNumber| number.parameter.name().to_owned();
        let name_width =
            ranked_numbers.iter().map(|(number, _)| name_of(number).len()).max().unwrap_or(0);
        let points = outcomes.len() / self.rows_per_point;
        let growth_heading =
            format!("growth at {} rpm", decimal(round_to_4_digits(self.plateau_rpm)));
        let mut text = format!(
            "{:name_width$}  {:>10}  {:>22}  {:>12}  {:>9}  {growth_heading}\n",
            "assumed", "value", "expected", "verdicts", "ratio"
        );
        for (number, effect) in &ranked_numbers {
            let range_end_texts: Vec<String> =
                number.range_ends.iter().map(|end| decimal(round_to_4_digits(*end))).collect();
            let expected_text = match range_end_texts.as_slice() {
                [] => "kept".to_owned(),
                range_ends => range_ends.join(" to "),
            };
            let verdicts_text = format!("{} of {points}", effect.changed_verdicts);
            let ratio_text = format!("{:.1} %", 100.0 * effect.ratio_change);
            let growth_text = match effect.growth_change_per_s {
                None => "unknown".to_owned(),
                Some(0.0) => "0 /s".to_owned(),
                Some(change) => format!("{change:.2e} /s"),
            };
            text += &format!(
                "{:name_width$}  {:>10}  {expected_text:>22}  {verdicts_text:>12}  \
                 {ratio_text:>9}  {growth_text}\n",
                name_of(number),
                decimal(round_to_4_digits(number.value)),
            );
        }
        let decisive_names: Vec<String> = ranked_numbers
            .iter()
            .filter(|(_, effect)| effect.changed_verdicts > 0)
            .map(|(number, _)| name_of(number))
            .collect();
        text + &match decisive_names.as_slice() {
            [] => {
                let points = format_count(points, "point");
                format!("none of them changes a verdict at {points} of the plan\n")
            }
            [one] => format!("measure {one}: it changes verdicts\n"),
            many => format!("measure these first, which change verdicts: {}\n", many.join(", ")),
        }
    }
}

impl Effect {
    /// Adds a point, with its outcomes for the assumed value and for the ends of the range.
    fn add(&mut self, assumed_outcome: RowOutcome, end_outcomes: &[RowOutcome]) {
        let changes_verdict =
            end_outcomes.iter().any(|end| end.is_reliable != assumed_outcome.is_reliable);
        self.changed_verdicts += usize::from(changes_verdict);
        for end in end_outcomes {
            if let (Some(assumed), Some(end)) = (assumed_outcome.greatest_ratio, end.greatest_ratio)
            {
                self.ratio_change = self.ratio_change.max((end / assumed - 1.0).abs());
            }
            if let (Some(assumed), Some(end)) = (assumed_outcome.growth_per_s, end.growth_per_s) {
                let change = (end - assumed).abs();
                let greatest_change = self.growth_change_per_s.unwrap_or(change);
                self.growth_change_per_s = Some(greatest_change.max(change));
            }
        }
    }
}

/// Returns a number rounded to four digits, for a table.
fn round_to_4_digits(value: f64) -> f64 {
    let text = format!("{value:.3e}");
    let number = text.parse().unwrap_or(value);
    if Range::Any.contains(number) { number } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::WasherGridInput;

    const SHEET_MACHINE: &str = include_str!("starter_machine.toml");

    /// Returns a plan of a machine from a data sheet, with further lines of the grid file.
    fn plan_of_sheet(more: &str) -> Plan {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("m.toml"), SHEET_MACHINE).expect("it is written");
        let grid_text = format!(
            "machine = \"m.toml\"\n[spin]\nprofile = \"ramp\"\npeak_rpm = 300\nramp_s = 1\n\
             [time]\nend_s = 1.5\n{more}"
        );
        let path = folder.path().join("g.toml");
        std::fs::write(&path, grid_text).expect("it is written");
        WasherGridInput::file(path, Vec::new())
            .load()
            .unwrap_or_else(|mistakes| panic!("{mistakes}"))
    }

    #[test]
    fn every_left_out_number_is_varied_and_ranked() {
        let sheet_plan =
            plan_of_sheet("[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.3]\n");
        let trial = AssumptionTrial::new(&sheet_plan, AssumedNumber::find_all(&sheet_plan));
        assert!(trial.numbers.len() > 10, "{}", trial.numbers.len());
        let interrupt = Interrupt::new();
        let execution =
            || Execution { threads: Some(1), progress: ProgressMode::None, interrupt: &interrupt };
        let outcomes = trial.compute_outcomes(execution()).unwrap().expect("nobody interrupts");
        assert_eq!(outcomes.len(), 2 * trial.rows_per_point);
        // The rows with all assumed values are those of the plan itself, except for their steps.
        let evaluator = PlanEvaluator::new(sheet_plan.clone());
        let plan_rows =
            evaluator.task_for_all_points().unwrap().compute_in_memory(execution()).unwrap();
        let ratio_column = plan_rows.batches()[0].column_by_name("ratio_max").expect("it is there");
        let ratios = cells::numbers(ratio_column).unwrap();
        for (point, ratio) in ratios.into_iter().enumerate() {
            let [plan_ratio, trial_ratio] =
                [ratio, outcomes[point * trial.rows_per_point].greatest_ratio].map(Option::unwrap);
            assert!((trial_ratio / plan_ratio - 1.0).abs() < 0.01, "{plan_ratio} {trial_ratio}");
        }
        let ranked_numbers = trial.rank_numbers(&outcomes);
        assert!(ranked_numbers.windows(2).all(|pair| pair[0].1 >= pair[1].1));
        assert!(
            ranked_numbers[0].1.ratio_change
                > ranked_numbers[ranked_numbers.len() - 1].1.ratio_change,
            "{:?}",
            ranked_numbers[0].1
        );
        let text = trial.format_table(&outcomes);
        assert!(text.contains("tub_inertia_11_kg_m2") && text.contains("300 rpm"), "{text}");
    }

    #[test]
    fn long_work_is_announced_with_what_makes_it_shorter() {
        let sheet_plan =
            plan_of_sheet("[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.3]\n");
        let trial = AssumptionTrial::new(&sheet_plan, AssumedNumber::find_all(&sheet_plan));
        let trial_estimate = estimate(&trial.plan, 2).unwrap();
        assert!(
            trial_estimate.wall_s > 0.0 && trial_estimate.sample_statuses.values().sum::<u64>() > 0
        );
        let describe_with_time = |wall_s: f64| {
            let estimate = Estimate { wall_s, ..trial_estimate.clone() };
            trial.describe_work(&estimate)
        };
        let rows = trial.row_count();
        let rows_text =
            format!("{rows} rows, {} for each of 2 points, take about ", trial.rows_per_point);
        assert_eq!(describe_with_time(90.0), format!("{rows_text}1 min 30 s on 2 threads"));
        let text = describe_with_time(7200.0);
        assert!(text.starts_with(&format!("{rows_text}2 h 00 min on 2 threads\n")), "{text}");
        assert!(text.contains("--at NAME=VALUE"), "{text}");
    }

    #[test]
    fn numbers_that_change_a_verdict_come_first() {
        let outcome_with_ratio = |is_reliable, ratio| RowOutcome {
            is_reliable: Some(is_reliable),
            greatest_ratio: Some(ratio),
            growth_per_s: Some(-1.0),
        };
        let mut decisive_effect = Effect::default();
        decisive_effect.add(
            outcome_with_ratio(true, 1.9),
            &[outcome_with_ratio(true, 1.8), outcome_with_ratio(false, 2.1)],
        );
        let mut indecisive_effect = Effect::default();
        indecisive_effect.add(outcome_with_ratio(true, 1.0), &[outcome_with_ratio(true, 1.9)]);
        assert_eq!((decisive_effect.changed_verdicts, indecisive_effect.changed_verdicts), (1, 0));
        assert!(
            decisive_effect > indecisive_effect
                && indecisive_effect.ratio_change > decisive_effect.ratio_change
        );
    }

    #[test]
    fn a_number_without_effect_has_an_effect_of_0() {
        let sheet_plan =
            plan_of_sheet("[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1]\n");
        let trial = AssumptionTrial::new(&sheet_plan, AssumedNumber::find_all(&sheet_plan));
        let outcome_with_growth =
            |growth_per_s| RowOutcome { growth_per_s, ..RowOutcome::default() };
        let table_with_growth =
            |growth| trial.format_table(&vec![outcome_with_growth(growth); trial.rows_per_point]);
        let [known_growth_table, unknown_growth_table] =
            [table_with_growth(Some(-1.0)), table_with_growth(None)];
        let first_row = |table: &str| table.lines().nth(1).expect("a number is assumed").to_owned();
        assert!(first_row(&known_growth_table).ends_with("  0 /s"), "{known_growth_table}");
        assert!(first_row(&unknown_growth_table).ends_with("  unknown"), "{unknown_growth_table}");
        assert!(known_growth_table.ends_with("at 1 point of the plan\n"), "{known_growth_table}");
    }
}
