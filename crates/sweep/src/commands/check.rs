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
    let assumed = AssumedNumber::find_all(&plan);
    if assumed.is_empty() {
        return show("the machine file leaves out no number: nothing is assumed\n");
    }
    let trial = Trial::new(&plan, assumed);
    let estimate = estimate(&trial.plan, threads::choose_count(None, &threads::read_variable)?)?;
    tell(&trial.describe_work(&estimate));
    let interrupt = Interrupt::install().map_err(Error::signal_handlers)?;
    let execution =
        Execution { threads: None, progress: ProgressMode::default(), interrupt: &interrupt };
    let Some(outcomes) = trial.compute_outcomes(execution)? else {
        return Ok(Exit::from_signal(interrupt.signal()));
    };
    show(&trial.format_table(&outcomes))
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
        let mut all = Vec::new();
        for parameter in MachineParameter::all(machine, spin) {
            let is_swept = plan.axes.iter().any(|axis| {
                axis.parameter.number_names.iter().any(|part| part == parameter.name())
            });
            let Some(assumption) = parameter.assumption() else { continue };
            if is_swept || !plan.sources.is_assumed(parameter.name()) {
                continue;
            }
            let Some(value) = parameter.get(machine, spin) else { continue };
            let is_possible = |end: &f64| {
                if *end == value {
                    return false;
                }
                let mut other = machine.clone();
                parameter.set(&mut other, &mut spin.clone(), *end);
                parameter.range().contains(*end) && other.violations().is_empty()
            };
            let range_ends = assumption
                .expected_bounds(value, machine)
                .into_iter()
                .filter(is_possible)
                .collect();
            all.push(Self { parameter, value, range_ends });
        }
        all
    }
}

/// Points of a plan, each with the assumed values and with each number at the ends of its range.
struct Trial {
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
struct TrialOutcome {
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

impl Trial {
    fn new(plan: &Plan, numbers: Vec<AssumedNumber>) -> Self {
        let count = plan.points().min(MAX_TRIAL_POINTS);
        let point_index =
            |k: u64| if count > 1 { k * (plan.points() - 1) / (count - 1) } else { 0 };
        let points: Vec<Vec<f64>> = (0..count).map(|k| plan.axis_values(point_index(k))).collect();
        let rows_per_point =
            1 + numbers.iter().map(|number| number.range_ends.len()).sum::<usize>();
        let mut trial = plan.clone();
        let plateau_rpm =
            plan.model.spin.max_speed_rad_per_s(plan.end_s) * 60.0 / std::f64::consts::TAU;
        if !plan.model.measures.metrics.contains(&Metric::Growth) {
            trial.model.measures.metrics.push(Metric::Growth);
        }
        trial.model.held_speeds = format!("{plateau_rpm}").parse().ok();
        if trial.model.held_speeds.is_none() {
            trial.model.measures.metrics.retain(|metric| !metric.is_at_held_speeds());
        }
        for (k, axis) in trial.axes.iter_mut().enumerate() {
            let values =
                points.iter().flat_map(|point| std::iter::repeat_n(point[k], rows_per_point));
            axis.values = AxisValues::List(values.collect());
        }
        let mut first = 1;
        for number in &numbers {
            let mut row = vec![number.value; rows_per_point];
            for (k, end) in number.range_ends.iter().enumerate() {
                row[first + k] = *end;
            }
            first += number.range_ends.len();
            let values = AxisValues::List(row.repeat(points.len()));
            trial.axes.push(sweep_engine::Axis {
                parameter: plan.model.parameter(number.parameter.clone()),
                values,
                tolerance: None,
            });
        }
        let rows = (rows_per_point * points.len()) as u64;
        let file = "assumed numbers".to_owned();
        trial.design = Some(Design::List { file, points: rows, hash: String::new() });
        Self { plan: trial, numbers, rows_per_point, plateau_rpm }
    }

    fn rows(&self) -> u64 {
        self.plan.points()
    }

    /// Describes the number of rows and the time that they take, with advice that shortens a long
    /// time.
    fn describe_work(&self, estimate: &Estimate) -> String {
        let points = format_count(self.rows() as usize / self.rows_per_point, "point");
        let threads = format_count(estimate.threads, "thread");
        let time = format_duration(estimate.wall_s);
        let rows = self.rows();
        let mut text = format!(
            "{rows} rows, {} for each of {points}, take about {time} on {threads}",
            self.rows_per_point
        );
        if estimate.wall_s > LONG_WORK_S {
            text += "\nit is shorter with fewer points (--at NAME=VALUE fixes an axis), with an \
                     earlier end of [time], and for each number that the machine file gives";
        }
        text
    }

