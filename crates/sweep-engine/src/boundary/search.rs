//! The task of a plan, and a model's distances at trial points.

use super::lattice::{lattice_columns, lattice_ranks};
use super::quantity::{
    DerivedQuantity, derive_quantity, find_quantity, is_column_name, row_margin,
};
use super::{BoundaryTrial, SearchRange, TracedQuantity};
use crate::config::arguments::parse_finite;
use crate::evaluator::{CachedEvaluator, RequestValues, SearchStop};
use crate::optimise::search::row_defect;
use crate::store::{
    BatchBuilder, CellType, DeclaredColumn, Layout, PointRows, TrialColumns, TrialKey, axis_columns,
};
use crate::{AxisValues, Error, Model, Plan, StoreError};
use sweep_results::Goal;

/// The greatest number of lines of all curves together. Basis: their traced rows take less than a
/// gigabyte of memory. Doubling it doubles that memory.
const MAX_LINES: u64 = 1_000_000;

/// The least tolerance, as a fraction of the range. Basis: the narrowest bracket still contains
/// thousands of floating-point numbers. Doubling it refuses tolerances that work.
const MIN_TOLERANCE_FRACTION: f64 = 1e-9;

/// The range divided by the default tolerance. Basis: 0.5 N s/m in `sweeps/fig12.toml`. Doubling it
/// takes about one more trial per crossing.
const DEFAULT_TOLERANCES_PER_RANGE: f64 = 480.0;

/// The options of a boundary.
#[derive(Clone, Debug, clap::Args)]
pub struct BoundaryOptions {
    /// Column whose limit is traced: any column of numbers that the grid's rows can have, such as
    /// ratio_max, ratio_CHANNEL or nonlinear_CHANNEL; or an expression of columns, with --limit; or
    /// a condition, as in `require`. Without a name, lists the columns
    #[arg(long, value_name = "COLUMN", default_value = "ratio_max")]
    #[arg(num_args = 0..=1, default_missing_value = "")]
    pub quantity: String,
    /// Limit in the column's unit [default: the column's own; of ratios that of the grid file]
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = parse_finite)]
    pub limit: Option<f64>,
    /// Width of the final brackets, in the second axis's unit; if that axis is logarithmic, as a
    /// fraction of its value [default: 1/480 of the range]
    #[arg(long, value_name = "WIDTH")]
    pub tolerance: Option<f64>,
    /// Number of cells along each axis of the lattice that finds islands: a finer lattice finds
    /// smaller islands and takes more points
    #[arg(long, value_name = "CELLS", default_value_t = 6)]
    #[arg(value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub lattice: u16,
}

/// A boundary that is searched: its plan, its quantity and its range.
#[derive(Clone, Debug)]
pub struct BoundaryTask<M: Model> {
    /// The plan that computes the quantity.
    pub plan: Plan<M>,
    /// The quantity that is at its limit.
    pub quantity: TracedQuantity,
    /// The expression that computes the quantity; `None` where it is a column.
    pub expression: Option<Goal>,
    /// The values of the first axis, in grid order.
    pub first_values: Vec<f64>,
    /// The number of curves: combinations of the axes beyond the second.
    pub curve_count: usize,
    /// The search along the second axis.
    pub range: SearchRange,
}

impl<M: Model> BoundaryTask<M> {
    /// Returns the task of a plan.
    ///
    /// # Errors
    /// The errors of [`find_quantity`] and [`derive_quantity`], and [`Error::Refused`] for a plan
    /// without a boundary or a tolerance that cannot be met or means nothing.
    pub fn new(plan: &Plan<M>, options: &BoundaryOptions) -> Result<Self, Error> {
        let (quantity, expression, plan) = if is_column_name(&options.quantity) {
            let (quantity, plan) = find_quantity(plan, &options.quantity, options.limit)?;
            (quantity, None, plan)
        } else {
            let DerivedQuantity { quantity, goal, plan } =
                derive_quantity(plan, &options.quantity, options.limit)?;
            (quantity, Some(goal), plan)
        };
        let refuse_task = |reason: String| Err(Error::Refused(reason));
        if plan.design.is_some() {
            return refuse_task(
                "a boundary runs over the axes of a grid, and this file has a [design]: remove \
                 it, and give [[axis]] twice"
                    .to_owned(),
            );
        }
        let [first, second, other_axes @ ..] = plan.axes.as_slice() else {
            return refuse_task(format!(
                "a boundary runs over two axes, and this grid has {}: give [[axis]] twice, first \
                 the one along which the curve is wanted, then the one that is searched; one that \
                 --at gives a value is no axis, one with `values` of one number is",
                plan.axes.len()
            ));
        };
        let [least, greatest] = second.values.extremes();
        if least >= greatest {
            return refuse_task(format!(
                "the second axis, `{}`, has one value: give it the range to search, as range = {{ \
                 from, to, count }} or as `values` whose least and greatest are its ends",
                second.parameter.name
            ));
        }
        // Plans hold at most 1e12 points, so the products fit.
        let curve_count: u64 = other_axes.iter().map(|axis| axis.values.len()).product();
        let line_count = first.values.len() * curve_count;
        if line_count > MAX_LINES {
            return refuse_task(format!(
                "{line_count} rows (values of the first axis, times the combinations of the axes \
                 beyond the second) are more than {MAX_LINES}: trace parts of them"
            ));
        }
        let second_log = matches!(second.values, AxisValues::Log { .. });
        let range_extent = if second_log { libm::log(greatest / least) } else { greatest - least };
        let requested_tolerance =
            options.tolerance.unwrap_or(range_extent / DEFAULT_TOLERANCES_PER_RANGE);
        if !(range_extent * MIN_TOLERANCE_FRACTION..=range_extent).contains(&requested_tolerance) {
            return refuse_task(format!(
                "--tolerance {requested_tolerance} is out of range: expected from {:e} to \
                 {range_extent} for the second axis",
                range_extent * MIN_TOLERANCE_FRACTION
            ));
        }
        let search = SearchRange {
            least,
            greatest,
            is_first_log: matches!(first.values, AxisValues::Log { .. }),
            is_second_log: second_log,
            tolerance: requested_tolerance,
            lattice_cells: options.lattice.into(),
        };
        let first_values = (0..first.values.len()).map(|k| first.values.value(k)).collect();
        Ok(Self {
            plan,
            quantity,
            expression,
            first_values,
            curve_count: curve_count as usize,
            range: search,
        })
    }

