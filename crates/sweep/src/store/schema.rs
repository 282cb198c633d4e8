//! The result file's columns: a function of the plan, with units and descriptions that travel in
//! the file.

use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, BooleanArray, DictionaryArray, Float64Array, Int32Array, RecordBatch, StringArray,
    UInt64Array,
};
use arrow_schema::ArrowError;
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{WriterProperties, WriterPropertiesBuilder};
use parquet::schema::types::ColumnPath;
use serde_json::{Map, Value, json};
use washer_model::{Channel, Disturbance, Kind, Motion};

use super::Job;
use crate::table::{dictionary_entry, field_metadata};
use sweep_files::{FileKind, key};
use washer_row::{Level, Measures, Metric, Outcome, ROW_STATUSES, Trajectory, Verdict, row_status};

/// Rows in a row group: fixed, so that chunking leaves no trace in the file. A group of 25 columns
/// takes about 30 MB in memory while it is written.
pub(crate) const ROW_GROUP_ROWS: usize = 1 << 17;

/// Rows handed to the Parquet writer at once: fixed for the same reason, and a whole number of them
/// makes a group.
pub(crate) const BATCH_ROWS: usize = 1 << 12;

/// A swept parameter as a column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AxisColumn {
    /// Parameter name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// One line.
    pub description: String,
}

/// What the columns depend on.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// The axes, first to last.
    pub axes: Vec<AxisColumn>,
    /// The compared channels, in column order.
    pub channels: Vec<Channel>,
    /// A point is reliable when its greatest ratio is below this.
    pub ratio_limit: f64,
    /// What is measured of the motions.
    pub measures: Measures,
    /// What a row is about.
    pub rows: RowKind,
}

/// What a row is about.
#[derive(Clone, Debug, PartialEq)]
pub enum RowKind {
    /// A point over the run's time: `sweep run`.
    Run,
    /// A point at one of these speeds (rpm), speeds varying fastest: `sweep stability`.
    Dwell(Vec<f64>),
}

/// What a row's cells are taken from.
pub(crate) struct ResultRow {
    pub(crate) axis_values: Vec<f64>,
    pub(crate) outcome: Outcome,
    pub(crate) verdict: Verdict,
    /// Position in [`ROW_STATUSES`].
    pub(crate) status: usize,
    fail_time_s: Option<f64>,
}

type Get<T> = Box<dyn Fn(&ResultRow) -> T>;

/// How a column takes its cell from a row, which settles its type too.
enum Cell {
    Count(Get<u64>),
    KnownCount(Get<Option<u64>>),
    /// A number that hardly ever repeats.
    Measured(Get<Option<f64>>),
    /// A swept value, never null.
    Axis(Get<f64>),
    Time(Get<Option<f64>>),
    Flag(Get<Option<bool>>),
    /// A position in a list of names that is the same for every row, batch and run of the plan.
    Name(Vec<&'static str>, Get<Option<usize>>),
}

/// A column of the file.
struct ResultColumn {
    name: String,
    unit: String,
    description: String,
    cell: Cell,
}

impl ResultColumn {
    fn new(
        name: impl Into<String>,
        unit: &str,
        description: impl Into<String>,
        cell: Cell,
    ) -> Self {
        Self { name: name.into(), unit: unit.into(), description: description.into(), cell }
    }

    fn field(&self) -> Field {
        let names = || DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        let (data_type, nullable) = match self.cell {
            Cell::Count(_) => (DataType::UInt64, false),
            Cell::KnownCount(_) => (DataType::UInt64, true),
            Cell::Axis(_) => (DataType::Float64, false),
            Cell::Measured(_) | Cell::Time(_) => (DataType::Float64, true),
            Cell::Flag(_) => (DataType::Boolean, true),
            Cell::Name(..) => (names(), true),
        };
        let metadata = field_metadata(&self.unit, &self.description);
        Field::new(&self.name, data_type, nullable).with_metadata(metadata)
    }

