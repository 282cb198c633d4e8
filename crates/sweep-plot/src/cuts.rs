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
    pub(crate) other_picks: Vec<usize>,
    /// The name that distinguishes the cut from the others.
    pub(crate) name: Option<String>,
}

impl Cuts {
    /// Returns the cuts of a picture: one for each value of the third axis unless
    /// `requested_values` fixes it. Every axis after the third has one value, its first unless
    /// `requested_values` gives another.
    ///
    /// # Errors
    /// The errors of [`fixed_values`].
    pub(crate) fn for_picture(
        source: &FigureFile,
        axes: &[SweptAxis],
        requested_values: &NamedPoint,
    ) -> Result<Self> {
        let further_axes = axes.get(2..).unwrap_or_default();
        let fixed_values = fixed_values(source, further_axes, requested_values)?;
        // The third axis becomes panels unless it is fixed.
        let is_third_axis_free = fixed_values.first() == Some(&None);
        let mut counts = vec![1; further_axes.len()];
        if let Some(axis) = further_axes.first().filter(|_| is_third_axis_free) {
            counts[0] = axis.values.len().min(MAX_PANELS);
        }
        let picks = pick_values(further_axes, &fixed_values, &counts);
        let fixed = further_axes.iter().zip(&picks).skip(usize::from(is_third_axis_free));
        let mut notes: Vec<String> =
            fixed.map(|(axis, pick)| axis.format_value(axis.values[pick[0]])).collect();
        let mut cuts = vec![Cut { other_picks: vec![0; further_axes.len()], name: None }];
        if let Some(axis) = further_axes.first().filter(|_| is_third_axis_free) {
            if picks[0].len() < axis.values.len() {
                notes.push(omission_note(axis, picks[0].len()));
            }
            let cut_at_pick = |(position, pick): (usize, &usize)| {
                let mut other_picks = vec![0; further_axes.len()];
                other_picks[0] = position;
                Cut { other_picks, name: Some(axis.format_value(axis.values[*pick])) }
            };
            cuts = picks[0].iter().enumerate().map(cut_at_pick).collect();
        }
        Ok(Self { picks, cuts, notes })
    }

    /// Returns the cuts of a page of at most `max_cells` cells. If not all cuts fit, it shows those
    /// at the fixed values and at evenly picked values of the other axes. The page opens with the
    /// fixed values, or else with the first cut.
    ///
    /// # Errors
    /// The errors of [`fixed_values`].
    pub(crate) fn for_page(
        source: &FigureFile,
        axes: &[SweptAxis],
        requested_values: &NamedPoint,
        max_cells: usize,
    ) -> Result<Self> {
        let further_axes = axes.get(2..).unwrap_or_default();
        let fixed_values = fixed_values(source, further_axes, requested_values)?;
        let min_cells = |axis: &SweptAxis| axis.values.len().min(MIN_CELLS_ALONG_AXIS);
        let max_cuts = (max_cells / axes.iter().take(2).map(min_cells).product::<usize>()).max(1);
        let mut counts: Vec<usize> = further_axes.iter().map(|axis| axis.values.len()).collect();
        let exceeds_max_cuts = |counts: &[usize]| {
            let cuts = counts.iter().try_fold(1_usize, |cuts, count| cuts.checked_mul(*count));
            cuts.is_none_or(|cuts| cuts > max_cuts)
        };
        if exceeds_max_cuts(&counts) {
            for (count, _) in counts
                .iter_mut()
                .zip(&fixed_values)
                .filter(|(_, fixed_index)| fixed_index.is_some())
            {
                *count = 1;
            }
        }
        while exceeds_max_cuts(&counts) {
            let Some(greatest) = counts.iter_mut().max().filter(|count| **count > 1) else { break };
            *greatest -= 1;
        }
        let picks = pick_values(further_axes, &fixed_values, &counts);
        let shortened_axes =
            further_axes.iter().zip(&picks).filter(|(axis, pick)| pick.len() < axis.values.len());
        let notes = shortened_axes.map(|(axis, pick)| omission_note(axis, pick.len())).collect();
        let fixed_position = |(pick, fixed_index): (&Vec<usize>, &Option<usize>)| {
            fixed_index
                .and_then(|fixed_index| pick.iter().position(|index| *index == fixed_index))
                .unwrap_or(0)
        };
        let other_picks = picks.iter().zip(&fixed_values).map(fixed_position).collect();
        Ok(Self { picks, cuts: vec![Cut { other_picks, name: None }], notes })
    }
}

/// Returns the indices of the values shown for each axis: the fixed value if not all values fit, or
/// else `counts` of them, evenly picked.
fn pick_values(
    further_axes: &[SweptAxis],
    fixed_values: &[Option<usize>],
    counts: &[usize],
) -> Vec<Vec<usize>> {
    let pick =
        |((axis, fixed_index), &count): ((&SweptAxis, &Option<usize>), &usize)| match fixed_index {
            Some(fixed_index) if count < axis.values.len() => vec![*fixed_index],
            _ => even_indices(axis.values.len(), count),
        };
    further_axes.iter().zip(fixed_values).zip(counts).map(pick).collect()
}

/// Returns `count` indices below `length`, spread evenly from the first to the last.
fn even_indices(length: usize, count: usize) -> Vec<usize> {
    let last = (count - 1).max(1);
    (0..count).map(|k| (k * (length - 1) + last / 2) / last).collect()
}

fn omission_note(axis: &SweptAxis, shown_count: usize) -> String {
    format!("{shown_count} of {} values of {}", axis.values.len(), axis.words.to_lowercase())
}

/// Returns the index of the value of each axis that `requested_values` fixes.
///
/// # Errors
/// [`PlotError::Unfit`] if `requested_values` names no axis beyond the second, or a value that its
/// axis does not have; [`PlotError::NotAGrid`] for an axis with more values than are kept.
fn fixed_values(
    source: &FigureFile,
    further_axes: &[SweptAxis],
    requested_values: &NamedPoint,
) -> Result<Vec<Option<usize>>> {
    if let Some(incomplete) = further_axes.iter().find(|axis| !axis.is_complete) {
        let reason = format!("axis `{}` has too many values to choose from", incomplete.name);
        return Err(PlotError::NotAGrid { path: source.path.clone(), reason });
    }
    let mut fixed_values = vec![None; further_axes.len()];
    for (name, value) in requested_values {
        let unknown_error = |what, valid_values: String| {
            source.unknown_name("--at", format!("{name}={value}"), what, valid_values)
        };
        let axis_index =
            further_axes.iter().position(|axis| axis.name == *name).ok_or_else(|| {
                let valid_values = list_names(further_axes.iter().map(|axis| axis.name.as_str()));
                unknown_error("axis beyond the second", valid_values)
            })?;
        let values = &further_axes[axis_index].values;
        let value_index =
            values.iter().position(|&axis_value| SweptAxis::is_same_value(axis_value, *value));
        fixed_values[axis_index] = Some(value_index.ok_or_else(|| {
            let format_value = |value: &f64| label::format_significant(*value, 6);
            let valid_values = match &values[..] {
                [first, .., last] if values.len() > MAX_LISTED => {
                    format!(
                        "{} of them from {} to {}",
                        values.len(),
                        format_value(first),
                        format_value(last)
                    )
                }
                all => all.iter().map(format_value).collect::<Vec<_>>().join(", "),
            };
            unknown_error("value of that axis", valid_values)
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
