//! Conditions over the columns of a result, with the three truth values of SQL: a comparison with a
//! missing value is neither true nor false.

use std::cmp::Ordering;
use std::ops::Range;

use crate::error::Result;
use sweep_files::{Cell, ResultTable, Row};

/// A mistake in the text of a condition.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// What is wrong, in a sentence.
    pub title: String,
    /// Where, in bytes of the text.
    pub span: Range<usize>,
    /// What should stand there.
    pub expected: String,
    /// A word as typed, and the names that could have been meant.
    pub candidates: Option<(String, Vec<String>)>,
}

/// Which orders of two values keep a comparison.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Comparison(pub(crate) fn(Ordering) -> bool);

/// How all rows become one number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fold {
    /// Rows for which a condition is true.
    Count,
    /// Rows for which a condition is true, as a part of those for which it is true or false.
    Share,
    Least,
    Greatest,
    Mean,
    /// The number below which this part of the rows lies, between neighbours by a straight line.
    Quantile(f64),
}

/// A node of an expression; the parser has made sure of the types.
#[derive(Clone, Debug)]
pub(crate) enum Node {
    Literal(Cell),
    /// A place among the condition's columns.
    Column(usize),
    /// A place among the condition's folds.
    Folded(usize),
    /// One number as another.
    Changed(fn(f64) -> f64, Box<Node>),
    Not(Box<Node>),
    And(Box<Node>, Box<Node>),
    Or(Box<Node>, Box<Node>),
    IsNull(Box<Node>),
    Compare(Comparison, Box<Node>, Box<Node>),
    /// Two numbers as one.
    Calculate(fn(f64, f64) -> f64, Box<Node>, Box<Node>),
}

/// An expression that is true or false: of every row, or of a file as a whole.
#[derive(Clone, Debug)]
pub struct Condition {
    /// As typed.
    pub text: String,
    /// Names of the columns that it reads.
    pub columns: Vec<String>,
    pub(crate) root: Node,
    pub(crate) folds: Vec<(Fold, Node)>,
    /// Whether it speaks of single rows, not of the folds alone.
    pub(crate) by_row: bool,
}

impl Condition {
    /// The columns that it reads.
    pub(crate) fn names(&self) -> Vec<&str> {
        self.columns.iter().map(String::as_str).collect()
    }

    /// Whether it has functions over all rows.
    pub const fn has_folds(&self) -> bool {
        !self.folds.is_empty()
    }
}

/// What a node is evaluated on.
pub(crate) struct Context<'a> {
    pub(crate) row: Row<'a>,
    /// Where the columns of the expression begin among the row's.
    pub(crate) first: usize,
    pub(crate) folded: &'a [Cell],
}

impl Node {
    pub(crate) fn value(&self, at: &Context<'_>) -> Cell {
        match self {
            Self::Literal(cell) => cell.clone(),
            Self::Column(column) => match at.row.cell(at.first + *column) {
                // Other writers store NaN where a value is missing.
                Cell::Number(value) => number(Some(value)),
                cell => cell,
            },
            Self::Folded(fold) => at.folded.get(*fold).cloned().unwrap_or(Cell::Null),
            Self::Changed(change, node) => number(node.number(at).map(change)),
            Self::Calculate(operation, left, right) => {
                let both = left.number(at).zip(right.number(at));
                number(both.map(|(left, right)| operation(left, right)))
            }
            Self::Not(_) | Self::And(..) | Self::Or(..) | Self::IsNull(_) | Self::Compare(..) => {
                self.truth(at).map_or(Cell::Null, Cell::Flag)
            }
        }
    }

    fn number(&self, at: &Context<'_>) -> Option<f64> {
        self.value(at).number()
    }

    /// True, false, or neither.
    pub(crate) fn truth(&self, at: &Context<'_>) -> Option<bool> {
        match self {
            Self::Not(node) => node.truth(at).map(|truth| !truth),
            Self::And(left, right) => joined([left.truth(at), right.truth(at)], true),
            Self::Or(left, right) => joined([left.truth(at), right.truth(at)], false),
            Self::IsNull(node) => Some(node.value(at) == Cell::Null),
            Self::Compare(comparison, left, right) => {
                comparison.of(&left.value(at), &right.value(at))
            }
            other => other.value(at).flag(),
        }
    }
}

/// What two parts make together: `common` if both are so, and its opposite as soon as one is.
fn joined(parts: [Option<bool>; 2], common: bool) -> Option<bool> {
    if parts.contains(&Some(!common)) {
        return Some(!common);
    }
    parts[0].and(parts[1])
}

