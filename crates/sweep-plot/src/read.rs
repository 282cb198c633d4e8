//! One of this program's Parquet files, open: what it says of itself, and its rows, batch by batch.
//!
//! This is the one place that reads files. A map of ten million rows is read in several passes over
//! the columns that a figure needs, and is never in memory whole.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use arrow_schema::Schema;
use serde_json::Value;

use super::error::{PlotError, Result};
use super::label;
use sweep_files::{self as files, ParquetFile};

/// A column without its rows, which [`super::table::Column`] has.
pub use sweep_files::Column as ColumnFacts;
use sweep_parameter::Worse;

/// What a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kind {
    /// As in "a map file".
    pub name: &'static str,
    /// The columns that show it. Where it has axes, they stand before the first of these.
    pub columns: &'static [&'static str],
    /// And one that begins with one of these, if there are any.
    pub begins: &'static [&'static str],
    /// Whether its rows are of points, which `--at` picks.
    pub has_points: bool,
}

impl Kind {
    /// One row per grid point.
    pub const MAP: Self = Self::of("map", &["status", "ratio_max"]).with_points();
    /// A map whose points are scattered.
    pub const DESIGN: Self = Self { name: "design", has_points: false, ..Self::MAP };
    /// One row per grid point that two maps share.
    pub const DIFFERENCES: Self = Self::of("differences", &["ratio_change", "flip"]).with_points();
    /// Candidates of a study.
    pub const STUDY: Self = Self::of("study", &["candidate", "on_front"]);
    /// Time histories of both models at one point, or of a measurement and the model fitted to it.
    pub const TRACE: Self =
        Self { begins: &["nonlinear_", "measured_"], ..Self::of("trace", &["time_s"]) };
    /// The curve on which a quantity is at its limit: it has a bracket instead of columns.
    pub const BOUNDARY: Self = Self::of("boundary", &[]);

    /// A kind that these columns show.
    pub const fn of(name: &'static str, columns: &'static [&'static str]) -> Self {
        Self { name, columns, begins: &[], has_points: false }
    }

    /// A kind whose rows are of points.
    pub const fn with_points(self) -> Self {
        Self { has_points: true, ..self }
    }

    fn is_shown_by(&self, names: &[&str]) -> bool {
        let begins = |name: &&str| self.begins.iter().any(|begin| name.starts_with(begin));
        self.columns.iter().all(|name| names.contains(name))
            && (self.begins.is_empty() || names.iter().any(begins))
            && (!self.columns.is_empty() || bracket(names).is_some())
    }
}

/// What a model's files have beside those of every model.
#[derive(Clone, Copy, Debug, Default)]
pub struct Known {
    /// Kinds of files, the surest first.
    pub kinds: &'static [Kind],
    /// Sections of a plan that histories follow from.
    pub of_runs: &'static [&'static str],
    /// Those that hold at any speed.
    pub of_machine: &'static [&'static str],
}

impl Known {
    /// All kinds, the surest first. A design has a map's columns.
    pub fn all_kinds(self) -> impl Iterator<Item = Kind> {
        let own = self.kinds.iter().copied();
        let last = [Kind::MAP, Kind::DIFFERENCES, Kind::TRACE, Kind::BOUNDARY];
        std::iter::once(Kind::STUDY).chain(own).chain(last)
    }
}

/// A file whose columns are those of a figure.
#[derive(Debug)]
pub struct Source {
    /// Where it is.
    pub path: PathBuf,
    /// What it holds.
    pub kind: Kind,
    /// In file order, without those of types that none of our files has.
    pub columns: Vec<ColumnFacts>,
    /// The file-level key-value metadata, parsed where it is JSON; in file order.
    pub provenance: Vec<(String, Value)>,
    /// Number of rows.
    pub rows: usize,
    /// What the model's files have.
    pub known: Known,
    /// Name of the run with what its command line set, if the file says them.
    pub run_name: Option<String>,
    file: ParquetFile,
}

