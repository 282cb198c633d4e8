//! Study files: objectives, parameters and conditions of an optimisation.

use std::path::Path;

use serde_json::{Value, json};
use sweep_files::FileKind;
use sweep_parameter::Range;
use sweep_results::{Column, ExpressionError, Goal, columns};

use super::Evolution;
use crate::config::axes::{add_axis, read_range};
use crate::config::design::{DEFAULT_SEED, MAX_SEED};
use crate::config::grid::{STUDY_KEYS, read_draft, refuse_other_kind};
use crate::config::parameters::find_parameter;
use crate::config::section::format_choices;
use crate::config::sections::read_name;
use crate::config::source::resolve_beside;
use crate::config::syntax::{self, parse_toml};
use crate::config::{
    Diagnostic, Draft, Field, Located, Location, Report, Section, plan_checks,
    written_twice_mistake,
};
use crate::design::{DesignRule, MAX_AXES};
use crate::{AxisValues, Design, Diagnostics, GridInput, Job, Model, ModelParameter, Plan};

/// Maximum number of candidates. Basis: a file of some 100 MB. Doubling it doubles that.
const MAX_CANDIDATES: u64 = 1_000_000;
/// Maximum number of rows at which a candidate is evaluated. Basis: a generation must fit memory.
/// Doubling it doubles that memory.
const MAX_ROWS: u64 = 100_000;
/// Maximum number of parameters. Basis: differential evolution converges slowly with more. Doubling
/// it accepts studies that hardly converge.
const MAX_PARAMETERS: u64 = 20;

/// Generations in the default number of candidates. Basis: a study of a few parameters has
/// converged by then. Doubling it doubles the time of a study.
const DEFAULT_GENERATIONS: u64 = 24;

/// A search for the minimum of some objectives over some parameters.
#[derive(Clone, Debug)]
pub struct Study<M: Model> {
    /// The name of the study; its file defaults to `results/<name>.parquet`.
    pub name: String,
    /// The plan of all candidates' rows: the grid's axes as ranges, then the parameters.
    pub plan: Plan<M>,
    /// The grid at whose points every candidate is evaluated.
    pub grid: Plan<M>,
    /// The parameters that are searched.
    pub parameters: Vec<SearchedParameter>,
    /// The objectives, in the order of their columns.
    pub objectives: Vec<Objective>,
    /// The conditions of feasible candidates.
    pub conditions: Vec<Goal>,
    /// The settings of the search.
    pub evolution: Evolution,
}

/// A parameter that is searched.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchedParameter {
    /// The bounds, linear or logarithmic.
    pub bounds: AxisValues,
    /// The greatest relative deviation of a product from the candidate's value. The grid's design
    /// spreads the deviations.
    pub tolerance: f64,
}

/// A number that is minimised or maximised.
#[derive(Clone, Debug)]
pub struct Objective {
    /// The name of its column.
    pub name: String,
    /// The expression over the rows of a candidate.
    pub goal: Goal,
    /// The factor by which the number is minimised: 1, or -1 if it is maximised.
    pub sign: f64,
}

impl<M: Model> Study<M> {
    /// Reads a study file and the grid file that it names; `sets` override constants of the grid.
    ///
    /// # Errors
    /// Every mistake in both files, in one pass.
    pub fn load(path: &Path, sets: &[String]) -> Result<Self, Diagnostics> {
        let report = Report::default();
        let study = Self::read(path, sets, &report);
        report.finish(study)
    }

