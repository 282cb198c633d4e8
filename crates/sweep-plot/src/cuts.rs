//! Where a map of three or more axes is cut: which values of the axes beyond the second are shown.

use super::error::{PlotError, Result};
use super::label;
use super::read::{Source, some_of};
use super::swept::SweptAxis;
use super::together::At;

/// Most values of a third axis that are drawn side by side.
const MOST_PANELS: usize = 9;

/// Most values of an axis that a message lists.
const MOST_LISTED: usize = 24;

/// Cells along either axis of a cut that a page keeps before it leaves out cuts.
const LEAST_SIDE: usize = 64;

/// The cuts that are shown.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cuts {
    /// The values that are shown of each axis after the second, by their place among all.
    pub(crate) picks: Vec<Vec<usize>>,
    /// In the order in which they are shown; a page opens with the first.
    pub(crate) cuts: Vec<Cut>,
    /// What is fixed or left out, in words.
    pub(crate) notes: Vec<String>,
}

/// One cut.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cut {
    /// Place among the picks of each axis after the second.
    pub(crate) rest: Vec<usize>,
    /// What sets it apart from the others, in words.
    pub(crate) name: Option<String>,
}

impl Cuts {
    /// The cuts of a picture: one for each value of the third axis, or for the one that `--at`
    /// names; every axis after it at one value, its first unless `--at` says otherwise.
    ///
    /// # Errors
    /// As [`pins`].
    pub(crate) fn of_picture(source: &Source, axes: &[SweptAxis], at: &At) -> Result<Self> {
        let extra = axes.get(2..).unwrap_or_default();
        let pins = pins(source, extra, at)?;
        // The third axis becomes panels unless it is pinned.
        let is_free = pins.first() == Some(&None);
        let mut counts = vec![1; extra.len()];
        if let Some(axis) = extra.first().filter(|_| is_free) {
            counts[0] = axis.values.len().min(MOST_PANELS);
        }
        let picks = picks(extra, &pins, &counts);
        let fixed = extra.iter().zip(&picks).skip(usize::from(is_free));
        let mut notes: Vec<String> =
            fixed.map(|(axis, pick)| axis.format_value(axis.values[pick[0]])).collect();
        let mut cuts = vec![Cut { rest: vec![0; extra.len()], name: None }];
        if let Some(axis) = extra.first().filter(|_| is_free) {
            if picks[0].len() < axis.values.len() {
                notes.push(left_out(axis, picks[0].len()));
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

    /// The cuts of a page of at most `most` cells: all of them, or else those at the values that
    /// `--at` names and at values picked evenly of the other axes. It opens with the values that
    /// `--at` names, or else the first.
    ///
    /// # Errors
    /// As [`pins`].
    pub(crate) fn of_page(
        source: &Source,
        axes: &[SweptAxis],
        at: &At,
        most: usize,
    ) -> Result<Self> {
        let extra = axes.get(2..).unwrap_or_default();
        let pins = pins(source, extra, at)?;
        let side = |axis: &SweptAxis| axis.values.len().min(LEAST_SIDE);
        let most_cuts = (most / axes.iter().take(2).map(side).product::<usize>()).max(1);
        let mut counts: Vec<usize> = extra.iter().map(|axis| axis.values.len()).collect();
        let too_many = |counts: &[usize]| {
            let cuts = counts.iter().try_fold(1_usize, |cuts, count| cuts.checked_mul(*count));
            cuts.is_none_or(|cuts| cuts > most_cuts)
        };
        if too_many(&counts) {
            for (count, _) in counts.iter_mut().zip(&pins).filter(|(_, pin)| pin.is_some()) {
                *count = 1;
            }
        }
        while too_many(&counts) {
            let Some(greatest) = counts.iter_mut().max().filter(|count| **count > 1) else { break };
            *greatest -= 1;
        }
        let picks = picks(extra, &pins, &counts);
        let some = extra.iter().zip(&picks).filter(|(axis, pick)| pick.len() < axis.values.len());
        let notes = some.map(|(axis, pick)| left_out(axis, pick.len())).collect();
        let place = |(pick, pin): (&Vec<usize>, &Option<usize>)| {
            pin.and_then(|pin| pick.iter().position(|known| *known == pin)).unwrap_or(0)
        };
        let rest = picks.iter().zip(&pins).map(place).collect();
        Ok(Self { picks, cuts: vec![Cut { rest, name: None }], notes })
    }
}

/// So many values of each axis by their places: the pinned one where they are not all, or else
/// some picked evenly.
fn picks(extra: &[SweptAxis], pins: &[Option<usize>], counts: &[usize]) -> Vec<Vec<usize>> {
    let pick = |((axis, pin), &count): ((&SweptAxis, &Option<usize>), &usize)| match pin {
        Some(pin) if count < axis.values.len() => vec![*pin],
        _ => evenly(axis.values.len(), count),
    };
    extra.iter().zip(pins).zip(counts).map(pick).collect()
}

/// `count` places out of `all`, spread evenly from the first to the last.
fn evenly(all: usize, count: usize) -> Vec<usize> {
    let last = (count - 1).max(1);
    (0..count).map(|k| (k * (all - 1) + last / 2) / last).collect()
}

fn left_out(axis: &SweptAxis, shown: usize) -> String {
    format!("{shown} of {} values of {}", axis.values.len(), axis.words.to_lowercase())
}

/// The value of each axis that `--at` names, by its place.
///
/// # Errors
/// [`PlotError::Unfit`] when `--at` names no axis beyond the second, or a value that its axis
/// does not have; [`PlotError::NotAGrid`] for an axis of more values than are kept.
fn pins(source: &Source, extra: &[SweptAxis], at: &At) -> Result<Vec<Option<usize>>> {
    if let Some(endless) = extra.iter().find(|axis| !axis.complete) {
        let reason = format!("axis `{}` has too many values to choose from", endless.name);
        return Err(PlotError::NotAGrid { path: source.path.clone(), reason });
    }
    let mut pins = vec![None; extra.len()];
    for (name, value) in at {
        let missing =
            |what, known: String| source.not_there("--at", format!("{name}={value}"), what, known);
        let place = extra.iter().position(|axis| axis.name == *name).ok_or_else(|| {
            let known = some_of(extra.iter().map(|axis| axis.name.as_str()));
            missing("axis beyond the second", known)
        })?;
        let values = &extra[place].values;
        let near = values.iter().position(|&known| SweptAxis::near(known, *value));
        pins[place] = Some(near.ok_or_else(|| {
            let said = |value: &f64| label::significant(*value, 6);
            let known = match &values[..] {
                [first, .., last] if values.len() > MOST_LISTED => {
                    format!("{} of them from {} to {}", values.len(), said(first), said(last))
                }
                few => few.iter().map(said).collect::<Vec<_>>().join(", "),
            };
            missing("value of that axis", known)
        })?);
    }
    Ok(pins)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picks_run_from_the_first_to_the_last() {
        assert_eq!(evenly(4, 4), [0, 1, 2, 3]);
        assert_eq!(evenly(100, 3), [0, 50, 99]);
        assert_eq!(evenly(7, 1), [0]);
    }
}
