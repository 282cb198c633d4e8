//! Columns as functions of a row: those that compare a nonlinear with a linear motion, and
//! constructors for a model's own columns.

use sweep_parameter::{Channel, RatioLimits, Verdict, Worse};

use crate::RowSink;
use crate::store::{CellType, DeclaredColumn, PointRows};

/// The names of the two models, which begin the names of their columns.
pub const MODEL_NAMES: [&str; 2] = ["nonlinear", "linear"];

/// The comparison of both models in a row, as columns read it. Lists are in the order of the plan's
/// channels, arrays in that of [`MODEL_NAMES`].
#[derive(Clone, Copy, Debug)]
pub struct RowComparison<'a> {
    /// The amplitudes of each model; empty for a model that failed.
    pub amplitudes: [&'a [f64]; 2],
    /// The ratios and their verdict.
    pub verdict: &'a Verdict,
    /// Whether the estimated error is within the accuracy.
    pub is_converged: Option<bool>,
    /// Whether the motion is chaotic.
    pub is_sensitive: Option<bool>,
    /// The index of the method's name.
    pub method_index: usize,
    /// The estimated relative error.
    pub relative_error: Option<f64>,
    /// The index of the status.
    pub status_index: usize,
    /// The time at which a model failed.
    pub fail_time_s: Option<f64>,
    /// The numbers of accepted steps.
    pub accepted_steps: [u64; 2],
    /// The numbers of rejected steps.
    pub rejected_steps: [u64; 2],
}

/// A column of a result, as a function of a row.
pub struct ResultColumn<R> {
    /// The column's declaration in the file.
    pub declaration: DeclaredColumn,
    /// The function that returns a row's cell.
    pub cell: Box<dyn Fn(&R) -> Option<u64> + Send + Sync>,
}

impl<R> ResultColumn<R> {
    /// Creates a column with cells of a kind.
    pub fn new(
        name: impl Into<String>,
        unit: &str,
        description: impl Into<String>,
        kind: CellType,
        cell: impl Fn(&R) -> Option<u64> + Send + Sync + 'static,
    ) -> Self {
        Self {
            declaration: DeclaredColumn::new(name, unit, description, kind),
            cell: Box::new(cell),
        }
    }

    /// Creates a column of measured numbers, which rarely repeat; null where there is none.
    pub fn measured(
        name: impl Into<String>,
        unit: &str,
        description: impl Into<String>,
        get: impl Fn(&R) -> Option<f64> + Send + Sync + 'static,
    ) -> Self {
        let cell = move |row: &R| get(row).map(f64::to_bits);
        Self::new(name, unit, description, CellType::Measured, cell)
    }

    /// Creates a column of names, null where there is none.
    pub fn name(
        name: impl Into<String>,
        description: impl Into<String>,
        names: Vec<&'static str>,
        get: impl Fn(&R) -> Option<usize> + Send + Sync + 'static,
    ) -> Self {
        let cell = move |row: &R| get(row).map(|name| name as u64);
        Self::new(name, "", description, CellType::Name(names), cell)
    }

    /// Creates a column of truth values, null where they are unknown.
    pub fn flag(
        name: impl Into<String>,
        description: impl Into<String>,
        get: impl Fn(&R) -> Option<bool> + Send + Sync + 'static,
    ) -> Self {
        Self::new(name, "", description, CellType::Flag, move |row| get(row).map(u64::from))
    }

    /// Sets the direction in which values are worse.
    pub fn worse(mut self, worse: Worse) -> Self {
        self.declaration.metadata.worse = Some(worse);
        self
    }

    /// Marks the column as one whose worst value is in summaries of a result.
    pub fn in_summary(mut self) -> Self {
        self.declaration.metadata.is_in_summary = true;
        self
    }