    fn read(path: &Path, sets: &[String], report: &Report) -> Option<Self> {
        let start_advice = "docs/optimise.md has one to start from";
        let (text, source) = syntax::read_text(path, "study", Some(start_advice), report)?;
        let table = parse_toml(&text, source, report);
        if refuse_other_kind::<M>("study", table.get_ref(), source, report) {
            return None;
        }
        let root =
            Section::new("the study file", Location::new(source, 0..0), table.get_ref(), report);
        let name = read_name(&root, path, None, "add `name = \"...\"`, or rename the file");
        let [_, grid_key, parameter, population, candidates, seed, objective, conditions] =
            STUDY_KEYS;
        let grid_file =
            root.require(root.text(grid_key), grid_key, "a grid file, relative to this file");
        let input = grid_file
            .map(|grid_file| GridInput::file(resolve_beside(path, grid_file.value), sets.to_vec()));
        let mut draft = input.and_then(|input| read_draft::<M>(&input, report));
        let grid_plan = draft.as_ref().map(|draft| draft.plan.clone());
        if let Some(draft) = &mut draft {
            convert_axes_to_ranges(&mut draft.plan);
        }
        let design = grid_plan.as_ref().and_then(|grid_plan| grid_plan.design.as_ref());
        let parameters = read_parameters(&root, root.tables(parameter), design, &mut draft);
        let population = root.whole_number(population, &(4..=MAX_CANDIDATES)).or_default(0);
        let candidates = root.whole_number(candidates, &(1..=MAX_CANDIDATES)).or_default(0);
        let seed = root.whole_number(seed, &(0..=MAX_SEED)).or_default(DEFAULT_SEED);
        // Populations of multiples of 8 fill the lanes of candidates with a single row.
        let default_population = (10 * parameters.len() as u64).next_multiple_of(8).max(32);
        let population = population.filter(|&count| count > 0).unwrap_or(default_population);
        let candidates =
            candidates.filter(|&count| count > 0).unwrap_or(DEFAULT_GENERATIONS * population);
        if let Some(draft) = &draft {
            plan_checks::check_steps(draft);
            M::check(draft);
        }
        let plan = draft.map(|draft| draft.plan);
        let axes = plan.as_ref().map_or(&[][..], |plan| &plan.axes);
        let axis_names: Vec<String> =
            axes.iter().map(|axis| axis.parameter.name.to_string()).collect();
        let known_columns =
            plan.as_ref().map_or_else(Vec::new, |plan| columns(&M::layout(plan).schema()));
        let rows_per_candidate = grid_plan.as_ref().map_or(1, Plan::points);
        if rows_per_candidate > MAX_ROWS {
            let title = format!("a grid of {rows_per_candidate} points for every candidate");
            report.refuse::<()>(root.location(), title, format!("expected at most {}", MAX_ROWS));
        }
        let goals = GoalReader {
            known_columns,
            is_plan_valid: report.is_clean(),
            rows_per_candidate,
            text: &text,
            report,
        };
        let objectives = read_objectives(&root, root.tables(objective), &goals, &axis_names);
        let conditions = root.texts(conditions).into_located();
        let conditions = conditions.into_iter().flat_map(|texts| texts.value);
        let conditions =
            conditions.filter_map(|text| goals.read(&text, Goal::constraint)).collect();
        root.finish();
        let mut plan = plan?;
        let grid_plan = grid_plan?;
        let seed = seed?;
        plan.name.clone_from(&name);
        let evolution = Evolution {
            parameter_count: parameters.len(),
            objective_count: objectives.len(),
            population_size: population,
            candidate_count: candidates,
            seed,
        };
        Some(Self { name, plan, grid: grid_plan, parameters, objectives, conditions, evolution })
    }

    /// Returns the number of responses of a candidate: objectives and constraint violations.
    pub fn evaluation_len(&self) -> usize {
        self.objectives.len() + self.conditions.len()
    }

    /// Returns the number of rows of a candidate.
    pub fn rows_per_candidate(&self) -> u64 {
        self.grid.points()
    }

    /// Returns the candidate's parameters at a position in the box of their bounds.
    pub fn parameter_values(&self, position: &[f64]) -> Vec<f64> {
        let values = self.parameters.iter().zip(position);
        values.map(|(parameter, &position)| parameter.bounds.interpolate(position)).collect()
    }

