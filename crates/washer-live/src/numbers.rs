//! Arrays of numbers in one order: a walk writes them, and the same walk reads them back.

/// Counts and places are below this: what a page was written with has fewer of everything.
const MOST: usize = 100_000;

/// A walk over the numbers of something. Each step writes a number, or puts the next one in its
/// place; it gives `None` where there is nothing like it.
pub(crate) enum Walk<'a> {
    /// The numbers so far.
    Write(Vec<f64>),
    /// Those that are left.
    Read(&'a [f64]),
}

impl Walk<'_> {
    pub(crate) const fn is_reading(&self) -> bool {
        matches!(self, Self::Read(_))
    }

    pub(crate) fn numbers<const N: usize>(&mut self, values: [&mut f64; N]) -> Option<()> {
        for value in values {
            match self {
                Self::Write(numbers) => numbers.push(*value),
                Self::Read(left) => {
                    let (first, rest) = left.split_first()?;
                    (*value, *left) = (*first, rest);
                }
            }
        }
        Some(())
    }

    /// A number that may be absent.
    pub(crate) fn optional(&mut self, value: &mut Option<f64>) -> Option<()> {
        let mut number = value.unwrap_or(f64::NAN);
        self.numbers([&mut number])?;
        *value = (!number.is_nan()).then_some(number);
        Some(())
    }

    /// The count that was written.
    pub(crate) fn count(&mut self, count: usize) -> Option<usize> {
        let mut value = count as f64;
        self.numbers([&mut value])?;
        let is_count = value >= 0.0 && value < MOST as f64 && value == value.trunc();
        is_count.then_some(value as usize)
    }

    /// One of these, by its place among them.
    pub(crate) fn choice<T: Clone + PartialEq>(&mut self, one: &mut T, all: &[T]) -> Option<()> {
        let place = all.iter().position(|known| known == one).unwrap_or(all.len());
        *one = all.get(self.count(place)?)?.clone();
        Some(())
    }

    /// Some of these, by their places among them.
    pub(crate) fn choices<T: Clone + PartialEq>(
        &mut self,
        some: &mut Vec<T>,
        all: &[T],
    ) -> Option<()> {
        self.sized(some, all.first()?)?;
        some.iter_mut().try_for_each(|one| self.choice(one, all))
    }

    /// A list's length; what the list is made of goes on its own.
    pub(crate) fn sized<T: Clone>(&mut self, list: &mut Vec<T>, blank: &T) -> Option<()> {
        list.resize(self.count(list.len())?, blank.clone());
        Some(())
    }
}
