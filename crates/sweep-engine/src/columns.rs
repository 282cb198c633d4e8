//! Columns as functions of a row: those that compare a nonlinear with a linear motion, and
//! constructors for a model's own columns.

use sweep_parameter::{Channel, RatioLimits, Verdict, Worse};

use crate::RowSink;
use crate::store::{CellType, DeclaredColumn, PointRows};

/// The names of the two models, which begin the names of their columns.
pub const MODELS: [&str; 2] = ["nonlinear", "linear"];

/// The comparison of both models in a row, as columns read it. Lists are in the order of the plan's
/// channels, arrays in that of [`MODELS`].
#[derive(Clone, Copy, Debug)]
pub struct Compared<'a> {
    /// The amplitudes of each model; empty for a model that failed.
    pub amplitudes: [&'a [f64]; 2],
    /// The ratios and their verdict.
    pub verdict: &'a Verdict,
    /// Whether the estimated error is within the accuracy.
    pub converged: Option<bool>,
    /// Whether the motion is chaotic.
    pub sensitive: Option<bool>,
    /// The index of the method's name.
    pub method: usize,
    /// The estimated relative error.
    pub error: Option<f64>,
    /// The index of the status.
    pub status: usize,
    /// The time at which a model failed.
    pub fail_time_s: Option<f64>,
    /// The numbers of accepted steps.
    pub steps: [u64; 2],
    /// The numbers of rejected steps.
    pub rejected: [u64; 2],
}

/// A column of a result, as a function of a row.
pub struct ResultColumn<R> {
    /// The column's declaration in the file.
    pub declared: DeclaredColumn,
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
        Self { declared: DeclaredColumn::new(name, unit, description, kind), cell: Box::new(cell) }
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
        self.declared.metadata.worse = Some(worse);
        self
    }

    /// Marks the column as one whose worst value is in summaries of a result.
    pub fn in_summary(mut self) -> Self {
        self.declared.metadata.is_in_summary = true;
        self
    }

    /// Sets the limit between good and bad values, and the difference from it that is as important
    /// as a factor of e is for a ratio.
    pub fn limit(mut self, value: f64, scale: f64) -> Self {
        self.declared.metadata.limit = Some(value);
        self.declared.limit_scale = Some(scale);
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
pub fn declared<R>(columns: Vec<ResultColumn<R>>) -> Vec<DeclaredColumn> {
    columns.into_iter().map(|column| column.declared).collect()
}

/// The columns by which a row of type `R` compares both models.
pub struct ComparisonColumns<'a, R> {
    /// The compared channels.
    pub channels: &'a [Channel],
    /// The limits of the ratios.
    pub limits: RatioLimits,
    /// The function that returns the comparison in a row.
    pub compared: fn(&R) -> Compared<'_>,
}

impl<R: 'static> ComparisonColumns<'_, R> {
    /// Creates the columns of both models' amplitudes and of the ratios. `amplitude` and `ratio`
    /// describe them.
    pub fn amplitudes(&self, amplitude: &str, ratio: &str) -> Vec<ResultColumn<R>> {
        let compared = self.compared;
        let mut columns = Vec::new();
        for (k, model) in MODELS.into_iter().enumerate() {
            for (i, channel) in self.channels.iter().enumerate() {
                let motion = channel.description;
                let text = format!("{motion}: {amplitude}, {model} model; null if it failed");
                let name = format!("{model}_{}", channel.name);
                let get = move |row: &R| compared(row).amplitudes[k].get(i).copied();
                let column = ResultColumn::measured(name, channel.unit, text, get);
                columns.push(column.worse(Worse::Greater));
            }
        }
        for (i, channel) in self.channels.iter().enumerate() {
            let text = format!("{}: {ratio}", channel.description);
            let name = format!("ratio_{}", channel.name);
            let get = move |row: &R| compared(row).verdict.ratios.get(i).copied().flatten();
            let column = ResultColumn::measured(name, "1", text, get);
            columns.push(column.worse(Worse::Greater).limit(self.limits.upper, 1.0));
        }
        columns
    }

