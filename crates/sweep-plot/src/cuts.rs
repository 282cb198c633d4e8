//! Cuts through a map of three axes or more: the values of the axes beyond the second that are
//! shown.

use super::error::{PlotError, Result};
use super::label;
use super::read::{FigureFile, list_names};
use super::swept::SweptAxis;
use super::together::NamedPoint;

/// Maximum number of values of a third axis that are drawn side by side. Basis: three rows of three
/// panels. Doubling it makes panels too small to read.
const MAX_PANELS: usize = 9;

/// Maximum number of values of an axis that a message lists. Basis: a message of a few lines.
const MAX_LISTED: usize = 24;

/// Minimum number of cells along each of the first two axes of a page; a map with more cuts than
/// then fit shows only some of them. Basis: fewer cells blur a boundary. Doubling it leaves a
/// quarter of the cuts.
const MIN_CELLS_ALONG_AXIS: usize = 64;

/// The cuts through a map that a figure shows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cuts {
    /// The indices of the values shown of each axis beyond the second.
    pub(crate) picks: Vec<Vec<usize>>,
    /// The cuts in the order in which they are shown; a page opens with the first.
    pub(crate) cuts: Vec<Cut>,
    /// Sentences of the subtitle: fixed values and omitted ones.
    pub(crate) notes: Vec<String>,
}

/// A cut through a map: the first two axes at fixed values of the others.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cut {
    /// The position of the cut's value in the picks, for each axis beyond the second.
    pub(crate) rest: Vec<usize>,
    /// The name that distinguishes it from the other cuts.
    pub(crate) name: Option<String>,
}

impl Cuts {
    /// Returns the cuts of a picture: one for each value of the third axis unless `at` fixes it.
    /// Every axis after the third has one value, its first unless `at` gives another.
    ///
    /// # Errors
    /// The errors of [`fixed_values`].
    pub(crate) fn for_picture(
        source: &FigureFile,
        axes: &[SweptAxis],
        at: &NamedPoint,
    ) -> Result<Self> {
        let extra = axes.get(2..).unwrap_or_default();
        let fixed_values = fixed_values(source, extra, at)?;
        // The third axis becomes panels unless it is fixed.
        let is_free = fixed_values.first() == Some(&None);
        let mut counts = vec![1; extra.len()];
        if let Some(axis) = extra.first().filter(|_| is_free) {
            counts[0] = axis.values.len().min(MAX_PANELS);
        }
        let picks = picks(extra, &fixed_values, &counts);
        let fixed = extra.iter().zip(&picks).skip(usize::from(is_free));
        let mut notes: Vec<String> =
            fixed.map(|(axis, pick)| axis.format_value(axis.values[pick[0]])).collect();
        let mut cuts = vec![Cut { rest: vec![0; extra.len()], name: None }];
        if let Some(axis) = extra.first().filter(|_| is_free) {
            if picks[0].len() < axis.values.len() {
                notes.push(omission_note(axis, picks[0].len()));
            }
            let named = |(place, pick): (usize, &usize)| {
                let mut rest = vec![0; extra.len()];
                rest[0] = place;
                Cut { rest, name: Some(axis.format_value(axis.values[*pick])) }
            };
            cuts = picks[0].iter().enumerate().map(named).collect();
        }
        Ok(Self { picks, cuts, notes })
    }

