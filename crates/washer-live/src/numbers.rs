//! Converts structures to arrays of numbers and back. A single walk over the fields serves both
//! directions.

/// Upper bound of counts and indices; greater ones are rejected. Basis: far above those of any
/// setup. Without a bound a damaged page could request a large amount of memory. Doubling it
/// doubles that memory.
const COUNT_LIMIT: usize = 100_000;

/// A traversal of a structure's fields. Each step writes a number or reads the next one, and
/// returns `None` if the number is missing or invalid.
pub(crate) enum NumberWalk<'a> {
    /// The numbers written so far.
    Write(Vec<f64>),
    /// The numbers not read yet.
    Read(&'a [f64]),
}

impl NumberWalk<'_> {
    pub(crate) const fn is_reading(&self) -> bool {
        matches!(self, Self::Read(_))
    }

    pub(crate) fn walk_numbers<const N: usize>(&mut self, values: [&mut f64; N]) -> Option<()> {
        for value in values {
            match self {
                Self::Write(numbers) => numbers.push(*value),
                Self::Read(remaining) => {
                    let (first, rest) = remaining.split_first()?;
                    (*value, *remaining) = (*first, rest);
                }
            }
        }
        Some(())
    }

    /// Writes or reads a number that may be missing, as NaN.
    pub(crate) fn walk_optional(&mut self, value: &mut Option<f64>) -> Option<()> {
        let mut number = value.unwrap_or(f64::NAN);
        self.walk_numbers([&mut number])?;
        *value = (!number.is_nan()).then_some(number);
        Some(())
    }

    /// Writes `count` and returns it, or reads and returns another count.
    pub(crate) fn walk_count(&mut self, count: usize) -> Option<usize> {
        let mut value = count as f64;
        self.walk_numbers([&mut value])?;
        let is_count = value >= 0.0 && value < COUNT_LIMIT as f64 && value == value.trunc();
        is_count.then_some(value as usize)
    }

    /// Writes or reads an element of `choices` as its index.
    pub(crate) fn walk_choice<T: Clone + PartialEq>(
        &mut self,
        value: &mut T,
        choices: &[T],
    ) -> Option<()> {
        let index = choices.iter().position(|choice| choice == value).unwrap_or(choices.len());
        *value = choices.get(self.walk_count(index)?)?.clone();
        Some(())
    }

    /// Writes or reads some elements of `choices` as their indices.
    pub(crate) fn walk_choices<T: Clone + PartialEq>(
        &mut self,
        values: &mut Vec<T>,
        choices: &[T],
    ) -> Option<()> {
        self.walk_length(values, choices.first()?)?;
        values.iter_mut().try_for_each(|value| self.walk_choice(value, choices))
    }

    /// Writes the length of a list, or reads a length and resizes the list. The elements are
    /// written or read separately.
    pub(crate) fn walk_length<T: Clone>(
        &mut self,
        list: &mut Vec<T>,
        blank_element: &T,
    ) -> Option<()> {
        list.resize(self.walk_count(list.len())?, blank_element.clone());
        Some(())
    }
}