    /// Creates the columns of the greatest ratio and its channel, of the verdict, and of the
    /// estimated error. `methods` are the names of methods, `method_description` describes the
    /// column of them.
    pub fn verdict(
        &self,
        methods: Vec<&'static str>,
        method_description: &str,
    ) -> Vec<ResultColumn<R>> {
        let compared = self.compared;
        let RatioLimits { upper, lower } = self.limits;
        let mut columns =
            self.extreme_ratio("max", |verdict| verdict.greatest, Worse::Greater, upper);
        let mut rule = format!("ratio_max below {upper}");
        if let Some(limit) = lower {
            columns.extend(self.extreme_ratio("min", |verdict| verdict.least, Worse::Less, limit));
            rule.push_str(&format!(" and ratio_min above {limit}"));
        }
        let rule = format!("{rule}; null where ratio_max is");
        let sensitive = "true where the motion is chaotic, and the row's digits are those of one \
                         trajectory: a perturbed run separates exponentially, and its numbers \
                         or those of the level before differ by more than the accuracy; null \
                         where nothing was compared";
        let error = "greatest relative error of the row's numbers, from the differences of its \
                     method's levels; null where nothing was compared";
        let converged =
            "true where error is within the accuracy asked for; null where nothing was compared";
        columns.extend([
            ResultColumn::flag("reliable", rule, move |row| compared(row).verdict.reliable),
            ResultColumn::flag("sensitive", sensitive, move |row| compared(row).sensitive),
            ResultColumn::name("method", method_description, methods, move |row| {
                Some(compared(row).method)
            }),
            ResultColumn::measured("error", "1", error, move |row| compared(row).error)
                .worse(Worse::Greater),
            ResultColumn::flag("converged", converged, move |row| compared(row).converged),
        ]);
        columns
    }

    /// Creates the columns of the greatest or the least ratio and of its channel.
    fn extreme_ratio(
        &self,
        name: &str,
        extreme: fn(&Verdict) -> Option<(usize, f64)>,
        worse: Worse,
        limit: f64,
    ) -> Vec<ResultColumn<R>> {
        let compared = self.compared;
        let names = self.channels.iter().map(|channel| channel.name).collect();
        let ratio = move |row: &R| extreme(compared(row).verdict).map(|(_, ratio)| ratio);
        let channel = move |row: &R| extreme(compared(row).verdict).map(|(channel, _)| channel);
        let text = format!("{} of the defined ratios; null if none is", worse.extreme());
        let tie = format!("channel of ratio_{name}; the first of the plan's channels wins a tie");
        vec![
            ResultColumn::measured(format!("ratio_{name}"), "1", text, ratio)
                .worse(worse)
                .limit(limit, 1.0),
            ResultColumn::name(format!("ratio_{name}_channel"), tie, names, channel),
        ]
    }

    /// Creates the columns of status and steps of the two integrations, which every plan has.
    pub fn runs(&self, statuses: Vec<&'static str>) -> Vec<ResultColumn<R>> {
        let compared = self.compared;
        let status = "ok, or why the nonlinear model failed, or behind linear_ why the linear \
                      model alone did";
        let fail_time =
            "when the model named by status failed; null if none did or it never started";
        let fail_time_cell = move |row: &R| compared(row).fail_time_s.map(f64::to_bits);
        let mut columns = vec![
            ResultColumn::name("status", status, statuses, move |row| Some(compared(row).status)),
            ResultColumn::new("fail_time_s", "s", fail_time, CellType::Time, fail_time_cell)
                .worse(Worse::Less),
        ];
        let counts: [(&str, &str, fn(Compared<'_>) -> [u64; 2]); 2] =
            [("steps", "accepted", |row| row.steps), ("rejected", "rejected", |row| row.rejected)];
        for (name, kind, count) in counts {
            for (k, model) in MODELS.into_iter().enumerate() {
                let text = format!("{kind} integration steps, {model} model");
                let name = format!("{name}_{model}");
                let cell = move |row: &R| Some(count(compared(row))[k]);
                columns.push(ResultColumn::new(name, "1", text, CellType::Count, cell));
            }
        }
        columns
    }
}