    fn array(&self, rows: &[ResultRow]) -> Result<ArrayRef, ArrowError> {
        Ok(match &self.cell {
            Cell::Count(get) => Arc::new(UInt64Array::from_iter_values(rows.iter().map(get))),
            Cell::KnownCount(get) => Arc::new(rows.iter().map(get).collect::<UInt64Array>()),
            Cell::Axis(get) => Arc::new(Float64Array::from_iter_values(rows.iter().map(get))),
            Cell::Measured(get) | Cell::Time(get) => {
                Arc::new(rows.iter().map(get).collect::<Float64Array>())
            }
            Cell::Flag(get) => Arc::new(rows.iter().map(get).collect::<BooleanArray>()),
            Cell::Name(names, get) => {
                let position = |row: &ResultRow| get(row).and_then(|name| i32::try_from(name).ok());
                let keys: Int32Array = rows.iter().map(position).collect();
                let names = StringArray::from_iter_values(names);
                Arc::new(DictionaryArray::<Int32Type>::try_new(keys, Arc::new(names))?)
            }
        })
    }

    /// Name of the type in the column dictionary.
    const fn type_name(&self) -> &'static str {
        match self.cell {
            Cell::Count(_) | Cell::KnownCount(_) => "uint64",
            Cell::Axis(_) | Cell::Measured(_) | Cell::Time(_) => "float64",
            Cell::Flag(_) => "bool",
            Cell::Name(..) => "string",
        }
    }
}

/// The two models by name.
const MODELS: [(&str, fn(&Outcome) -> &Trajectory); 2] =
    [("nonlinear", |outcome| &outcome.nonlinear), ("linear", |outcome| &outcome.linear)];

impl Layout {
    /// Whether rows say what becomes of disturbances.
    pub(crate) fn with_growth(&self) -> bool {
        matches!(self.rows, RowKind::Dwell(_)) || self.measures.metrics.contains(&Metric::Growth)
    }

