//! Columns in memory: every row of a small file, the extremes of a long trace, or one row for each
//! cell of a map.

use std::path::Path;

use super::bucket::{Buckets, Decimator, KeptValues};
use super::error::Result;
use super::label::{self, Label};
use super::read::{ColumnFacts, FigureFile, FigureKind, ModelKinds};

/// Maximum number of values of a file that are kept for a figure. Basis: a page of some megabytes.
/// Doubling it doubles that page.
pub const MAX_VALUES: usize = 1_400_000;

/// The values of a column.
#[derive(Clone, Debug, PartialEq)]
pub enum ColumnValues {
    /// Numbers of any type; null is NaN.
    Numbers(Vec<f64>),
    /// Words in dictionary encoding.
    Words(Words),
}

/// A column of words in dictionary encoding, with few different words.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Words {
    /// The different words.
    pub names: Vec<String>,
    /// The code of each row: an index into `names`, [`NO_WORD`] or [`SEVERAL_WORDS`].
    pub codes: Vec<u8>,
    /// The code found last, tried first because neighbouring rows mostly share it.
    last_code: u8,
}

/// The code of a row without a word.
pub const NO_WORD: u8 = u8::MAX;
/// The code of a cell whose points have different words.
pub const SEVERAL_WORDS: u8 = u8::MAX - 1;

impl Words {
    /// Returns a column of rows without a word.
    pub fn without_words(rows: usize) -> Self {
        Self { codes: vec![NO_WORD; rows], ..Self::default() }
    }

    /// Returns the code of a word and adds new words to the dictionary. Words beyond the first 254
    /// have no code; the program writes no such file.
    pub fn code_for(&mut self, word: Option<&str>) -> u8 {
        let Some(word) = word else { return NO_WORD };
        if self.names.get(usize::from(self.last_code)).is_some_and(|name| name == word) {
            return self.last_code;
        }
        let index = self.names.iter().position(|name| name == word).unwrap_or(self.names.len());
        match u8::try_from(index) {
            Ok(index) if index < SEVERAL_WORDS => {
                if usize::from(index) == self.names.len() {
                    self.names.push(word.to_owned());
                }
                self.last_code = index;
                index
            }
            _ => NO_WORD,
        }
    }

    /// Returns the word of a row; `None` if it has none or several.
    pub fn get(&self, row: usize) -> Option<&str> {
        self.names.get(usize::from(*self.codes.get(row)?)).map(String::as_str)
    }

    /// Sorts the dictionary, so that it does not depend on the order of rows.
    pub fn sort(&mut self) {
        let mut sorted_names = self.names.clone();
        sorted_names.sort();
        let new_code = |name: &String| u8::try_from(sorted_names.binary_search(name).ok()?).ok();
        let new_codes: Vec<u8> =
            self.names.iter().map(|name| new_code(name).unwrap_or(NO_WORD)).collect();
        for code in &mut self.codes {
            *code = new_codes.get(usize::from(*code)).copied().unwrap_or(*code);
        }
        self.names = sorted_names;
    }
}

/// A column of a file with its values.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureColumn {
    /// The column's facts in the file's schema.
    pub facts: ColumnFacts,
    /// The value of each row.
    pub values: ColumnValues,
}

impl FigureColumn {
    /// Returns the label of the column: its name in words and its unit.
    pub fn label(&self) -> Label {
        Label::new(&label::name_in_words(&self.facts.name), self.facts.unit())
    }

    /// Returns the values if they are numbers.
    pub fn numbers(&self) -> Option<&[f64]> {
        let ColumnValues::Numbers(values) = &self.values else { return None };
        Some(values)
    }

    /// Returns the values if they are words.
    pub fn words(&self) -> Option<&Words> {
        let ColumnValues::Words(words) = &self.values else { return None };
        Some(words)
    }
}

/// The columns of a file that a figure needs.
#[derive(Debug)]
pub struct FigureTable {
    pub source: FigureFile,
    pub columns: Vec<FigureColumn>,
    /// The number of rows in memory.
    pub rows: usize,
    /// The maximum number of rows of the file in a bucket, if it was decimated.
    pub bucket_rows: Option<usize>,
}