    /// Computes every row. Returns `None` if the work was interrupted.
    fn compute_outcomes(
        &self,
        execution: Execution<'_>,
    ) -> Result<Option<Vec<TrialOutcome>>, Error> {
        let evaluator = PlanEvaluator::new(self.plan.clone());
        let result = evaluator.task_for_all_points()?.compute_in_memory(execution)?;
        let mut outcomes: Vec<TrialOutcome> = Vec::new();
        for batch in result.batches() {
            let numbers = |name: &str| {
                let column = batch.column_by_name(name);
                let numbers = column.and_then(|column| cells::numbers(column).ok());
                numbers.unwrap_or_else(|| vec![None; batch.num_rows()])
            };
            let [ratios, growths] = ["ratio_max", "growth_per_s"].map(numbers);
            let verdicts = batch.column_by_name("reliable");
            let verdicts = verdicts.and_then(|column| cells::flags(column).ok());
            for row in 0..batch.num_rows() {
                let reliable_column = verdicts.filter(|column| !column.is_null(row));
                outcomes.push(TrialOutcome {
                    is_reliable: reliable_column.map(|column| column.value(row)),
                    greatest_ratio: ratios[row],
                    growth_per_s: growths[row],
                });
            }
        }
        Ok((outcomes.len() as u64 == self.rows()).then_some(outcomes))
    }

    /// Returns the assumed numbers with their effects, the greatest effect first.
    fn rank_numbers(&self, outcomes: &[TrialOutcome]) -> Vec<(&AssumedNumber, Effect)> {
        let mut first = 1;
        let mut ranked = Vec::new();
        for number in &self.numbers {
            let mut effect = Effect::default();
            for rows in outcomes.chunks(self.rows_per_point) {
                let range_ends = &rows[first..first + number.range_ends.len()];
                effect.add(rows[0], range_ends);
            }
            first += number.range_ends.len();
            ranked.push((number, effect));
        }
        ranked.sort_by(|(_, a), (_, b)| b.partial_cmp(a).unwrap_or(std::cmp::Ordering::Equal));
        ranked
    }