    /// Sets the limit between good and bad values, and the difference from it that is as important
    /// as a factor of e is for a ratio.
    pub fn limit(mut self, value: f64, scale: f64) -> Self {
        self.declaration.metadata.limit = Some(value);
        self.declaration.limit_scale = Some(scale);
        self
    }
}

/// Returns the cells of the rows of a point.
pub fn point_rows<'r, R: 'r>(
    columns: &[ResultColumn<R>],
    point: u64,
    rows: impl IntoIterator<Item = &'r R>,
) -> PointRows {
    let cells = |row: &R| columns.iter().map(|column| (column.cell)(row)).collect();
    PointRows { point, rows: rows.into_iter().map(cells).collect() }
}

/// Passes the rows of a point to a sink, as cells of columns.
pub fn pass_rows<'r, R: 'r>(
    columns: &[ResultColumn<R>],
    point: u64,
    rows: impl IntoIterator<Item = &'r R>,
    sink: &RowSink<'_>,
) {
    sink(point_rows(columns, point, rows));
}

/// Returns the declarations of columns.
pub fn into_declarations<R>(columns: Vec<ResultColumn<R>>) -> Vec<DeclaredColumn> {
    columns.into_iter().map(|column| column.declaration).collect()
}

/// The columns by which a row of type `R` compares both models.
pub struct ComparisonColumns<'a, R> {
    /// The compared channels.
    pub channels: &'a [Channel],
    /// The limits of the ratios.
    pub limits: RatioLimits,
    /// The function that returns the comparison in a row.
    pub row_comparison: fn(&R) -> RowComparison<'_>,
}

impl<R: 'static> ComparisonColumns<'_, R> {
    /// Creates the columns of both models' amplitudes and of the ratios. `amplitude` and `ratio`
    /// describe them.
    pub fn amplitude_columns(&self, amplitude: &str, ratio: &str) -> Vec<ResultColumn<R>> {
        let row_comparison = self.row_comparison;
        let mut columns = Vec::new();
        for (k, model) in MODEL_NAMES.into_iter().enumerate() {
            for (i, channel) in self.channels.iter().enumerate() {
                let motion = channel.description;
                let column_description =
                    format!("{motion}: {amplitude}, {model} model; null if it failed");
                let name = format!("{model}_{}", channel.name);
                let cell_of_row = move |row: &R| row_comparison(row).amplitudes[k].get(i).copied();
                let column =
                    ResultColumn::measured(name, channel.unit, column_description, cell_of_row);
                columns.push(column.worse(Worse::Greater));
            }
        }
        for (i, channel) in self.channels.iter().enumerate() {
            let column_description = format!("{}: {ratio}", channel.description);
            let name = format!("ratio_{}", channel.name);
            let cell_of_row =
                move |row: &R| row_comparison(row).verdict.ratios.get(i).copied().flatten();
            let column = ResultColumn::measured(name, "1", column_description, cell_of_row);
            columns.push(column.worse(Worse::Greater).limit(self.limits.upper, 1.0));
        }
        columns
    }