/// Key under which Arrow keeps its own copy of the schema: no provenance.
const ARROW_SCHEMA: &str = "ARROW:schema";

impl Source {
    /// Opens a file and reads what it says of itself.
    ///
    /// # Errors
    /// [`PlotError::File`], or [`PlotError::Undrawable`] when the columns are not those of a file
    /// of ours.
    pub fn open(path: &Path, known: Known) -> Result<Self> {
        let file = ParquetFile::open(path)?;
        let rows = usize::try_from(file.rows()).unwrap_or(usize::MAX);
        let provenance = file.pairs().filter(|entry| entry.key != ARROW_SCHEMA).map(|entry| {
            let text = entry.value.clone().unwrap_or_default();
            (entry.key.clone(), serde_json::from_str(&text).unwrap_or(Value::String(text)))
        });
        let provenance: Vec<(String, Value)> = provenance.collect();
        let columns = files::columns(file.schema()).into_iter();
        let columns: Vec<ColumnFacts> =
            columns.map(|column| by_name(column, file.schema())).collect();
        let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
        let kind = known.all_kinds().find(|kind| kind.is_shown_by(&names));
        let kind = kind.ok_or_else(|| PlotError::Undrawable {
            path: path.to_owned(),
            reason: format!(
                "its columns ({}) are those of no file that has a figure: {}",
                names.join(", "),
                known.all_kinds().map(|kind| kind.name).collect::<Vec<_>>().join(", ")
            ),
        })?;
        let run_name = run_name(&provenance);
        Ok(Self { path: path.to_owned(), kind, columns, provenance, rows, known, run_name, file })
    }

    /// Calls `take` for each row, with the columns of these names. One that the file lacks is null.
    ///
    /// # Errors
    /// [`PlotError::File`], and whatever `take` says.
    pub fn each_row(
        &self,
        names: &[&str],
        mut take: impl FnMut(Row<'_>) -> Result<()>,
    ) -> Result<()> {
        self.file.each_row(names, |row| take(Row(row)))
    }

    /// The column of that name.
    pub fn column(&self, name: &str) -> Option<&ColumnFacts> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// Columns of numbers whose name starts with `prefix`, without it.
    pub fn with_prefix(&self, prefix: &str) -> Vec<(&str, &ColumnFacts)> {
        self.numeric()
            .filter_map(|column| Some((column.name.strip_prefix(prefix)?, column)))
            .collect()
    }

    /// Columns of numbers.
    pub fn numeric(&self) -> impl Iterator<Item = &ColumnFacts> {
        self.columns.iter().filter(|column| column.is_number())
    }

    /// The error that something the options name is not there, and what is.
    pub fn not_there(
        &self,
        option: &str,
        given: impl fmt::Display,
        what: &str,
        known: impl fmt::Display,
    ) -> PlotError {
        let path = self.path.display();
        let given = given.to_string();
        let known = known.to_string();
        let valid = known.split(", ").map(str::to_owned).collect();
        let refusal =
            format!("`{option} {given}`: {path}: there is no such {what}; it has {known}");
        PlotError::NotThere { refusal, given, valid }
    }

    fn undrawable(&self, reason: String) -> PlotError {
        PlotError::Undrawable { path: self.path.clone(), reason }
    }

    /// Nothing in it can be drawn.
    pub fn empty(&self, reason: &str) -> PlotError {
        self.undrawable(format!("nothing to draw: {reason}"))
    }

    /// More rows than a figure of its kind shows.
    pub fn too_many(&self, rows: usize, most: usize) -> PlotError {
        let kind = self.kind.name;
        self.undrawable(format!(
            "a {kind} file of {rows} rows is more than a figure can show, which is {most} of them"
        ))
    }

    /// Refuses an option that was given and would have no effect on this file; `fits` says whether
    /// it has one, and `for_what` on what.
    ///
    /// # Errors
    /// [`PlotError::Unfit`].
    pub fn refuse(&self, option: &str, given: bool, fits: bool, for_what: &str) -> Result<()> {
        if !given || fits {
            return Ok(());
        }
        let (kind, path) = (self.kind.name, self.path.display());
        Err(PlotError::Unfit(format!("`{option}` is for {for_what}; {path} is a {kind} file")))
    }

    /// Refuses a file of another kind than an option takes.
    ///
    /// # Errors
    /// [`PlotError::Unfit`], which says what writes such a file.
    pub fn expect(&self, kind: Kind, option: &str, hint: &str) -> Result<()> {
        if self.kind == kind {
            return Ok(());
        }
        let (path, own) = (self.path.display(), self.kind.name);
        Err(PlotError::Unfit(format!("`{option} {path}`: this is a {own} file; {hint}")))
    }

    /// A column that this kind of file must have is missing.
    pub fn lacks(&self, column: &str, expected: &str) -> PlotError {
        let kind = self.kind.name;
        self.undrawable(format!("a {kind} file needs the {expected} column `{column}`"))
    }

    /// The first value stored under `key` in the provenance, outer levels before inner ones.
    pub fn find(&self, key: &str) -> Option<&Value> {
        find_in(&self.provenance, key)
    }

    /// The run's name, if the file says it, and these notes.
    pub fn notes(&self, further: impl IntoIterator<Item = String>) -> Vec<String> {
        self.run_name.iter().cloned().chain(further).collect()
    }

    /// The run's name, if the file says it, and `rest` as a figure's subtitle.
    pub fn subtitle(&self, rest: &str) -> String {
        self.notes([rest.to_owned()]).join(" · ")
    }

    /// What its ratios compare, by the run's criterion.
    pub fn compared(&self) -> &'static str {
        match self.find("criterion").and_then(Value::as_str) {
            Some("envelope") => "amplitudes by turn",
            Some("rms") => "root mean squares",
            _ => "amplitudes",
        }
    }

