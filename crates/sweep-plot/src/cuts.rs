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
const MAX_LISTED_VALUES: usize = 24;

/// Minimum number of cells along each of the first two axes of a page; a map with more cuts than
/// then fit shows only some of them. Basis: fewer cells blur a boundary. Doubling it leaves a
/// quarter of the cuts.
const MIN_CELLS_ALONG_AXIS: usize = 64;

/// The cuts through a map that a figure shows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cuts {
    /// The indices of the values shown of each axis beyond the second.
    pub(crate) picked_indices: Vec<Vec<usize>>,
    /// The cuts in the order in which they are shown; a page opens with the first.
    pub(crate) cuts: Vec<Cut>,
    /// Sentences of the subtitle: fixed values and omitted ones.
    pub(crate) notes: Vec<String>,
}

/// A cut through a map: the first two axes at fixed values of the others.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cut {
    /// The position of the cut's value in the picks, for each axis beyond the second.
    pub(crate) pick_positions: Vec<usize>,
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
        let fixed_indices = find_fixed_indices(source, further_axes, requested_values)?;
        // The third axis becomes panels unless it is fixed.
        let is_third_axis_free = fixed_indices.first() == Some(&None);
        let mut counts = vec![1; further_axes.len()];
        if let Some(axis) = further_axes.first().filter(|_| is_third_axis_free) {
            counts[0] = axis.values.len().min(MAX_PANELS);
        }
        let picked_indices = pick_values(further_axes, &fixed_indices, &counts);
        let fixed_axes =
            further_axes.iter().zip(&picked_indices).skip(usize::from(is_third_axis_free));
        let mut notes: Vec<String> =
            fixed_axes.map(|(axis, pick)| axis.format_value(axis.values[pick[0]])).collect();
        let mut cuts = vec![Cut { pick_positions: vec![0; further_axes.len()], name: None }];
        if let Some(axis) = further_axes.first().filter(|_| is_third_axis_free) {
            if picked_indices[0].len() < axis.values.len() {
                notes.push(omission_note(axis, picked_indices[0].len()));
            }
            let to_cut = |(position, pick): (usize, &usize)| {
                let mut pick_positions = vec![0; further_axes.len()];
                pick_positions[0] = position;
                Cut { pick_positions, name: Some(axis.format_value(axis.values[*pick])) }
            };
            cuts = picked_indices[0].iter().enumerate().map(to_cut).collect();
        }
        Ok(Self { picked_indices, cuts, notes })
    }

    /// Returns the cuts of a page of at most `max_cells` cells. If not all cuts fit, it shows those
    /// at the fixed values and at evenly picked values of the other axes. The page opens with the
    /// fixed values, or else with the first cut.
    ///
    /// # Errors
    /// The errors of [`find_fixed_indices`].
    pub(crate) fn for_page(
        source: &FigureFile,
        axes: &[SweptAxis],
        requested_values: &NamedPoint,
        max_cells: usize,
    ) -> Result<Self> {
        let further_axes = axes.get(2..).unwrap_or_default();
        let fixed_indices = find_fixed_indices(source, further_axes, requested_values)?;
        let min_cells = |axis: &SweptAxis| axis.values.len().min(MIN_CELLS_ALONG_AXIS);
        let max_cuts = (max_cells / axes.iter().take(2).map(min_cells).product::<usize>()).max(1);
        let mut counts: Vec<usize> = further_axes.iter().map(|axis| axis.values.len()).collect();
        let exceeds_max_cuts = |counts: &[usize]| {
            let cut_count =
                counts.iter().try_fold(1_usize, |cut_count, count| cut_count.checked_mul(*count));
            cut_count.is_none_or(|cut_count| cut_count > max_cuts)
        };
        if exceeds_max_cuts(&counts) {
            for (count, _) in counts
                .iter_mut()
                .zip(&fixed_indices)
                .filter(|(_, fixed_index)| fixed_index.is_some())
            {
                *count = 1;
            }
        }
        while exceeds_max_cuts(&counts) {
            let Some(greatest_count) = counts.iter_mut().max().filter(|count| **count > 1) else {
                break;
            };
            *greatest_count -= 1;
        }
        let picked_indices = pick_values(further_axes, &fixed_indices, &counts);
        let shortened_axes = further_axes
            .iter()
            .zip(&picked_indices)
            .filter(|(axis, pick)| pick.len() < axis.values.len());
        let notes = shortened_axes.map(|(axis, pick)| omission_note(axis, pick.len())).collect();
        let to_fixed_position = |(pick, fixed_index): (&Vec<usize>, &Option<usize>)| {
            fixed_index
                .and_then(|fixed_index| pick.iter().position(|index| *index == fixed_index))
                .unwrap_or(0)
        };
        let pick_positions =
            picked_indices.iter().zip(&fixed_indices).map(to_fixed_position).collect();
        Ok(Self { picked_indices, cuts: vec![Cut { pick_positions, name: None }], notes })
    }
}

/// Returns the indices of the values that figures show for each axis: as many evenly picked values
/// as `counts` says, or only the fixed value of an axis that has one and more values than that.
fn pick_values(
    further_axes: &[SweptAxis],
    fixed_indices: &[Option<usize>],
    counts: &[usize],
) -> Vec<Vec<usize>> {
    let pick_for_axis =
        |((axis, fixed_index), &count): ((&SweptAxis, &Option<usize>), &usize)| match fixed_index {
            Some(fixed_index) if count < axis.values.len() => vec![*fixed_index],
            _ => even_indices(axis.values.len(), count),
        };
    further_axes.iter().zip(fixed_indices).zip(counts).map(pick_for_axis).collect()
}

/// Returns `count` indices below `length`, spread evenly from the first to the last.
fn even_indices(length: usize, count: usize) -> Vec<usize> {
    let last_index = (count - 1).max(1);
    (0..count).map(|k| (k * (length - 1) + last_index / 2) / last_index).collect()
}

fn omission_note(axis: &SweptAxis, shown_count: usize) -> String {
    format!("{shown_count} of {} values of {}", axis.values.len(), axis.words.to_lowercase())
}

/// Returns the index of the value of each axis that `requested_values` fixes.
///
/// # Errors
/// [`PlotError::Unfit`] if `requested_values` names no axis beyond the second, or a value that its
/// axis does not have; [`PlotError::NotAGrid`] for an axis with more values than are kept.
fn find_fixed_indices(
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
            source.unknown_name_error("--at", format!("{name}={value}"), what, valid_values)
        };
        let axis_index =
            further_axes.iter().position(|axis| axis.name == *name).ok_or_else(|| {
                let valid_values = list_names(further_axes.iter().map(|axis| axis.name.as_str()));
                unknown_error("axis beyond the second", valid_values)
            })?;
        let axis_values = &further_axes[axis_index].values;
        let value_index =
            axis_values.iter().position(|&axis_value| SweptAxis::is_same_value(axis_value, *value));
        fixed_values[axis_index] = Some(value_index.ok_or_else(|| {
            let format_value = |value: &f64| label::format_significant(*value, 6);
            let valid_values = match &axis_values[..] {
                [first, .., last] if axis_values.len() > MAX_LISTED_VALUES => {
                    format!(
                        "{} of them from {} to {}",
                        axis_values.len(),
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