    /// Returns the values of the plan's axes in a row of a candidate.
    pub fn axis_values(&self, values: &[f64], row: u64) -> Vec<f64> {
        let mut row_values = self.grid.axis_values(row);
        let axis_count = row_values.len();
        let relative_deviation = |k: usize| {
            let position =
                self.grid.design.as_ref().and_then(|design| design.position(row, axis_count + k));
            2.0 * position.unwrap_or(0.5) - 1.0
        };
        let parameters = self.parameters.iter().zip(values).enumerate();
        let actual_parameters =
            parameters.map(|(k, (parameter, &value))| match parameter.tolerance {
                0.0 => value,
                tolerance => value * (1.0 + tolerance * relative_deviation(k)),
            });
        row_values.extend(actual_parameters);
        row_values
    }

    /// Returns the job of the store.
    pub fn job(&self) -> Job<'_> {
        let mut job = Job::new(&self.plan);
        job.layout.kind = FileKind::Optimise;
        job.plan["optimise"] = self.settings_json();
        job
    }

    /// Returns the study's settings beside the plan, as JSON.
    pub fn settings_json(&self) -> Value {
        let objective_json = |objective: &Objective| {
            let verb_key = if objective.sign > 0.0 { "minimise" } else { "maximise" };
            json!({ "name": objective.name, verb_key: objective.goal.text() })
        };
        let objectives = self.objectives.iter().map(objective_json);
        let tolerances = self.parameters.iter().map(|parameter| parameter.tolerance);
        json!({
            "grid": self.grid.to_json(),
            "objective": objectives.collect::<Value>(),
            "conditions": self.conditions.iter().map(Goal::text).collect::<Value>(),
            "tolerance": tolerances.collect::<Value>(),
            "population": self.evolution.population_size,
            "candidates": self.evolution.candidate_count,
            "seed": self.evolution.seed,
        })
    }
}

/// Makes every axis a range and drops the design, because rows of candidates lie anywhere in the
/// ranges.
fn convert_axes_to_ranges<M: Model>(plan: &mut Plan<M>) {
    for axis in &mut plan.axes {
        if let AxisValues::List(_) = axis.values {
            let [from, to] = axis.values.extremes();
            axis.values = AxisValues::Linear { from, to, count: if from < to { 2 } else { 1 } };
        }
    }
    plan.design = None;
}