    /// How the points were placed, of a file whose points are no grid by its plan.
    pub fn design_method(&self) -> Option<&str> {
        self.find("design")?.get("method")?.as_str()
    }

    /// The entries of a list that the provenance has under `key`.
    pub fn list(&self, key: &str) -> impl Iterator<Item = &Value> {
        self.find(key).and_then(Value::as_array).into_iter().flatten()
    }

    /// The swept parameters that the plan names.
    pub fn planned_axes(&self) -> impl Iterator<Item = &str> {
        self.list("axis").filter_map(|axis| axis.get("parameter")?.as_str())
    }

    /// Whether the plan spreads an axis by the logarithm.
    pub fn is_log(&self, parameter: &str) -> bool {
        self.list("axis").filter(|axis| axis["parameter"] == parameter).any(|axis| {
            axis["range"]["spacing"] == "log" || axis["distribution"]["kind"] == "lognormal"
        })
    }

    /// Up to where a column is good, in its unit: its own limit, or the run's of ratios. Two files
    /// may have two.
    pub fn limit(&self, column: &ColumnFacts) -> Option<f64> {
        let is_of_run = is_ratio(column) && self.kind != Kind::DIFFERENCES;
        column.limit.or_else(|| is_of_run.then(|| self.ratio_limit()))
    }

    /// The ratio from which on a point is unreliable: the run's limit, or else the paper's, 2.
    pub fn ratio_limit(&self) -> f64 {
        let limit = self.find("ratio_limit").and_then(Value::as_f64).map(drawable);
        limit.filter(|limit| *limit > 0.0).unwrap_or(2.0)
    }
}

/// Whether a column's numbers are ratios of both models.
pub fn is_ratio(column: &ColumnFacts) -> bool {
    column.name.starts_with("ratio_") && column.name != "ratio_change"
}

/// The names of what there is.
pub fn some_of<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// A row of a file.
#[derive(Clone, Copy)]
pub struct Row<'a>(sweep_files::Row<'a>);