    /// Creates the columns of the greatest ratio and its channel, of the verdict, and of the
    /// estimated error. `methods` are the names of methods, `method_description` describes the
    /// column of them.
    pub fn verdict_columns(
        &self,
        methods: Vec<&'static str>,
        method_description: &str,
    ) -> Vec<ResultColumn<R>> {
        let row_comparison = self.row_comparison;
        let RatioLimits { upper, lower } = self.limits;
        let mut columns =
            self.extreme_ratio_columns("max", |verdict| verdict.greatest, Worse::Greater, upper);
        let mut reliable_rule = format!("ratio_max below {upper}");
        if let Some(limit) = lower {
            columns.extend(self.extreme_ratio_columns(
                "min",
                |verdict| verdict.least,
                Worse::Less,
                limit,
            ));
            reliable_rule.push_str(&format!(" and ratio_min above {limit}"));
        }
        let reliable_rule = format!("{reliable_rule}; null where ratio_max is");
        let sensitive_description = "true where the motion is chaotic, and the row's digits are \
                                     those of one trajectory: a perturbed run separates \
                                     exponentially, and its numbers differ by more than half the \
                                     accuracy; null where nothing was compared";
        let error_description = "greatest relative error of the row's numbers, from the \
                                 differences of its method's levels; null where nothing was \
                                 compared";
        let converged_description =
            "true where error is within the accuracy asked for; null where nothing was compared";
        columns.extend([
            ResultColumn::flag("reliable", reliable_rule, move |row| {
                row_comparison(row).verdict.reliable
            }),
            ResultColumn::flag("sensitive", sensitive_description, move |row| {
                row_comparison(row).is_sensitive
            }),
            ResultColumn::name("method", method_description, methods, move |row| {
                Some(row_comparison(row).method_index)
            }),
            ResultColumn::measured("error", "1", error_description, move |row| {
                row_comparison(row).relative_error
            })
            .worse(Worse::Greater),
            ResultColumn::flag("converged", converged_description, move |row| {
                row_comparison(row).is_converged
            }),
        ]);
        columns
    }

    /// Creates the columns of the greatest or the least ratio and of its channel.
    fn extreme_ratio_columns(
        &self,
        name: &str,
        extreme: fn(&Verdict) -> Option<(usize, f64)>,
        worse: Worse,
        limit: f64,
    ) -> Vec<ResultColumn<R>> {
        let row_comparison = self.row_comparison;
        let channel_names = self.channels.iter().map(|channel| channel.name).collect();
        let ratio_of_row = move |row: &R| {
            extreme(row_comparison(row).verdict).map(|(_, ratio_of_row)| ratio_of_row)
        };
        let channel =
            move |row: &R| extreme(row_comparison(row).verdict).map(|(channel, _)| channel);
        let ratio_description =
            format!("{} of the defined ratios; null if none is", worse.worst_value_word());
        let channel_description =
            format!("channel of ratio_{name}; the first of the plan's channels wins a tie");
        vec![
            ResultColumn::measured(format!("ratio_{name}"), "1", ratio_description, ratio_of_row)
                .worse(worse)
                .limit(limit, 1.0),
            ResultColumn::name(
                format!("ratio_{name}_channel"),
                channel_description,
                channel_names,
                channel,
            ),
        ]
    }

    /// Creates the columns of status and steps of the two integrations, which every plan has.
    pub fn run_columns(&self, statuses: Vec<&'static str>) -> Vec<ResultColumn<R>> {
        let row_comparison = self.row_comparison;
        let status_description = "ok, or why the nonlinear model failed, or behind linear_ why the \
                                  linear model alone did";
        let fail_time_description =
            "when the model named by status failed; null if none did or it never started";
        let fail_time_cell = move |row: &R| row_comparison(row).fail_time_s.map(f64::to_bits);
        let mut columns = vec![
            ResultColumn::name("status", status_description, statuses, move |row| {
                Some(row_comparison(row).status_index)
            }),
            ResultColumn::new(
                "fail_time_s",
                "s",
                fail_time_description,
                CellType::Time,
                fail_time_cell,
            )
            .worse(Worse::Less),
        ];
        let step_counts: [(&str, &str, fn(RowComparison<'_>) -> [u64; 2]); 2] = [
            ("steps", "accepted", |row| row.accepted_steps),
            ("rejected", "rejected", |row| row.rejected_steps),
        ];
        for (name, kind, count) in step_counts {
            for (k, model) in MODEL_NAMES.into_iter().enumerate() {
                let count_description = format!("{kind} integration steps, {model} model");
                let name = format!("{name}_{model}");
                let cell = move |row: &R| Some(count(row_comparison(row))[k]);
                columns.push(ResultColumn::new(
                    name,
                    "1",
                    count_description,
                    CellType::Count,
                    cell,
                ));
            }
        }
        columns
    }
}
