//! `sweep check GRID.toml` describes a run before it starts, and ranks the assumed numbers of its
//! machine by their effect.

use arrow_array::Array;
use sweep_engine::commands::check as engine_check;
use sweep_engine::config::section::counted;
use sweep_engine::{
    AxisValues, Design, Error, Estimate, Execution, Exit, Interrupt, ProgressMode, duration, show,
    tell, threads,
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
    let assumed = Assumed::all(&plan);
    if assumed.is_empty() {
        return show("the machine file leaves out no number: nothing is assumed\n");
    }
    let trial = Trial::new(&plan, assumed);
    let estimate = estimate(&trial.plan, threads::count(None, &threads::process)?)?;
    tell(&trial.announcement(&estimate));
    let interrupt = Interrupt::install().map_err(Error::signals)?;
    let execution =
        Execution { threads: None, progress: ProgressMode::default(), interrupt: &interrupt };
    let Some(outcomes) = trial.outcomes(execution)? else {
        return Ok(Exit::interrupted(interrupt.signal()));
    };
    show(&trial.table(&outcomes))
}

/// A number that the machine file leaves out.
struct Assumed {
    parameter: MachineParameter,
    value: f64,
    /// The ends of its expected range, without those at which no machine exists, such as moments of
    /// inertia of no rigid body.
    ends: Vec<f64>,
}

impl Assumed {
    /// Returns every assumed number of a plan's machine that no axis sweeps.
    fn all(plan: &Plan) -> Vec<Self> {
        let Washer { machine, spin, .. } = &plan.model;
        let mut all = Vec::new();
        for parameter in MachineParameter::all(machine, spin) {
            let is_swept = plan
                .axes
                .iter()
                .any(|axis| axis.parameter.parts.iter().any(|part| part == parameter.name()));
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
            let ends = assumption
                .expected_bounds(value, machine)
                .into_iter()
                .filter(is_possible)
                .collect();
            all.push(Self { parameter, value, ends });
        }
        all
    }
}

/// Points of a plan, each with the assumed values and with each number at the ends of its range.
struct Trial {
    /// The plan as a list of rows: for each point the machine with all assumed values, then the
    /// machines with one number at an end of its range.
    plan: Plan,
    assumed: Vec<Assumed>,
    /// The number of rows of a point.
    stride: usize,
    /// The speed at which growth is computed (rpm): the greatest of the spin.
    plateau_rpm: f64,
}

/// The results of a row that are compared.
#[derive(Clone, Copy, Debug, Default)]
struct TrialOutcome {
    /// Whether the row is reliable.
    verdict: Option<bool>,
    /// The greatest ratio.
    ratio: Option<f64>,
    growth_per_s: Option<f64>,
}

/// The greatest effect of an assumed number, over all points and both ends of its range.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
struct Effect {
    /// The number of points whose verdict changes or becomes undefined.
    verdicts: usize,
    /// The relative change of the greatest ratio.
    ratio: f64,
    /// The change of the growth (1/s); `None` if it is not known at any point.
    growth_per_s: Option<f64>,
}

impl Trial {
    fn new(plan: &Plan, assumed: Vec<Assumed>) -> Self {
        let count = plan.points().min(MAX_TRIAL_POINTS);
        let step = |k: u64| if count > 1 { k * (plan.points() - 1) / (count - 1) } else { 0 };
        let points: Vec<Vec<f64>> = (0..count).map(|k| plan.axis_values(step(k))).collect();
        let stride = 1 + assumed.iter().map(|number| number.ends.len()).sum::<usize>();
        let mut trial = plan.clone();
        let plateau_rpm =
            plan.model.spin.greatest_speed_rad_per_s(plan.end_s) * 60.0 / std::f64::consts::TAU;
        if !plan.model.measures.metrics.contains(&Metric::Growth) {
            trial.model.measures.metrics.push(Metric::Growth);
        }
        trial.model.held_speeds = format!("{plateau_rpm}").parse().ok();
        if trial.model.held_speeds.is_none() {
            trial.model.measures.metrics.retain(|metric| !metric.is_at_held_speeds());
        }
        for (k, axis) in trial.axes.iter_mut().enumerate() {
            let values = points.iter().flat_map(|point| std::iter::repeat_n(point[k], stride));
            axis.values = AxisValues::List(values.collect());
        }
        let mut first = 1;
        for number in &assumed {
            let mut row = vec![number.value; stride];
            for (k, end) in number.ends.iter().enumerate() {
                row[first + k] = *end;
            }
            first += number.ends.len();
            let values = AxisValues::List(row.repeat(points.len()));
            trial.axes.push(sweep_engine::Axis {
                parameter: plan.model.parameter(number.parameter.clone()),
                values,
                tolerance: None,
            });
        }
        let rows = (stride * points.len()) as u64;
        let file = "assumed numbers".to_owned();
        trial.design = Some(Design::List { file, points: rows, hash: String::new() });
        Self { plan: trial, assumed, stride, plateau_rpm }
    }