/// A result that is no number has no value.
fn number(number: Option<f64>) -> Cell {
    number.filter(|number| !number.is_nan()).map_or(Cell::Null, Cell::Number)
}

impl Comparison {
    /// How far two numbers are from keeping it; 0 where they do.
    pub(crate) fn excess(self, left: f64, right: f64) -> f64 {
        match [Ordering::Less, Ordering::Greater].map(self.0) {
            [true, true] => 1.0,
            [true, false] => (left - right).max(0.0),
            [false, true] => (right - left).max(0.0),
            [false, false] => (left - right).abs(),
        }
    }

    fn of(self, left: &Cell, right: &Cell) -> Option<bool> {
        let order = match (left, right) {
            (Cell::Number(left), Cell::Number(right)) => left.partial_cmp(right)?,
            (Cell::Text(left), Cell::Text(right)) => left.cmp(right),
            (Cell::Flag(left), Cell::Flag(right)) => left.cmp(right),
            _ => return None,
        };
        Some((self.0)(order))
    }
}

/// What rows are folded into.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Folded {
    /// The function over the rows that have a value.
    pub(crate) value: Cell,
    /// How many rows have one.
    pub(crate) over: u64,
    /// Whether those are all rows.
    pub(crate) whole: bool,
}

/// The number that rows are folded into, on its way.
#[derive(Clone, Debug, Default)]
pub(crate) struct Folding {
    rows: u64,
    over: u64,
    /// Where conditions are counted, how many are true.
    sum: f64,
    least: Option<f64>,
    greatest: Option<f64>,
    /// All numbers, kept for a quantile alone.
    numbers: Vec<f64>,
}

impl Condition {
    /// Folds all rows that `keep` takes.
    ///
    /// # Errors
    /// [`crate::ResultsError::File`].
    pub(crate) fn fold(
        &self,
        table: &ResultTable,
        keep: Option<&Condition>,
    ) -> Result<Vec<Folded>> {
        if self.folds.is_empty() {
            return Ok(Vec::new());
        }
        let mut foldings = vec![Folding::default(); self.folds.len()];
        each_row(table, &self.names(), keep, |at| {
            for ((fold, node), folding) in self.folds.iter().zip(&mut foldings) {
                folding.add(*fold, node, at);
            }
            Ok(())
        })?;
        let folds = self.folds.iter().zip(foldings);
        Ok(folds.map(|((fold, _), folding)| folding.finish(*fold)).collect())
    }
}

impl Folding {
    pub(crate) fn add(&mut self, fold: Fold, node: &Node, at: &Context<'_>) {
        self.rows += 1;
        let number = match fold {
            Fold::Count | Fold::Share => node.truth(at).map(|truth| f64::from(u8::from(truth))),
            _ => node.number(at),
        };
        let Some(number) = number else { return };
        self.over += 1;
        self.sum += number;
        self.least = Some(self.least.map_or(number, |least| least.min(number)));
        self.greatest = Some(self.greatest.map_or(number, |greatest| greatest.max(number)));
        if let Fold::Quantile(_) = fold {
            self.numbers.push(number);
        }
    }

    pub(crate) fn finish(self, fold: Fold) -> Folded {
        let value = match fold {
            Fold::Count => Some(self.sum),
            Fold::Share | Fold::Mean => Some(self.sum / self.over as f64),
            Fold::Least => self.least,
            Fold::Greatest => self.greatest,
            Fold::Quantile(part) => quantile(self.numbers, part),
        };
        Folded { value: number(value), over: self.over, whole: self.over == self.rows }
    }
}

/// The quantile of numbers, as NumPy's by default.
fn quantile(mut numbers: Vec<f64>, part: f64) -> Option<f64> {
    numbers.sort_by(f64::total_cmp);
    let place = part * numbers.len().checked_sub(1)? as f64;
    let (below, above) = (numbers[place.floor() as usize], numbers[place.ceil() as usize]);
    Some(below + (above - below) * place.fract())
}

/// Calls `work` for each row that `keep` takes, with the columns of these names.
///
/// # Errors
/// [`crate::ResultsError::File`], and whatever `work` says.
pub(crate) fn each_row(
    table: &ResultTable,
    names: &[&str],
    keep: Option<&Condition>,
    mut work: impl FnMut(&Context<'_>) -> Result<()>,
) -> Result<()> {
    let first = names.len();
    let names = [names, &keep.map_or_else(Vec::new, Condition::names)].concat();
    table.file().each_row(&names, |row| {
        let at = |first| Context { row, first, folded: &[] };
        match keep.is_none_or(|keep| keep.root.truth(&at(first)) == Some(true)) {
            true => work(&at(0)),
            false => Ok(()),
        }
    })
}