/// Reads every `[[parameter]]` and adds an axis for each valid one.
fn read_parameters<M: Model>(
    root: &Section<'_>,
    sections: Vec<Section<'_>>,
    design: Option<&Design>,
    draft: &mut Option<Draft<'_, M>>,
) -> Vec<SearchedParameter> {
    let report = root.report;
    if sections.is_empty() || sections.len() as u64 > MAX_PARAMETERS {
        let title = format!("{} tables [[parameter]]", sections.len());
        let expectation =
            format!("expected from 1 to {}, each with name, from and to", MAX_PARAMETERS);
        report.push_missing(Diagnostic::new(title).at_location(root.location(), expectation));
    }
    let mut searched_parameters = Vec::new();
    for section in sections {
        let location = section.location().clone();
        let name = section.require(section.text("name"), "name", "the name of a parameter");
        let tolerance = section.number("tolerance", Range::NonNegative);
        let found_parameter =
            name.as_ref().zip(draft.as_ref()).and_then(|(name, draft)| find_parameter(name, draft));
        let range = found_parameter.as_ref().map_or(Range::Any, |parameter| parameter.range);
        section
            .mark_misplaced(&["count"], "the study has `candidates`, and finds the values itself");
        let parameter_bounds = read_range(section, range, Some(2));
        let spread_tolerance = match tolerance {
            Field::Present(tolerance_field) if tolerance_field.value >= 1.0 => {
                let title = "a tolerance of the whole value or more";
                report.refuse(
                    &tolerance_field.location,
                    title,
                    "expected a part of the value, as 0.05",
                )
            }
            Field::Present(tolerance_field)
                if draft.is_some() && !has_free_dimension(design, draft) =>
            {
                let title = "a tolerance without a design that spreads it";
                let expectation = format!(
                    "expected a [design] in the grid file, by \"sobol\" over at most {MAX_AXES} \
                     axes and parameters, \"latin_hypercube\" or \"monte_carlo\""
                );
                report.refuse(&tolerance_field.location, title, expectation)
            }
            Field::Present(tolerance_field) => Some(tolerance_field.value),
            _ => Some(0.0),
        };
        let (Some(name), Some(parameter), Some(parameter_bounds), Some(tolerance), Some(draft)) =
            (name, found_parameter, parameter_bounds, spread_tolerance, draft.as_mut())
        else {
            continue;
        };
        let shares_number = |other_parameter: &ModelParameter<M>| {
            other_parameter.number_names.iter().any(|name| parameter.number_names.contains(name))
        };
        let overriding_constant = draft
            .constants
            .iter()
            .find(|constant| constant.overrides_file && shares_number(&constant.parameter));
        let find_sweeping_axis = || {
            let mut axes = draft.plan.axes.iter().enumerate();
            let (k, axis) = axes.find(|(_, axis)| shares_number(&axis.parameter))?;
            let location = report.location(&format!("axis[{k}]"))?;
            Some(Located { value: axis.parameter.name.to_string(), location })
        };
        if let Some(first) =
            overriding_constant.map(|constant| constant.name.clone()).or_else(find_sweeping_axis)
        {
            report.push(written_twice_mistake(&name, &first));
            continue;
        }
        let mut axis = crate::plan::Axis {
            parameter,
            values: parameter_bounds.value.clone(),
            tolerance: None,
        };
        if let AxisValues::Linear { from, to, .. } | AxisValues::Log { from, to, .. } =
            &mut axis.values
        {
            let [low, high] = if from < to { [from, to] } else { [to, from] };
            *low -= tolerance * low.abs();
            *high += tolerance * high.abs();
        }
        add_axis(axis, location, draft);
        searched_parameters.push(SearchedParameter { bounds: parameter_bounds.value, tolerance });
    }
    searched_parameters
}

/// Returns whether a design has room for another axis.
fn has_free_dimension<M: Model>(design: Option<&Design>, draft: &Option<Draft<'_, M>>) -> bool {
    let axes = draft.as_ref().map_or(0, |draft| draft.plan.axes.len());
    match design {
        None | Some(Design::List { .. }) => false,
        Some(Design::Spread { rule: DesignRule::Sobol, .. }) => axes < MAX_AXES,
        Some(_) => true,
    }
}

/// Reads every `[[objective]]`. Their columns come after those of the parameters.
fn read_objectives(
    root: &Section<'_>,
    sections: Vec<Section<'_>>,
    goals: &GoalReader<'_>,
    parameters: &[String],
) -> Vec<Objective> {
    const OBJECTIVE_VERBS: [(&str, f64); 2] = [("minimise", 1.0), ("maximise", -1.0)];
    let mut objectives: Vec<Objective> = Vec::new();
    if sections.is_empty() {
        root.report_missing("objective", "[[objective]] with `minimise` or `maximise`");
    }
    for section in sections {
        let location = section.location().clone();
        let verb_texts =
            OBJECTIVE_VERBS.map(|(verb, sign)| (section.text(verb).into_located(), sign));
        section.finish();
        let [text] = &verb_texts
            .into_iter()
            .filter_map(|(text, sign)| Some((text?, sign)))
            .collect::<Vec<_>>()[..]
        else {
            let expectation = format!(
                "expected {}, and an expression",
                format_choices(&OBJECTIVE_VERBS.map(|(v, _)| v))
            );
            root.report.refuse::<()>(
                &location,
                "an objective without an expression, or with two",
                expectation,
            );
            continue;
        };
        let (text, sign) = text;
        let Some(goal) = goals.read(text, Goal::objective) else { continue };
        let is_same_objective =
            |one: &Objective| remove_spaces(one.goal.text()) == remove_spaces(text.value);
        if goal.is_by_row() && goals.rows_per_candidate > 1 {
            let title = format!(
                "a number for each row, and every candidate has {} rows",
                goals.rows_per_candidate
            );
            let expectation = "expected max(), min(), mean() or quantile() of it";
            root.report.refuse::<()>(&text.location, title, expectation);
        } else if objectives.iter().any(is_same_objective) {
            root.report.refuse::<()>(&text.location, "an objective twice", "expected each once");
        } else {
            let name = unique_name(&column_name(text.value), &objectives, parameters);
            objectives.push(Objective { name, goal, sign: *sign });
        }
    }
    objectives
}

