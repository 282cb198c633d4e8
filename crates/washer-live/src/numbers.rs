//! Arrays of numbers, written and read in one order.

/// What takes numbers: `setup.rs` describes a setup once for writing and once for reading.
#[derive(Default)]
pub(crate) struct Writer(pub(crate) Vec<f64>);

impl Writer {
    pub(crate) fn number(&mut self, value: f64) {
        self.0.push(value);
    }

    pub(crate) fn count(&mut self, count: usize) {
        self.0.push(count as f64);
    }

    /// A number that may be absent.
    pub(crate) fn optional(&mut self, value: Option<f64>) {
        self.0.push(value.unwrap_or(f64::NAN));
    }

    pub(crate) fn counted(&mut self, values: &[f64]) {
        self.count(values.len());
        self.0.extend(values);
    }
}

/// The numbers that are left. Each read gives `None` where there is nothing like it.
pub(crate) struct Reader<'a>(pub(crate) &'a [f64]);

impl<'a> Reader<'a> {
    pub(crate) fn number(&mut self) -> Option<f64> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    /// A count below `bound`.
    pub(crate) fn count(&mut self, bound: usize) -> Option<usize> {
        let value = self.number()?;
        let is_count = value >= 0.0 && value < bound as f64 && value == value.trunc();
        is_count.then_some(value as usize)
    }

    /// A number that may be absent.
    pub(crate) fn optional(&mut self) -> Option<Option<f64>> {
        self.number().map(|value| (!value.is_nan()).then_some(value))
    }

    pub(crate) fn take(&mut self, count: usize) -> Option<&'a [f64]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    pub(crate) fn counted(&mut self) -> Option<&'a [f64]> {
        let count = self.count(self.0.len())?;
        self.take(count)
    }
}