    /// The kind of the result file.
    pub(crate) const fn file_kind(&self) -> FileKind<'static> {
        match self.rows {
            RowKind::Run => FileKind::Map,
            RowKind::Dwell(_) => FileKind::Stability,
        }
    }

    /// Every column, in order: the one place that says what the file holds.
    fn columns(&self) -> Vec<ResultColumn> {
        let rows_a_point = match &self.rows {
            RowKind::Run => 1,
            RowKind::Dwell(speeds_rpm) => speeds_rpm.len() as u64,
        };
        let point = Cell::Count(Box::new(move |row| row.outcome.point / rows_a_point));
        let mut columns = vec![ResultColumn::new("point", "1", "index in grid order", point)];
        for (i, axis) in self.axes.iter().enumerate() {
            let cell = Cell::Axis(Box::new(move |row| {
                row.axis_values.get(i).copied().unwrap_or(f64::NAN)
            }));
            columns.push(ResultColumn::new(&axis.name, &axis.unit, &axis.description, cell));
        }
        if let RowKind::Dwell(_) = self.rows {
            columns.extend(growth_columns(""));
            columns.extend(self.amplitude_columns());
            let [greatest, channel, ..] = self.verdict_columns();
            columns.extend([greatest, channel, dwell_status_column()]);
            return columns;
        }
        columns.extend(self.amplitude_columns());
        columns.extend(self.verdict_columns());
        columns.extend(gap_columns());
        columns.extend(self.metric_columns());
        columns.extend(run_columns());
        columns
    }

    fn amplitude_columns(&self) -> Vec<ResultColumn> {
        let mut columns = Vec::new();
        for (model, of) in MODELS {
            for (i, channel) in self.channels.iter().enumerate() {
                let amplitude = match self.rows {
                    RowKind::Run => self.measures.criterion.amplitude(),
                    RowKind::Dwell(_) => "largest deviation from equilibrium over a turn",
                };
                let what = channel.description();
                let text = format!("{what}: {amplitude}, {model} model; null if it failed");
                let cell = Cell::Measured(Box::new(move |row| {
                    of(&row.outcome).amplitudes.get(i).copied()
                }));
                columns.push(ResultColumn::new(
                    format!("{model}_{}", channel.name()),
                    channel.unit(),
                    text,
                    cell,
                ));
            }
        }
        for (i, channel) in self.channels.iter().enumerate() {
            let ratio = match self.rows {
                RowKind::Run => self.measures.criterion.ratio(),
                RowKind::Dwell(_) => "nonlinear over linear amplitude; null where that is zero",
            };
            let text = format!("{}: {ratio}", channel.description());
            let cell =
                Cell::Measured(Box::new(move |row| row.verdict.ratios.get(i).copied().flatten()));
            columns.push(ResultColumn::new(format!("ratio_{}", channel.name()), "1", text, cell));
        }
        columns
    }

    fn verdict_columns(&self) -> [ResultColumn; 6] {
        let channels = self.channels.iter().map(|channel| channel.name()).collect();
        [
            ResultColumn::new(
                "ratio_max",
                "1",
                "greatest of the defined ratios; null if none is",
                Cell::Measured(Box::new(|row| row.verdict.greatest.map(|(_, ratio)| ratio))),
            ),
            ResultColumn::new(
                "ratio_max_channel",
                "",
                "channel of ratio_max; the first of the plan's channels wins a tie",
                Cell::Name(
                    channels,
                    Box::new(|row| row.verdict.greatest.map(|(channel, _)| channel)),
                ),
            ),
            ResultColumn::new(
                "reliable",
                "",
                format!("ratio_max below {}; null where ratio_max is", self.ratio_limit),
                Cell::Flag(Box::new(|row| row.verdict.reliable)),
            ),
            ResultColumn::new(
                "sensitive",
                "",
                "true where plain rk4 does not agree with itself at two steps: the motion is \
                 chaotic, and the row's \
                 digits are those of one trajectory; null where nothing was compared",
                Cell::Flag(Box::new(|row| row.outcome.sensitive)),
            ),
            ResultColumn::new(
                "method",
                "",
                "what the row's numbers come from: fast, fine and finest are rungs of the fast \
                 method, the others \
                 methods of that name",
                Cell::Name(
                    Level::ALL.map(Level::name).to_vec(),
                    Box::new(|row| Some(row.outcome.method as usize)),
                ),
            ),
            ResultColumn::new(
                "error",
                "1",
                "greatest relative error left in the row's numbers, from comparing two rungs of \
                 its method; null where \
                 nothing was compared",
                Cell::Measured(Box::new(|row| row.outcome.error)),
            ),
        ]
    }

    /// Columns of the metrics that are asked for, and no others.
    fn metric_columns(&self) -> Vec<ResultColumn> {
        let mut columns = Vec::new();
        let mut position = 0;
        for metric in &self.measures.metrics {
            if let Metric::Growth = metric {
                columns.extend(growth_columns("growth_"));
                continue;
            }
            if !metric.is_of_model() {
                let cell = Cell::Measured(Box::new(|row| row.outcome.static_sag_m));
                columns.push(ResultColumn::new(
                    metric.column(""),
                    metric.unit(),
                    metric.description(),
                    cell,
                ));
                continue;
            }
            for number in self.measures.numbers_of(*metric) {
                for (model, of) in MODELS {
                    let text =
                        format!("{}, {model} model; null if it failed", number.description());
                    let cell = Cell::Measured(Box::new(move |row| {
                        of(&row.outcome).metrics.get(position).copied()
                    }));
                    let name = number.column(model);
                    columns.push(ResultColumn::new(name, metric.unit(), text, cell));
                }
                position += 1;
            }
        }
        columns
    }

    /// The Arrow schema.
    #[must_use]
    pub fn schema(&self) -> SchemaRef {
        Arc::new(Schema::new(self.columns().iter().map(ResultColumn::field).collect::<Vec<_>>()))
    }

    /// The column dictionary: name to type, unit and description.
    fn dictionary(&self) -> Value {
        let entry = |column: &ResultColumn| {
            let entry = dictionary_entry(column.type_name(), &column.unit, &column.description);
            (column.name.clone(), entry)
        };
        Value::Object(self.columns().iter().map(entry).collect::<Map<_, _>>())
    }
}