    /// Returns the table of effects as text.
    fn format_table(&self, outcomes: &[TrialOutcome]) -> String {
        let ranked = self.rank_numbers(outcomes);
        let name = |number: &AssumedNumber| number.parameter.name().to_owned();
        let width = ranked.iter().map(|(number, _)| name(number).len()).max().unwrap_or(0);
        let points = outcomes.len() / self.rows_per_point;
        let growth = format!("growth at {} rpm", decimal(round_to_4_digits(self.plateau_rpm)));
        let mut text = format!(
            "{:width$}  {:>10}  {:>22}  {:>12}  {:>9}  {growth}\n",
            "assumed", "value", "expected", "verdicts", "ratio"
        );
        for (number, effect) in &ranked {
            let expected: Vec<String> =
                number.range_ends.iter().map(|end| decimal(round_to_4_digits(*end))).collect();
            let expected = match expected.as_slice() {
                [] => "kept".to_owned(),
                range_ends => range_ends.join(" to "),
            };
            let verdicts = format!("{} of {points}", effect.changed_verdicts);
            let ratio = format!("{:.1} %", 100.0 * effect.ratio_change);
            let growth = match effect.growth_change_per_s {
                None => "unknown".to_owned(),
                Some(0.0) => "0 /s".to_owned(),
                Some(change) => format!("{change:.2e} /s"),
            };
            text += &format!(
                "{:width$}  {:>10}  {expected:>22}  {verdicts:>12}  {ratio:>9}  {growth}\n",
                name(number),
                decimal(round_to_4_digits(number.value)),
            );
        }
        let decisive: Vec<String> = ranked
            .iter()
            .filter(|(_, effect)| effect.changed_verdicts > 0)
            .map(|(number, _)| name(number))
            .collect();
        text + &match decisive.as_slice() {
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
    fn add(&mut self, assumed: TrialOutcome, range_ends: &[TrialOutcome]) {
        let changes = range_ends.iter().any(|end| end.is_reliable != assumed.is_reliable);
        self.changed_verdicts += usize::from(changes);
        for end in range_ends {
            if let (Some(assumed), Some(end)) = (assumed.greatest_ratio, end.greatest_ratio) {
                self.ratio_change = self.ratio_change.max((end / assumed - 1.0).abs());
            }
            if let (Some(assumed), Some(end)) = (assumed.growth_per_s, end.growth_per_s) {
                let change = (end - assumed).abs();
                let greatest = self.growth_change_per_s.unwrap_or(change);
                self.growth_change_per_s = Some(greatest.max(change));
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
    fn plan(more: &str) -> Plan {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("m.toml"), SHEET_MACHINE).expect("it is written");
        let grid = format!(
            "machine = \"m.toml\"\n[spin]\nprofile = \"ramp\"\npeak_rpm = 300\nramp_s = 1\n\
             [time]\nend_s = 1.5\n{more}"
        );
        let path = folder.path().join("g.toml");
        std::fs::write(&path, grid).expect("it is written");
        WasherGridInput::file(path, Vec::new())
            .load()
            .unwrap_or_else(|mistakes| panic!("{mistakes}"))
    }

    #[test]
    fn every_left_out_number_is_varied_and_ranked() {
        let plan = plan("[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.3]\n");
        let trial = Trial::new(&plan, AssumedNumber::find_all(&plan));
        assert!(trial.numbers.len() > 10, "{}", trial.numbers.len());
        let interrupt = Interrupt::new();
        let execution =
            || Execution { threads: Some(1), progress: ProgressMode::None, interrupt: &interrupt };
        let outcomes = trial.compute_outcomes(execution()).unwrap().expect("nobody interrupts");
        assert_eq!(outcomes.len(), 2 * trial.rows_per_point);
        // The rows with all assumed values are those of the plan itself, except for their steps.
        let evaluator = PlanEvaluator::new(plan.clone());
        let plan_rows =
            evaluator.task_for_all_points().unwrap().compute_in_memory(execution()).unwrap();
        let column = plan_rows.batches()[0].column_by_name("ratio_max").expect("it is there");
        let ratios = cells::numbers(column).unwrap();
        for (point, ratio) in ratios.into_iter().enumerate() {
            let [plan_ratio, trial_ratio] =
                [ratio, outcomes[point * trial.rows_per_point].greatest_ratio].map(Option::unwrap);
            assert!((trial_ratio / plan_ratio - 1.0).abs() < 0.01, "{plan_ratio} {trial_ratio}");
        }
        let ranked = trial.rank_numbers(&outcomes);
        assert!(ranked.windows(2).all(|pair| pair[0].1 >= pair[1].1));
        assert!(
            ranked[0].1.ratio_change > ranked[ranked.len() - 1].1.ratio_change,
            "{:?}",
            ranked[0].1
        );
        let text = trial.format_table(&outcomes);
        assert!(text.contains("tub_inertia_11_kg_m2") && text.contains("300 rpm"), "{text}");
    }

    #[test]
    fn long_work_is_announced_with_what_makes_it_shorter() {
        let plan = plan("[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.3]\n");
        let trial = Trial::new(&plan, AssumedNumber::find_all(&plan));
        let estimate = estimate(&trial.plan, 2).unwrap();
        assert!(estimate.wall_s > 0.0 && estimate.sample_statuses.values().sum::<u64>() > 0);
        let announced = |wall_s: f64| {
            let estimate = Estimate { wall_s, ..estimate.clone() };
            trial.describe_work(&estimate)
        };
        let rows = trial.rows();
        let line =
            format!("{rows} rows, {} for each of 2 points, take about ", trial.rows_per_point);
        assert_eq!(announced(90.0), format!("{line}1 min 30 s on 2 threads"));
        let text = announced(7200.0);
        assert!(text.starts_with(&format!("{line}2 h 00 min on 2 threads\n")), "{text}");
        assert!(text.contains("--at NAME=VALUE"), "{text}");
    }

    #[test]
    fn numbers_that_change_a_verdict_come_first() {
        let outcome = |is_reliable, ratio| TrialOutcome {
            is_reliable: Some(is_reliable),
            greatest_ratio: Some(ratio),
            growth_per_s: Some(-1.0),
        };
        let mut changing = Effect::default();
        changing.add(outcome(true, 1.9), &[outcome(true, 1.8), outcome(false, 2.1)]);
        let mut unchanging = Effect::default();
        unchanging.add(outcome(true, 1.0), &[outcome(true, 1.9)]);
        assert_eq!((changing.changed_verdicts, unchanging.changed_verdicts), (1, 0));
        assert!(changing > unchanging && unchanging.ratio_change > changing.ratio_change);
    }

    #[test]
    fn a_number_without_effect_has_an_effect_of_0() {
        let plan = plan("[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1]\n");
        let trial = Trial::new(&plan, AssumedNumber::find_all(&plan));
        let outcome = |growth_per_s| TrialOutcome { growth_per_s, ..TrialOutcome::default() };
        let format_table =
            |growth| trial.format_table(&vec![outcome(growth); trial.rows_per_point]);
        let [known, unknown] = [format_table(Some(-1.0)), format_table(None)];
        let row = |table: &str| table.lines().nth(1).expect("a number is assumed").to_owned();
        assert!(row(&known).ends_with("  0 /s"), "{known}");
        assert!(row(&unknown).ends_with("  unknown"), "{unknown}");
        assert!(known.ends_with("at 1 point of the plan\n"), "{known}");
    }
}