    /// Returns the largest size of a cell of the lattice along the first and the second axis, in
    /// their units.
    pub fn max_cell_size(&self) -> [f64; 2] {
        let mut first_values = self.first_values.clone();
        first_values.sort_by(f64::total_cmp);
        let line_values: Vec<f64> = lattice_ranks(first_values.len(), self.range.lattice_cells)
            .into_iter()
            .map(|rank| first_values[rank])
            .collect();
        let column_values: Vec<f64> = lattice_columns(&self.range.span(), self.range.lattice_cells)
            .into_iter()
            .map(|position| self.range.value(position))
            .collect();
        [line_values, column_values]
            .map(|positions| positions.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max))
    }

    /// Returns the name of the column that is at its limit, if it is one.
    pub fn column_name(&self) -> Option<&str> {
        self.expression.is_none().then_some(self.quantity.name.as_str())
    }

    /// Computes the quantity of a point.
    fn point_value(
        &self,
        layout: &Layout,
        axis_values: Vec<f64>,
        point_rows: PointRows,
    ) -> Result<Option<f64>, StoreError> {
        let Some(expression) = &self.expression else {
            let index = layout.columns.iter().position(|column| column.name == self.quantity.name);
            let index_and_cell =
                index.and_then(|index| Some((index, point_rows.rows.first()?[index])));
            return Ok(index_and_cell
                .and_then(|(index, index_and_cell)| layout.columns[index].number(index_and_cell)));
        };
        let mut rows = BatchBuilder::new(layout);
        let point = point_rows.point;
        for row in point_rows.rows.into_iter().take(1) {
            rows.push_row(point, axis_values.clone(), row);
        }
        let value = rows.take_batch().and_then(|batch| row_margin(expression, &batch));
        Ok(value.map_err(row_defect)?.filter(|value| value.is_finite()))
    }

    /// Returns the function that evaluates the distances at trial points.
    pub fn distance_evaluator<'a>(
        &'a self,
        evaluator: &'a CachedEvaluator<'_>,
    ) -> impl Fn(&[BoundaryTrial]) -> Result<Vec<Option<f64>>, SearchStop> + 'a {
        let layout = M::layout(&self.plan);
        move |trials| {
            let values: Vec<Vec<f64>> =
                trials.iter().map(|trial| self.axis_values(trial)).collect();
            let to_key = |values: &Vec<f64>| values.iter().map(|value| value.to_bits()).collect();
            let keys: Vec<TrialKey> = values.iter().map(to_key).collect();
            let values = |k: usize, _: u64| values[k].clone();
            let reduce_rows =
                |k: usize, points: Vec<PointRows>| -> Result<RequestValues, StoreError> {
                    let to_distance = |point_rows: PointRows| -> Result<Option<f64>, StoreError> {
                        let value = self.point_value(&layout, values(k, 0), point_rows)?;
                        Ok(value.map(|value| self.quantity.distance(value)))
                    };
                    points.into_iter().map(to_distance).collect()
                };
            Ok(evaluator.evaluate(&keys, 1, &values, &reduce_rows)?.concat())
        }
    }

    /// Returns the values of the axes at a trial point.
    fn axis_values(&self, trial: &BoundaryTrial) -> Vec<f64> {
        // The axes beyond the second vary fastest.
        let mut values = self.plan.axis_values(trial.curve_index as u64);
        values[..2].copy_from_slice(&[trial.first_value, trial.second_value]);
        values
    }

    /// Returns the columns of trials: the axes, and the distance from the limit.
    pub fn trial_columns(&self) -> TrialColumns {
        let TracedQuantity { name, limit, .. } = &self.quantity;
        let description = format!(
            "signed distance of {name} from {limit}, negative on the good side; null where {name} \
             is not defined"
        );
        let distance = DeclaredColumn::new("distance", "1", description, CellType::Measured);
        TrialColumns { key_columns: axis_columns(&self.plan), value_columns: vec![distance] }
    }
}