/// Columns of the fastest growing disturbance at a constant speed. In maps they stand behind a
/// prefix, and the speed is one of them.
fn growth_columns(prefix: &str) -> Vec<ResultColumn> {
    let in_map = !prefix.is_empty();
    let mut columns = Vec::new();
    let numbers: [(&str, &str, &str, fn(&Disturbance) -> f64); 6] = [
        ("speed_rpm", "rpm", "the plan's speed at which a disturbance grows fastest", |fastest| {
            fastest.speed_rpm
        }),
        (
            "growth_per_s",
            "1/s",
            "how fast the fastest growing disturbance of the nonlinear response grows; negative \
             where all decay",
            Disturbance::growth_per_s,
        ),
        (
            "frequency_cpm",
            "1/min",
            "its frequency in cycles per minute, known up to whole multiples of the speed and \
             sign: the one from 0 to half the speed",
            Disturbance::frequency_cpm,
        ),
        (
            "other_frequency_cpm",
            "1/min",
            "the speed less frequency_cpm",
            Disturbance::other_frequency_cpm,
        ),
        (
            "multiplier_re",
            "1",
            "the suspension's largest Floquet multiplier, real part",
            |fastest| fastest.multiplier[0],
        ),
        ("multiplier_im", "1", "its imaginary part, not negative", |fastest| fastest.multiplier[1]),
    ];
    let of_dwell = usize::from(!in_map);
    for (name, unit, text, of) in numbers.into_iter().skip(of_dwell) {
        let cell =
            Cell::Measured(Box::new(move |row| Some(of(&row.outcome.growth.as_ref()?.fastest))));
        let name =
            if name.starts_with(prefix) { name.to_owned() } else { format!("{prefix}{name}") };
        columns.push(ResultColumn::new(name, unit, text, cell));
    }
    let kind = |row: &ResultRow| {
        let kind = row.outcome.growth.as_ref()?.fastest.kind();
        Kind::ALL.iter().position(|known| *known == kind)
    };
    columns.push(ResultColumn::new(
        format!("{prefix}kind"),
        "",
        "what a disturbance turns the response into: stable, period_doubling, quasi_periodic, fold",
        Cell::Name(Kind::ALL.map(Kind::name).to_vec(), Box::new(kind)),
    ));
    if !in_map {
        let stable =
            |row: &ResultRow| Some(row.outcome.growth.as_ref()?.fastest.kind() == Kind::Stable);
        let text = "true where every disturbance decays";
        columns.push(ResultColumn::new("stable", "", text, Cell::Flag(Box::new(stable))));
    }
    for place in 0..2 {
        columns.extend(growing_mode_columns(prefix, place));
    }
    columns
}

/// Columns of one of the modes that take part in what grows.
fn growing_mode_columns(prefix: &str, place: usize) -> [ResultColumn; 3] {
    let mode = move |row: &ResultRow| row.outcome.growth.as_ref()?.modes[place];
    let which = if place == 0 { "that takes most part in" } else { "next to that in" };
    let name = format!("{prefix}mode_{}", place + 1);
    [
        ResultColumn::new(
            name.clone(),
            "1",
            format!(
                "number, by frequency at this speed, of the linear model's mode {which} what \
                 grows; null where nothing grows, or no such mode is needed"
            ),
            Cell::KnownCount(Box::new(move |row| Some(u64::from(mode(row)?.number)))),
        ),
        ResultColumn::new(
            format!("{name}_name"),
            "",
            "what moves in it",
            Cell::Name(Motion::NAMES.to_vec(), Box::new(move |row| Some(mode(row)?.name as usize))),
        ),
        ResultColumn::new(
            format!("{name}_cpm"),
            "1/min",
            "its damped natural frequency at this speed in cycles per minute",
            Cell::Measured(Box::new(move |row| Some(mode(row)?.frequency_cpm))),
        ),
    ]
}

/// The status of a dwell.
fn dwell_status_column() -> ResultColumn {
    ResultColumn::new(
        "status",
        "",
        "ok, or why there is no response",
        Cell::Name(ROW_STATUSES.to_vec(), Box::new(|row| Some(row.status))),
    )
}

/// Columns of the least gaps, the same for every plan.
fn gap_columns() -> Vec<ResultColumn> {
    let mut columns = Vec::new();
    for (model, of) in MODELS {
        let text = format!(
            "least gap between drum and tub over the whole run, {model} model; negative where \
             they clash; null if \
             it failed"
        );
        let cell = Cell::Measured(Box::new(move |row| of(&row.outcome).min_gap_m));
        columns.push(ResultColumn::new(format!("min_gap_{model}_m"), "m", text, cell));
    }
    columns
}