impl<'a> Row<'a> {
    /// Its number in the file.
    pub fn index(self) -> usize {
        self.0.index() as usize
    }

    /// The number in a column as it is drawn, NaN where there is none.
    pub fn number(self, column: usize) -> f64 {
        drawable(self.0.value(column))
    }

    /// The numbers in these columns.
    pub fn numbers(self, columns: Range<usize>) -> Vec<f64> {
        columns.map(|column| self.number(column)).collect()
    }

    /// The word in a column.
    pub fn word(self, column: usize) -> Option<&'a str> {
        self.0.word(column)
    }
}

/// Numbers beyond these are drawn as these, and smaller ones as 0: what a figure makes of them,
/// such as borders halfway on a logarithmic axis, shall neither overflow nor vanish.
const GREATEST: f64 = 1e100;
const LEAST: f64 = 1e-100;

fn drawable(value: f64) -> f64 {
    if value.is_infinite() {
        value
    } else if value.abs() < LEAST {
        0.0
    } else {
        value.clamp(-GREATEST, GREATEST)
    }
}

fn find_in<'a>(provenance: &'a [(String, Value)], key: &str) -> Option<&'a Value> {
    provenance
        .iter()
        .find_map(|(name, value)| if name == key { Some(value) } else { find(value, key) })
}

/// More letters of a name would leave no room for what was set.
const NAME_LETTERS: usize = 40;

/// As in "fig12, mass_kg = 20".
fn run_name(provenance: &[(String, Value)]) -> Option<String> {
    let name = find_in(provenance, "name")?.as_str()?;
    let mut named: String = name.chars().take(NAME_LETTERS).collect();
    if named.len() < name.len() {
        named.push('…');
    }
    let sets = find_in(provenance, "set").and_then(Value::as_object);
    for (name, value) in sets.into_iter().flatten() {
        let value = match value {
            Value::String(text) => text.clone(),
            Value::Number(number) => {
                number.as_f64().map_or(number.to_string(), |value| label::significant(value, 6))
            }
            other => other.to_string(),
        };
        named.push_str(&format!(", {name} = {value}"));
    }
    Some(named)
}

fn find<'a>(value: &'a Value, key: &str) -> Option<&'a Value> {
    match value {
        Value::Object(map) => {
            map.get(key).or_else(|| map.values().find_map(|inner| find(inner, key)))
        }
        Value::Array(items) => items.iter().find_map(|inner| find(inner, key)),
        _ => None,
    }
}

/// The two columns between which a boundary is known to lie, after its two coordinates.
pub fn bracket<'a>(names: &[&'a str]) -> Option<(&'a str, &'a str)> {
    let with_word = |words: &[&str]| {
        names.iter().skip(2).copied().find(|name| name.split('_').any(|part| words.contains(&part)))
    };
    Some((with_word(&["low", "lower", "min"])?, with_word(&["high", "upper", "max"])?))
}

/// A file that went through another program has its columns' names alone, which say something too.
fn by_name(column: ColumnFacts, schema: &Schema) -> ColumnFacts {
    let unit = schema.field(column.field).metadata().get("unit");
    let unit = match unit.is_none_or(String::is_empty) {
        true => label::unit_of_name(&column.name),
        false => column.unit,
    };
    let less = column.name.starts_with("min_").then_some(Worse::Less);
    ColumnFacts { unit, worse: column.worse.or(less), ..column }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_drawn_as_far_as_figures_can_take_them() {
        for value in [0.0, -350.0, 1e-99, 9e99] {
            assert_eq!(drawable(value).to_bits(), value.to_bits());
        }
        assert_eq!(drawable(5e-324), 0.0);
        assert_eq!(drawable(-1e300), -GREATEST);
        assert_eq!(drawable(f64::INFINITY), f64::INFINITY, "it is left out, as it was");
        assert!(drawable(f64::NAN).is_nan());
    }
}
