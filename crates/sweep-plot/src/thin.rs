//! Long columns cut into stretches as their rows are read. A curve needs the least and the greatest
//! value of each stretch.

/// Some rows cut into stretches that differ by one row at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stretches {
    rows: usize,
    count: usize,
}

impl Stretches {
    /// At most `count` stretches, none of them empty.
    pub(crate) fn new(rows: usize, count: usize) -> Self {
        Self { rows, count: count.min(rows) }
    }

    /// Most rows in one.
    pub(crate) fn longest(self) -> usize {
        self.rows.div_ceil(self.count.max(1))
    }

    /// First row of a stretch, and one past the last row of the one before it.
    fn start(self, stretch: usize) -> usize {
        // Rows times stretches can pass 64 bits in a file whose metadata lies.
        (stretch as u128 * self.rows as u128 / self.count.max(1) as u128) as usize
    }
}

/// What is kept of a stretch's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keep {
    /// The least and the greatest, in the order in which they occur; NaN if nothing in the stretch
    /// is finite.
    Extremes,
    /// The first and the middle one: the instants at which the extremes are drawn.
    Instants,
}

/// One column on its way through.
pub(crate) struct Thinner {
    stretches: Stretches,
    keep: Keep,
    /// Rows seen.
    row: usize,
    /// The stretch that the next row belongs to.
    stretch: usize,
    least: Option<(usize, f64)>,
    greatest: Option<(usize, f64)>,
    kept: Vec<f64>,
}

impl Thinner {
    pub(crate) fn new(stretches: Stretches, keep: Keep) -> Self {
        let kept = Vec::with_capacity(2 * stretches.count);
        Self { stretches, keep, row: 0, stretch: 0, least: None, greatest: None, kept }
    }

    /// Takes the next row's value. Rows beyond those announced are left out.
    pub(crate) fn push(&mut self, value: f64) {
        if self.stretch == self.stretches.count {
            return;
        }
        let [start, end] = [0, 1].map(|k| self.stretches.start(self.stretch + k));
        match self.keep {
            Keep::Instants => {
                for instant in [start, (start + end) / 2] {
                    self.kept.extend((self.row == instant).then_some(value));
                }
            }
            Keep::Extremes if value.is_finite() => {
                if self.least.is_none_or(|(_, least)| value < least) {
                    self.least = Some((self.row, value));
                }
                if self.greatest.is_none_or(|(_, greatest)| value > greatest) {
                    self.greatest = Some((self.row, value));
                }
            }
            Keep::Extremes => {}
        }
        self.row += 1;
        if self.row == end {
            if self.keep == Keep::Extremes {
                let ends = [self.least.take(), self.greatest.take()];
                let mut ends = ends.map(|end| end.unwrap_or((0, f64::NAN)));
                ends.sort_by_key(|(row, _)| *row);
                self.kept.extend(ends.map(|(_, value)| value));
            }
            self.stretch += 1;
        }
    }

    /// Two values for each stretch.
    pub(crate) fn finish(self) -> Vec<f64> {
        self.kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thinned(values: &[f64], count: usize, keep: Keep) -> Vec<f64> {
        let mut thinner = Thinner::new(Stretches::new(values.len(), count), keep);
        values.iter().for_each(|value| thinner.push(*value));
        thinner.finish()
    }

    #[test]
    fn extremes_keep_their_order() {
        assert_eq!(thinned(&[0.0, 3.0, -2.0, 1.0], 1, Keep::Extremes), [3.0, -2.0]);
        assert_eq!(thinned(&[f64::NAN, 5.0], 1, Keep::Extremes), [5.0, 5.0]);
        assert!(thinned(&[f64::NAN], 1, Keep::Extremes).iter().all(|value| value.is_nan()));
        assert_eq!(thinned(&[1.0, 2.0, 3.0, 4.0, 5.0], 2, Keep::Extremes), [1.0, 2.0, 3.0, 5.0]);
    }

    #[test]
    fn instants_are_the_first_and_the_middle_one() {
        assert_eq!(thinned(&[0.0, 1.0, 2.0, 3.0], 1, Keep::Instants), [0.0, 2.0]);
        assert_eq!(thinned(&[0.0, 1.0], 2, Keep::Instants), [0.0, 0.0, 1.0, 1.0]);
    }

    #[test]
    fn stretches_cover_every_row_once() {
        for rows in [1_u32, 3, 499, 500, 501, 12_345] {
            let values: Vec<f64> = (0..rows).map(f64::from).collect();
            let kept = thinned(&values, 500, Keep::Extremes);
            assert_eq!(kept.len(), 2 * 500.min(rows as usize));
            let starts: Vec<f64> = kept.chunks(2).map(|pair| pair[0]).collect();
            let ends: Vec<f64> = kept.chunks(2).map(|pair| pair[1]).collect();
            assert_eq!((starts[0], ends[ends.len() - 1]), (0.0, f64::from(rows - 1)));
            assert!(starts[1..].iter().zip(&ends).all(|(start, end)| *start == end + 1.0));
        }
    }
}
