//! Columns in memory, as figures take them: every row of a small file, the extremes of stretches of
//! a long trace, or one row per cell of a map.

use std::path::Path;

use super::error::Result;
use super::label::{self, Label};
use super::read::{ColumnFacts, Kind, Known, Source};
use super::thin::{Keep, Stretches, Thinner};

/// Most numbers of a file that are kept for a figure: what a page of some megabytes carries.
pub const MOST_NUMBERS: usize = 1_400_000;

/// The values of a column.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Any numeric type; null is NaN.
    Numbers(Vec<f64>),
    /// Words, by their numbers.
    Words(Words),
}

/// Words among which few are different.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Words {
    /// The words that occur.
    pub names: Vec<String>,
    /// One per row: a place among the names, [`NONE`] or [`SEVERAL`].
    pub codes: Vec<u8>,
    /// The name found last: neighbours mostly share theirs.
    last: u8,
}

/// Code of a row without a word.
pub const NONE: u8 = u8::MAX;
/// Code of a cell whose points have different words.
pub const SEVERAL: u8 = u8::MAX - 1;

impl Words {
    /// Rows without a word.
    pub fn none(rows: usize) -> Self {
        Self { codes: vec![NONE; rows], ..Self::default() }
    }

    /// The code of a word, which is taken up if it is new. Words past the first 254 could only come
    /// from a file that is not ours, and have no code.
    pub fn code(&mut self, word: Option<&str>) -> u8 {
        let Some(word) = word else { return NONE };
        if self.names.get(usize::from(self.last)).is_some_and(|name| name == word) {
            return self.last;
        }
        let place = self.names.iter().position(|name| name == word).unwrap_or(self.names.len());
        match u8::try_from(place) {
            Ok(place) if place < SEVERAL => {
                if usize::from(place) == self.names.len() {
                    self.names.push(word.to_owned());
                }
                self.last = place;
                place
            }
            _ => NONE,
        }
    }

    /// The word of a row; none where it has none or several.
    pub fn get(&self, row: usize) -> Option<&str> {
        self.names.get(usize::from(*self.codes.get(row)?)).map(String::as_str)
    }

    /// Puts the names in order of the alphabet, whatever order the rows came in.
    pub fn sort(&mut self) {
        let mut sorted = self.names.clone();
        sorted.sort();
        let place = |name: &String| u8::try_from(sorted.binary_search(name).ok()?).ok();
        let places: Vec<u8> = self.names.iter().map(|name| place(name).unwrap_or(NONE)).collect();
        for code in &mut self.codes {
            *code = places.get(usize::from(*code)).copied().unwrap_or(*code);
        }
        self.names = sorted;
    }
}

/// A column.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// What the file says of it.
    pub facts: ColumnFacts,
    /// One per row.
    pub values: Values,
}

impl Column {
    /// Its name in words, and its unit.
    pub fn label(&self) -> Label {
        Label::new(&label::words(&self.facts.name), &self.facts.unit)
    }

    /// The values, if they are numbers.
    pub fn numbers(&self) -> Option<&[f64]> {
        let Values::Numbers(values) = &self.values else { return None };
        Some(values)
    }

    /// The values, if they are words.
    pub fn words(&self) -> Option<&Words> {
        let Values::Words(words) = &self.values else { return None };
        Some(words)
    }
}

/// The columns of a file that a figure needs.
#[derive(Debug)]
pub struct Table {
    /// The file.
    pub source: Source,
    /// In file order.
    pub columns: Vec<Column>,
    /// Number of rows here.
    pub rows: usize,
    /// Rows of the file that became two rows here, where it was thinned.
    pub stretch: Option<usize>,
}

