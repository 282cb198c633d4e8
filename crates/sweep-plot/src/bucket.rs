//! Min-max decimation of long columns while their rows are read: a curve needs the least and the
//! greatest value of each bucket.

/// The rows of a file in buckets whose sizes differ by at most one row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Buckets {
    rows: usize,
    count: usize,
}

impl Buckets {
    /// Returns at most `count` buckets, none of them empty.
    pub(crate) fn new(rows: usize, count: usize) -> Self {
        Self { rows, count: count.min(rows) }
    }

    /// Returns the maximum number of rows in a bucket.
    pub(crate) fn max_bucket_rows(self) -> usize {
        self.rows.div_ceil(self.count.max(1))
    }

    /// Returns the first row of a bucket, one past the last row of the bucket before it.
    fn start(self, index: usize) -> usize {
        // Rows times buckets can exceed 64 bits if the metadata claims too many rows.
        (index as u128 * self.rows as u128 / self.count.max(1) as u128) as usize
    }
}

/// The values of a bucket that are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KeptValues {
    /// The least and the greatest value in the order in which they occur; NaN if no value is
    /// finite.
    Extremes,
    /// The first and the middle value: the instants at which the extremes are drawn.
    Instants,
}

/// A column while it is decimated.
pub(crate) struct Decimator {
    buckets: Buckets,
    rule: KeptValues,
    /// The number of rows so far.
    row: usize,
    /// The bucket of the next row.
    bucket: usize,
    least_row_and_value: Option<(usize, f64)>,
    greatest_row_and_value: Option<(usize, f64)>,
    kept_values: Vec<f64>,
}

impl Decimator {
    pub(crate) fn new(buckets: Buckets, rule: KeptValues) -> Self {
        let kept_values = Vec::with_capacity(2 * buckets.count);
        Self {
            buckets,
            rule,
            row: 0,
            bucket: 0,
            least_row_and_value: None,
            greatest_row_and_value: None,
            kept_values,
        }
    }

    /// Adds the next row's value. Rows beyond the announced number are ignored.
    pub(crate) fn push(&mut self, value: f64) {
        if self.bucket == self.buckets.count {
            return;
        }
        let [start_row, end_row] = [0, 1].map(|k| self.buckets.start(self.bucket + k));
        match self.rule {
            KeptValues::Instants => {
                for kept_row in [start_row, (start_row + end_row) / 2] {
                    self.kept_values.extend((self.row == kept_row).then_some(value));
                }
            }
            KeptValues::Extremes if value.is_finite() => {
                if self
                    .least_row_and_value
                    .is_none_or(|(_, least_row_and_value)| value < least_row_and_value)
                {
                    self.least_row_and_value = Some((self.row, value));
                }
                if self
                    .greatest_row_and_value
                    .is_none_or(|(_, greatest_row_and_value)| value > greatest_row_and_value)
                {
                    self.greatest_row_and_value = Some((self.row, value));
                }
            }
            KeptValues::Extremes => {}
        }
        self.row += 1;
        if self.row == end_row {
            if self.rule == KeptValues::Extremes {
                let extremes =
                    [self.least_row_and_value.take(), self.greatest_row_and_value.take()];
                let mut extremes = extremes.map(|extreme| extreme.unwrap_or((0, f64::NAN)));
                extremes.sort_by_key(|(row, _)| *row);
                self.kept_values.extend(extremes.map(|(_, value)| value));
            }
            self.bucket += 1;
        }
    }

    /// Returns two values for each bucket.
    pub(crate) fn finish(self) -> Vec<f64> {
        self.kept_values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decimate(values: &[f64], count: usize, rule: KeptValues) -> Vec<f64> {
        let mut decimator = Decimator::new(Buckets::new(values.len(), count), rule);
        values.iter().for_each(|value| decimator.push(*value));
        decimator.finish()
    }

    #[test]
    fn extremes_are_kept_in_order_of_time() {
        assert_eq!(decimate(&[0.0, 3.0, -2.0, 1.0], 1, KeptValues::Extremes), [3.0, -2.0]);
        assert_eq!(decimate(&[f64::NAN, 5.0], 1, KeptValues::Extremes), [5.0, 5.0]);
        assert!(decimate(&[f64::NAN], 1, KeptValues::Extremes).iter().all(|value| value.is_nan()));
        assert_eq!(
            decimate(&[1.0, 2.0, 3.0, 4.0, 5.0], 2, KeptValues::Extremes),
            [1.0, 2.0, 3.0, 5.0]
        );
    }

    #[test]
    fn instants_are_the_first_and_the_middle_one() {
        assert_eq!(decimate(&[0.0, 1.0, 2.0, 3.0], 1, KeptValues::Instants), [0.0, 2.0]);
        assert_eq!(decimate(&[0.0, 1.0], 2, KeptValues::Instants), [0.0, 0.0, 1.0, 1.0]);
    }

    #[test]
    fn buckets_cover_every_row_once() {
        for rows in [1_u32, 3, 499, 500, 501, 12_345] {
            let values: Vec<f64> = (0..rows).map(f64::from).collect();
            let decimated_values = decimate(&values, 500, KeptValues::Extremes);
            assert_eq!(decimated_values.len(), 2 * 500.min(rows as usize));
            let first_values: Vec<f64> = decimated_values.chunks(2).map(|pair| pair[0]).collect();
            let last_values: Vec<f64> = decimated_values.chunks(2).map(|pair| pair[1]).collect();
            assert_eq!(
                (first_values[0], last_values[last_values.len() - 1]),
                (0.0, f64::from(rows - 1))
            );
            assert!(
                first_values[1..].iter().zip(&last_values).all(|(start, end)| *start == end + 1.0)
            );
        }
    }
}