    fn rows(&self) -> u64 {
        self.plan.points()
    }

    /// Returns the number of rows and the time that they take, and what makes a long time shorter.
    fn announcement(&self, estimate: &Estimate) -> String {
        let points = counted(self.rows() as usize / self.stride, "point");
        let threads = counted(estimate.threads, "thread");
        let time = duration(estimate.wall_s);
        let rows = self.rows();
        let mut text = format!(
            "{rows} rows, {} for each of {points}, take about {time} on {threads}",
            self.stride
        );
        if estimate.wall_s > LONG_WORK_S {
            text += "\nit is shorter with fewer points (--at NAME=VALUE fixes an axis), with an \
                     earlier end of [time], and for each number that the machine file gives";
        }
        text
    }

    /// Computes every row. Returns `None` if the work was interrupted.
    fn outcomes(&self, execution: Execution<'_>) -> Result<Option<Vec<TrialOutcome>>, Error> {
        let evaluator = PlanEvaluator::new(self.plan.clone());
        let found = evaluator.all_points()?.in_memory(execution)?;
        let mut outcomes: Vec<TrialOutcome> = Vec::new();
        for batch in found.batches() {
            let numbers = |name: &str| {
                let column = batch.column_by_name(name);
                let numbers = column.and_then(|column| cells::numbers(column).ok());
                numbers.unwrap_or_else(|| vec![None; batch.num_rows()])
            };
            let [ratios, growths] = ["ratio_max", "growth_per_s"].map(numbers);
            let verdicts = batch.column_by_name("reliable");
            let verdicts = verdicts.and_then(|column| cells::flags(column).ok());
            for row in 0..batch.num_rows() {
                let known = verdicts.filter(|column| !column.is_null(row));
                outcomes.push(TrialOutcome {
                    verdict: known.map(|column| column.value(row)),
                    ratio: ratios[row],
                    growth_per_s: growths[row],
                });
            }
        }
        Ok((outcomes.len() as u64 == self.rows()).then_some(outcomes))
    }

    /// Returns the assumed numbers with their effects, the greatest effect first.
    fn ranked(&self, outcomes: &[TrialOutcome]) -> Vec<(&Assumed, Effect)> {
        let mut first = 1;
        let mut ranked = Vec::new();
        for number in &self.assumed {
            let mut effect = Effect::default();
            for rows in outcomes.chunks(self.stride) {
                let ends = &rows[first..first + number.ends.len()];
                effect.add(rows[0], ends);
            }
            first += number.ends.len();
            ranked.push((number, effect));
        }
        ranked.sort_by(|(_, a), (_, b)| b.partial_cmp(a).unwrap_or(std::cmp::Ordering::Equal));
        ranked
    }

    /// Returns the table of effects as text.
    fn table(&self, outcomes: &[TrialOutcome]) -> String {
        let ranked = self.ranked(outcomes);
        let name = |number: &Assumed| number.parameter.name().to_owned();
        let width = ranked.iter().map(|(number, _)| name(number).len()).max().unwrap_or(0);
        let points = outcomes.len() / self.stride;
        let growth = format!("growth at {} rpm", decimal(rounded(self.plateau_rpm)));
        let mut text = format!(
            "{:width$}  {:>10}  {:>22}  {:>12}  {:>9}  {growth}\n",
            "assumed", "value", "expected", "verdicts", "ratio"
        );
        for (number, effect) in &ranked {
            let expected: Vec<String> =
                number.ends.iter().map(|end| decimal(rounded(*end))).collect();
            let expected = match expected.as_slice() {
                [] => "kept".to_owned(),
                ends => ends.join(" to "),
            };
            let verdicts = format!("{} of {points}", effect.verdicts);
            let ratio = format!("{:.1} %", 100.0 * effect.ratio);
            let growth = match effect.growth_per_s {
                None => "unknown".to_owned(),
                Some(0.0) => "0 /s".to_owned(),
                Some(change) => format!("{change:.2e} /s"),
            };
            text += &format!(
                "{:width$}  {:>10}  {expected:>22}  {verdicts:>12}  {ratio:>9}  {growth}\n",
                name(number),
                decimal(rounded(number.value)),
            );
        }
        let decisive: Vec<String> = ranked
            .iter()
            .filter(|(_, effect)| effect.verdicts > 0)
            .map(|(number, _)| name(number))
            .collect();
        text + &match decisive.as_slice() {
            [] => {
                let points = counted(points, "point");
                format!("none of them changes a verdict at {points} of the plan\n")
            }
            [one] => format!("measure {one}: it changes verdicts\n"),
            many => format!("measure these first, which change verdicts: {}\n", many.join(", ")),
        }
    }
}