impl FigureTable {
    /// Reads a file whose rows are not a map's. A trace with more values than a figure keeps is
    /// decimated, as [`FigureTable::read_decimated`] does.
    ///
    /// # Errors
    /// Returns the errors of [`FigureFile::each_row`]; [`crate::PlotError::Undrawable`] for other
    /// files with more values than a figure keeps.
    pub fn read(source: FigureFile) -> Result<Self> {
        let max_rows = MAX_VALUES / source.number_columns().count().max(1);
        if source.rows > max_rows {
            if source.kind == FigureKind::TRACE {
                return Self::read_decimated(source, max_rows / 2);
            }
            return Err(source.too_many_rows_error(source.rows, max_rows));
        }
        let column_names: Vec<&str> =
            source.columns.iter().map(|column| column.name.as_str()).collect();
        let empty_values = |column: &ColumnFacts| match column.is_number() {
            true => ColumnValues::Numbers(Vec::with_capacity(source.rows)),
            false => ColumnValues::Words(Words::default()),
        };
        let mut values: Vec<ColumnValues> = source.columns.iter().map(empty_values).collect();
        let mut rows = 0;
        source.each_row(&column_names, |row| {
            rows += 1;
            // The metadata may claim fewer rows than the file has.
            if rows > max_rows {
                return Err(source.too_many_rows_error(rows, max_rows));
            }
            for (column, values) in values.iter_mut().enumerate() {
                match values {
                    ColumnValues::Numbers(numbers) => numbers.push(row.number(column)),
                    ColumnValues::Words(words) => {
                        let code = words.code_for(row.word(column));
                        words.codes.push(code);
                    }
                }
            }
            Ok(())
        })?;
        let columns = source.columns.iter().zip(values);
        let columns =
            columns.map(|(facts, values)| FigureColumn { facts: facts.clone(), values }).collect();
        Ok(Self { source, columns, rows, bucket_rows: None })
    }

    /// Reads the numbers of a trace in at most `count` buckets. Each leaves two rows: the least and
    /// the greatest value of every column in the order in which they occur, at the first and the
    /// middle instant of the bucket.
    ///
    /// # Errors
    /// Returns the errors of [`FigureFile::each_row`].
    pub fn read_decimated(source: FigureFile, count: usize) -> Result<Self> {
        let buckets = Buckets::new(source.rows, count);
        let column_names: Vec<&str> =
            source.number_columns().map(|column| column.name.as_str()).collect();
        let kept_values =
            |name: &str| if name == "time_s" { KeptValues::Instants } else { KeptValues::Extremes };
        let mut decimators: Vec<Decimator> =
            column_names.iter().map(|name| Decimator::new(buckets, kept_values(name))).collect();
        source.each_row(&column_names, |row| {
            let decimators = decimators.iter_mut().enumerate();
            decimators.for_each(|(column, decimator)| decimator.push(row.number(column)));
            Ok(())
        })?;
        let columns_of_numbers =
            decimators.into_iter().map(|decimator| ColumnValues::Numbers(decimator.finish()));
        let columns = source.number_columns().cloned().zip(columns_of_numbers);
        let columns: Vec<FigureColumn> =
            columns.map(|(facts, values)| FigureColumn { facts, values }).collect();
        let rows = columns.first().and_then(FigureColumn::numbers).map_or(0, <[f64]>::len);
        Ok(Self { source, columns, rows, bucket_rows: Some(buckets.max_bucket_rows()) })
    }

    /// Opens a file and reads it by [`FigureTable::read`].
    ///
    /// # Errors
    /// Returns the errors of [`FigureFile::open`] and [`FigureTable::read`].
    pub fn open(path: &Path, model_kinds: ModelKinds) -> Result<Self> {
        Self::read(FigureFile::open(path, model_kinds)?)
    }

    /// Returns the column of this name.
    pub fn column(&self, name: &str) -> Option<&FigureColumn> {
        self.columns.iter().find(|column| column.facts.name == name)
    }

    /// Returns the numbers of a column that this kind of file must have.
    ///
    /// # Errors
    /// [`crate::PlotError::Undrawable`].
    pub fn numbers(&self, name: &str) -> Result<&[f64]> {
        let numbers = self.column(name).and_then(FigureColumn::numbers);
        numbers.ok_or_else(|| self.source.missing_column_error(name, "numeric"))
    }

    /// Returns the columns of numbers whose name starts with `prefix`, with the rest of the name.
    pub fn with_prefix(&self, prefix: &str) -> Vec<(&str, &FigureColumn)> {
        let numbers = self.columns.iter().filter(|column| column.numbers().is_some());
        numbers
            .filter_map(|column| Some((column.facts.name.strip_prefix(prefix)?, column)))
            .collect()
    }
}