/// Returns an expression without its spaces.
fn remove_spaces(text: &str) -> String {
    text.split_whitespace().collect()
}

/// Returns a column's name for an expression: its words, with operators spelled out.
fn column_name(text: &str) -> String {
    const OPERATOR_WORDS: [(&str, &str); 6] =
        [("+", "plus"), ("-", "minus"), ("*", "times"), ("/", "over"), ("<", "lt"), (">", "gt")];
    let mut spelled_out = text.to_owned();
    for (operator, word) in OPERATOR_WORDS {
        spelled_out = spelled_out.replace(operator, &format!(" {word} "));
    }
    let name_words = spelled_out.split(|c: char| !c.is_alphanumeric() && c != '_');
    name_words.filter(|word| !word.is_empty()).collect::<Vec<_>>().join("_")
}

/// Returns the first of `name`, `objective_name`, `objective_name_2`, ... that no other column of
/// a study has.
fn unique_name(name: &str, objectives: &[Objective], parameters: &[String]) -> String {
    let is_taken = |name: &str| {
        ["candidate", "generation", "feasible", "on_front"].contains(&name)
            || name.starts_with("excess_")
            || parameters.iter().any(|parameter| parameter == name)
            || objectives.iter().any(|objective| objective.name == name)
    };
    let numbered_names = (2..).map(|number| format!("objective_{name}_{number}"));
    let unnumbered_names = [name.to_owned(), format!("objective_{name}")];
    unnumbered_names
        .into_iter()
        .chain(numbered_names)
        .find(|name| !is_taken(name))
        .unwrap_or_default()
}

/// The context in which expressions are read.
struct GoalReader<'a> {
    /// The columns of rows; some may be missing while the plan has mistakes.
    known_columns: Vec<Column>,
    is_plan_valid: bool,
    rows_per_candidate: u64,
    text: &'a str,
    report: &'a Report,
}

impl GoalReader<'_> {
    fn read(
        &self,
        expression: &Located<&str>,
        read: fn(&str, &[Column]) -> Result<Goal, ExpressionError>,
    ) -> Option<Goal> {
        let mistake = match read(expression.value, &self.known_columns) {
            Ok(goal) => return Some(goal),
            Err(mistake) if mistake.candidates.is_some() && !self.is_plan_valid => return None,
            Err(mistake) => mistake,
        };
        // The location begins after the opening quote, unless escapes have moved the text.
        let start = expression.location.span.start + 1;
        let is_plain =
            self.text.get(start..).is_some_and(|rest| rest.starts_with(expression.value));
        let span = start + mistake.span.start..start + mistake.span.end;
        let location = Location::new(
            expression.location.source,
            if is_plain { span } else { expression.location.span.clone() },
        );
        self.report.push(Diagnostic::from_expression(mistake, &location));
        None
    }
}

#[cfg(test)]
mod tests {
    use super::column_name;

    #[test]
    fn column_names_spell_out_operators() {
        assert_eq!(column_name("max(a + b)"), "max_a_plus_b");
        assert_eq!(column_name("max(a - b)"), "max_a_minus_b");
        assert_eq!(column_name("a / b"), "a_over_b");
        assert_eq!(column_name("quantile(x, 0.95)"), "quantile_x_0_95");
    }
}