impl Effect {
    /// Adds a point, with its outcomes for the assumed value and for the ends of the range.
    fn add(&mut self, assumed: TrialOutcome, ends: &[TrialOutcome]) {
        let changes = ends.iter().any(|end| end.verdict != assumed.verdict);
        self.verdicts += usize::from(changes);
        for end in ends {
            if let (Some(assumed), Some(end)) = (assumed.ratio, end.ratio) {
                self.ratio = self.ratio.max((end / assumed - 1.0).abs());
            }
            if let (Some(assumed), Some(end)) = (assumed.growth_per_s, end.growth_per_s) {
                let change = (end - assumed).abs();
                self.growth_per_s = Some(self.growth_per_s.map_or(change, |most| most.max(change)));
            }
        }
    }
}

/// Returns a number rounded to four digits, for a table.
fn rounded(value: f64) -> f64 {
    let text = format!("{value:.3e}");
    let number = text.parse().unwrap_or(value);
    if Range::Any.contains(number) { number } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::WasherGridInput;

    const SHEET: &str = include_str!("starter_machine.toml");

    /// Returns a plan of a machine from a data sheet, with further lines of the grid file.
    fn plan(more: &str) -> Plan {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("m.toml"), SHEET).expect("it is written");
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
        let trial = Trial::new(&plan, Assumed::all(&plan));
        assert!(trial.assumed.len() > 10, "{}", trial.assumed.len());
        let interrupt = Interrupt::new();
        let execution =
            || Execution { threads: Some(1), progress: ProgressMode::None, interrupt: &interrupt };
        let outcomes = trial.outcomes(execution()).unwrap().expect("nobody interrupts");
        assert_eq!(outcomes.len(), 2 * trial.stride);
        // The rows with all assumed values are those of the plan itself, except for their steps.
        let evaluator = PlanEvaluator::new(plan.clone());
        let plan_rows = evaluator.all_points().unwrap().in_memory(execution()).unwrap();
        let column = plan_rows.batches()[0].column_by_name("ratio_max").expect("it is there");
        let ratios = cells::numbers(column).unwrap();
        for (point, ratio) in ratios.into_iter().enumerate() {
            let [plan_ratio, trial_ratio] =
                [ratio, outcomes[point * trial.stride].ratio].map(Option::unwrap);
            assert!((trial_ratio / plan_ratio - 1.0).abs() < 0.01, "{plan_ratio} {trial_ratio}");
        }
        let ranked = trial.ranked(&outcomes);
        assert!(ranked.windows(2).all(|pair| pair[0].1 >= pair[1].1));
        assert!(ranked[0].1.ratio > ranked[ranked.len() - 1].1.ratio, "{:?}", ranked[0].1);
        let text = trial.table(&outcomes);
        assert!(text.contains("tub_inertia_11_kg_m2") && text.contains("300 rpm"), "{text}");
    }

    #[test]
    fn long_work_is_announced_with_what_makes_it_shorter() {
        let plan = plan("[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.3]\n");
        let trial = Trial::new(&plan, Assumed::all(&plan));
        let estimate = estimate(&trial.plan, 2).unwrap();
        assert!(estimate.wall_s > 0.0 && estimate.sampled.values().sum::<u64>() > 0);
        let announced = |wall_s: f64| {
            let estimate = Estimate { wall_s, ..estimate.clone() };
            trial.announcement(&estimate)
        };
        let rows = trial.rows();
        let line = format!("{rows} rows, {} for each of 2 points, take about ", trial.stride);
        assert_eq!(announced(90.0), format!("{line}1 min 30 s on 2 threads"));
        let text = announced(7200.0);
        assert!(text.starts_with(&format!("{line}2 h 00 min on 2 threads\n")), "{text}");
        assert!(text.contains("--at NAME=VALUE"), "{text}");
    }

    #[test]
    fn numbers_that_change_a_verdict_come_first() {
        let outcome = |verdict, ratio| TrialOutcome {
            verdict: Some(verdict),
            ratio: Some(ratio),
            growth_per_s: Some(-1.0),
        };
        let mut changing = Effect::default();
        changing.add(outcome(true, 1.9), &[outcome(true, 1.8), outcome(false, 2.1)]);
        let mut unchanging = Effect::default();
        unchanging.add(outcome(true, 1.0), &[outcome(true, 1.9)]);
        assert_eq!((changing.verdicts, unchanging.verdicts), (1, 0));
        assert!(changing > unchanging && unchanging.ratio > changing.ratio);
    }

    #[test]
    fn a_number_without_effect_has_an_effect_of_0() {
        let plan = plan("[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1]\n");
        let trial = Trial::new(&plan, Assumed::all(&plan));
        let outcome = |growth_per_s| TrialOutcome { growth_per_s, ..TrialOutcome::default() };
        let table = |growth| trial.table(&vec![outcome(growth); trial.stride]);
        let [known, unknown] = [table(Some(-1.0)), table(None)];
        let row = |table: &str| table.lines().nth(1).expect("a number is assumed").to_owned();
        assert!(row(&known).ends_with("  0 /s"), "{known}");
        assert!(row(&unknown).ends_with("  unknown"), "{unknown}");
        assert!(known.ends_with("at 1 point of the plan\n"), "{known}");
    }
}