/// Columns about the two integrations, the same for every plan.
fn run_columns() -> Vec<ResultColumn> {
    let mut columns = Vec::new();
    columns.push(ResultColumn::new(
        "status",
        "",
        "ok, or why the nonlinear model failed, or behind linear_ why the linear model alone did",
        Cell::Name(ROW_STATUSES.to_vec(), Box::new(|row| Some(row.status))),
    ));
    columns.push(ResultColumn::new(
        "fail_time_s",
        "s",
        "when the model named by status failed; null if none did or it never started",
        Cell::Time(Box::new(|row| row.fail_time_s)),
    ));
    let counts: [(&str, &str, fn(&Trajectory) -> u64); 2] = [
        ("steps", "accepted", |model| model.steps),
        ("rejected", "rejected", |model| model.rejected),
    ];
    for (name, kind, count) in counts {
        for (model, of) in MODELS {
            let text = format!("{kind} integration steps, {model} model");
            let cell = Cell::Count(Box::new(move |row| count(of(&row.outcome))));
            columns.push(ResultColumn::new(format!("{name}_{model}"), "1", text, cell));
        }
    }
    columns
}

/// Writer settings and metadata of a result file. Nothing in them depends on when, where or how the
/// run went.
pub(crate) fn properties(job: &Job<'_>) -> WriterProperties {
    let pair = |key: &str, value: String| KeyValue::new(key.to_owned(), value);
    let mut metadata = vec![
        pair(key::PLAN, job.plan.to_string()),
        pair(key::PLAN_HASH, job.hash().to_hex().to_string()),
        pair(key::VERSION, job.version.to_owned()),
        pair(key::NUMERICS, job.numerics.to_string()),
        pair(key::COLUMNS, job.layout.dictionary().to_string()),
    ];
    if let RowKind::Dwell(speeds_rpm) = &job.layout.rows {
        metadata.push(pair(key::STABILITY, json!({ "speeds_rpm": speeds_rpm }).to_string()));
    }
    let builder = WriterProperties::builder()
        // The library's own default names its version, and an upgrade would change the bytes.
        .set_created_by(format!("sweep version {}", job.version))
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_max_row_group_row_count(Some(ROW_GROUP_ROWS))
        .set_max_row_group_bytes(None)
        .set_key_value_metadata(Some(metadata));
    job.layout.columns().iter().fold(builder, encoding).build()
}

fn encoding(builder: WriterPropertiesBuilder, column: &ResultColumn) -> WriterPropertiesBuilder {
    let path = ColumnPath::from(column.name.as_str());
    match column.cell {
        // A dictionary of them would be written and thrown away.
        Cell::Measured(_) => builder.set_column_dictionary_enabled(path, false),
        _ => builder,
    }
}

/// Rows on their way into a batch.
pub(crate) struct ResultRows<'a> {
    layout: &'a Layout,
    schema: SchemaRef,
    columns: Vec<ResultColumn>,
    rows: Vec<ResultRow>,
}

impl<'a> ResultRows<'a> {
    pub(crate) fn new(layout: &'a Layout) -> Self {
        Self::sharing(layout, layout.schema())
    }

    /// With the schema of other batches of this layout: every field carries its description, so
    /// that one of their own would take 4 % of a batch's memory.
    pub(crate) fn sharing(layout: &'a Layout, schema: SchemaRef) -> Self {
        Self { layout, schema, columns: layout.columns(), rows: Vec::with_capacity(BATCH_ROWS) }
    }

    pub(crate) fn schema(&self) -> SchemaRef {
        Arc::clone(&self.schema)
    }

    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Adds a row: the axis values at the point, and what came of it. Returns the row with its
    /// verdict.
    pub(crate) fn push(&mut self, axis_values: Vec<f64>, outcome: Outcome) -> &ResultRow {
        let verdict = Verdict::new(&outcome, self.layout.channels.len(), self.layout.ratio_limit);
        let (status, fail_time_s) = row_status(&outcome);
        let row = self.rows.len();
        self.rows.push(ResultRow { axis_values, outcome, verdict, status, fail_time_s });
        &self.rows[row]
    }

    /// The rows so far as a batch; leaves none.
    pub(crate) fn take(&mut self) -> Result<RecordBatch, ArrowError> {
        let rows = std::mem::take(&mut self.rows);
        let arrays =
            self.columns.iter().map(|column| column.array(&rows)).collect::<Result<Vec<_>, _>>()?;
        self.rows = rows;
        self.rows.clear();
        RecordBatch::try_new(self.schema(), arrays)
    }
}

#[cfg(test)]
mod tests;