impl Table {
    /// Reads a file whose rows are not a map's. A trace with more numbers than a figure keeps is
    /// cut into stretches, as [`Table::read_thinned`] does.
    ///
    /// # Errors
    /// As [`Source::each_row`]; [`crate::PlotError::Undrawable`] for modes and boundaries beyond
    /// what a figure keeps.
    pub fn read(source: Source) -> Result<Self> {
        let most = MOST_NUMBERS / source.numeric().count().max(1);
        if source.rows > most {
            if source.kind == Kind::TRACE {
                return Self::read_thinned(source, most / 2);
            }
            return Err(source.too_many(source.rows, most));
        }
        let names: Vec<&str> = source.columns.iter().map(|column| column.name.as_str()).collect();
        let empty = |column: &ColumnFacts| match column.is_number() {
            true => Values::Numbers(Vec::with_capacity(source.rows)),
            false => Values::Words(Words::default()),
        };
        let mut values: Vec<Values> = source.columns.iter().map(empty).collect();
        let mut rows = 0;
        source.each_row(&names, |row| {
            rows += 1;
            // What the file says of its rows need not be so.
            if rows > most {
                return Err(source.too_many(rows, most));
            }
            for (column, values) in values.iter_mut().enumerate() {
                match values {
                    Values::Numbers(numbers) => numbers.push(row.number(column)),
                    Values::Words(words) => {
                        let code = words.code(row.word(column));
                        words.codes.push(code);
                    }
                }
            }
            Ok(())
        })?;
        let columns = source.columns.iter().zip(values);
        let columns =
            columns.map(|(facts, values)| Column { facts: facts.clone(), values }).collect();
        Ok(Self { source, columns, rows, stretch: None })
    }

    /// Reads the numbers of a trace in at most `count` stretches. Each leaves two rows: the least
    /// and the greatest value of every column, in the order in which they occur, at the stretch's
    /// first and middle instant.
    ///
    /// # Errors
    /// As [`Source::each_row`].
    pub fn read_thinned(source: Source, count: usize) -> Result<Self> {
        let stretches = Stretches::new(source.rows, count);
        let names: Vec<&str> = source.numeric().map(|column| column.name.as_str()).collect();
        let keep = |name: &str| if name == "time_s" { Keep::Instants } else { Keep::Extremes };
        let mut thinners: Vec<Thinner> =
            names.iter().map(|name| Thinner::new(stretches, keep(name))).collect();
        source.each_row(&names, |row| {
            let thinners = thinners.iter_mut().enumerate();
            thinners.for_each(|(column, thinner)| thinner.push(row.number(column)));
            Ok(())
        })?;
        let kept = thinners.into_iter().map(|thinner| Values::Numbers(thinner.finish()));
        let columns = source.numeric().cloned().zip(kept);
        let columns: Vec<Column> =
            columns.map(|(facts, values)| Column { facts, values }).collect();
        let rows = columns.first().and_then(Column::numbers).map_or(0, <[f64]>::len);
        Ok(Self { source, columns, rows, stretch: Some(stretches.longest()) })
    }

    /// Opens a file and reads it, as [`Table::read`].
    ///
    /// # Errors
    /// As [`Source::open`] and [`Table::read`].
    pub fn open(path: &Path, known: Known) -> Result<Self> {
        Self::read(Source::open(path, known)?)
    }

    /// The column of that name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.facts.name == name)
    }

    /// The numbers of a column that this kind of file must have.
    ///
    /// # Errors
    /// [`crate::PlotError::Undrawable`].
    pub fn numbers(&self, name: &str) -> Result<&[f64]> {
        let numbers = self.column(name).and_then(Column::numbers);
        numbers.ok_or_else(|| self.source.lacks(name, "numeric"))
    }

    /// Columns of numbers whose name starts with `prefix`, without it.
    pub fn with_prefix(&self, prefix: &str) -> Vec<(&str, &Column)> {
        let numbers = self.columns.iter().filter(|column| column.numbers().is_some());
        numbers
            .filter_map(|column| Some((column.facts.name.strip_prefix(prefix)?, column)))
            .collect()
    }
}