    /// Returns the cuts of a page of at most `most` cells. If not all cuts fit, it shows those at
    /// the fixed values and at evenly picked values of the other axes. The page opens with the
    /// fixed values, or else with the first cut.
    ///
    /// # Errors
    /// The errors of [`fixed_values`].
    pub(crate) fn for_page(
        source: &FigureFile,
        axes: &[SweptAxis],
        at: &NamedPoint,
        most: usize,
    ) -> Result<Self> {
        let extra = axes.get(2..).unwrap_or_default();
        let fixed_values = fixed_values(source, extra, at)?;
        let side = |axis: &SweptAxis| axis.values.len().min(MIN_CELLS_ALONG_AXIS);
        let most_cuts = (most / axes.iter().take(2).map(side).product::<usize>()).max(1);
        let mut counts: Vec<usize> = extra.iter().map(|axis| axis.values.len()).collect();
        let too_many = |counts: &[usize]| {
            let cuts = counts.iter().try_fold(1_usize, |cuts, count| cuts.checked_mul(*count));
            cuts.is_none_or(|cuts| cuts > most_cuts)
        };
        if too_many(&counts) {
            for (count, _) in counts.iter_mut().zip(&fixed_values).filter(|(_, pin)| pin.is_some())
            {
                *count = 1;
            }
        }
        while too_many(&counts) {
            let Some(greatest) = counts.iter_mut().max().filter(|count| **count > 1) else { break };
            *greatest -= 1;
        }
        let picks = picks(extra, &fixed_values, &counts);
        let some = extra.iter().zip(&picks).filter(|(axis, pick)| pick.len() < axis.values.len());
        let notes = some.map(|(axis, pick)| omission_note(axis, pick.len())).collect();
        let place = |(pick, pin): (&Vec<usize>, &Option<usize>)| {
            pin.and_then(|pin| pick.iter().position(|known| *known == pin)).unwrap_or(0)
        };
        let rest = picks.iter().zip(&fixed_values).map(place).collect();
        Ok(Self { picks, cuts: vec![Cut { rest, name: None }], notes })
    }
}

/// Returns the indices of the values shown for each axis: the fixed value if not all values fit, or
/// else `counts` of them, evenly picked.
fn picks(extra: &[SweptAxis], fixed_values: &[Option<usize>], counts: &[usize]) -> Vec<Vec<usize>> {
    let pick = |((axis, pin), &count): ((&SweptAxis, &Option<usize>), &usize)| match pin {
        Some(pin) if count < axis.values.len() => vec![*pin],
        _ => even_indices(axis.values.len(), count),
    };
    extra.iter().zip(fixed_values).zip(counts).map(pick).collect()
}

/// Returns `count` indices below `all`, spread evenly from the first to the last.
fn even_indices(all: usize, count: usize) -> Vec<usize> {
    let last = (count - 1).max(1);
    (0..count).map(|k| (k * (all - 1) + last / 2) / last).collect()
}

fn omission_note(axis: &SweptAxis, shown: usize) -> String {
    format!("{shown} of {} values of {}", axis.values.len(), axis.words.to_lowercase())
}

/// Returns the index of the value of each axis that `at` fixes.
///
/// # Errors
/// [`PlotError::Unfit`] if `at` names no axis beyond the second, or a value that its axis does not
/// have; [`PlotError::NotAGrid`] for an axis with more values than are kept.
///
/// # Errors
/// [`PlotError::Unfit`] when `--at` names no axis beyond the second, or a value that its axis
/// does not have; [`PlotError::NotAGrid`] for an axis of more values than are kept.
fn fixed_values(
    source: &FigureFile,
    extra: &[SweptAxis],
    at: &NamedPoint,
) -> Result<Vec<Option<usize>>> {
    if let Some(endless) = extra.iter().find(|axis| !axis.complete) {
        let reason = format!("axis `{}` has too many values to choose from", endless.name);
        return Err(PlotError::NotAGrid { path: source.path.clone(), reason });
    }
    let mut fixed_values = vec![None; extra.len()];
    for (name, value) in at {
        let missing = |what, known: String| {
            source.unknown_name("--at", format!("{name}={value}"), what, known)
        };
        let place = extra.iter().position(|axis| axis.name == *name).ok_or_else(|| {
            let known = list_names(extra.iter().map(|axis| axis.name.as_str()));
            missing("axis beyond the second", known)
        })?;
        let values = &extra[place].values;
        let near = values.iter().position(|&known| SweptAxis::is_near(known, *value));
        fixed_values[place] = Some(near.ok_or_else(|| {
            let phrase = |value: &f64| label::significant(*value, 6);
            let known = match &values[..] {
                [first, .., last] if values.len() > MAX_LISTED => {
                    format!("{} of them from {} to {}", values.len(), phrase(first), phrase(last))
                }
                few => few.iter().map(phrase).collect::<Vec<_>>().join(", "),
            };
            missing("value of that axis", known)
        })?);
    }
    Ok(fixed_values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picks_include_the_first_and_the_last() {
        assert_eq!(even_indices(4, 4), [0, 1, 2, 3]);
        assert_eq!(even_indices(100, 3), [0, 50, 99]);
        assert_eq!(even_indices(7, 1), [0]);
    }
}
