//! Columns as functions of a row: those of every comparison of a nonlinear with a linear motion,
//! and the parts of a model's own columns.

use sweep_parameter::{Channel, Limit, RatioLimits, Worse};

use crate::store::{Column, Kind, Row};

/// The two models by name.
pub const MODELS: [&str; 2] = ["nonlinear", "linear"];

/// A point at which both models have run.
pub trait Compared: 'static {
    /// The amplitude of a channel of the plan by a model; none if it failed.
    fn amplitude(&self, model: usize, channel: usize) -> Option<f64>;
    /// The ratio of a channel of the plan, where there is one.
    fn ratio(&self, channel: usize) -> Option<f64>;
    /// The greatest ratio with its channel; the first wins a tie.
    fn greatest(&self) -> Option<(usize, f64)>;
    /// The least ratio with its channel; the first wins a tie.
    fn least(&self) -> Option<(usize, f64)>;
    /// Whether the ratios are within the limits.
    fn reliable(&self) -> Option<bool>;
    /// Whether the error left is within the accuracy asked for.
    fn converged(&self) -> Option<bool>;
    /// Whether the motion is chaotic.
    fn sensitive(&self) -> Option<bool>;
    /// The position of the method's name.
    fn method(&self) -> usize;
    /// The relative error left.
    fn error(&self) -> Option<f64>;
    /// The position of the status.
    fn status(&self) -> usize;
    /// When a model failed.
    fn fail_time_s(&self) -> Option<f64>;
    /// Accepted steps of a model.
    fn steps(&self, model: usize) -> u64;
    /// Rejected steps of a model.
    fn rejected(&self, model: usize) -> u64;
}

type Get<R, T> = Box<dyn Fn(&R) -> T + Send + Sync>;

/// How a column takes its cell from a row, which settles its type too.
pub enum Cell<R> {
    /// Never null.
    Count(Get<R, u64>),
    /// Null where not known.
    KnownCount(Get<R, Option<u64>>),
    /// A number that hardly ever repeats.
    Measured(Get<R, Option<f64>>),
    /// A number that may repeat.
    Time(Get<R, Option<f64>>),
    /// True or false.
    Flag(Get<R, Option<bool>>),
    /// A position in a list of names that is the same for every row, batch and run of the plan.
    Name(Vec<&'static str>, Get<R, Option<usize>>),
}

/// A column of the file.
pub struct ResultColumn<R> {
    /// What the file says of it.
    pub declared: Column,
    cell: Cell<R>,
}

impl<R> ResultColumn<R> {
    /// A column.
    pub fn new(
        name: impl Into<String>,
        unit: &str,
        description: impl Into<String>,
        cell: Cell<R>,
    ) -> Self {
        let kind = match &cell {
            Cell::Count(_) => Kind::Count,
            Cell::KnownCount(_) => Kind::KnownCount,
            Cell::Measured(_) => Kind::Measured,
            Cell::Time(_) => Kind::Time,
            Cell::Flag(_) => Kind::Flag,
            Cell::Name(names, _) => Kind::Name(names.clone()),
        };
        Self { declared: Column::new(name, unit, description, kind), cell }
    }

    /// The same, with which way it is bad.
    pub fn worse(mut self, worse: Worse) -> Self {
        self.declared.worse = Some(worse);
        self
    }

    /// The same, with the limit that has a meaning.
    pub fn limit(mut self, value: f64, scale: f64) -> Self {
        self.declared.limit = Some(Limit { value, scale });
        self
    }

    /// Its number of a row, if it is a column of numbers.
    pub fn number(&self, row: &R) -> Option<f64> {
        match &self.cell {
            Cell::Count(get) => Some(get(row) as f64),
            Cell::KnownCount(get) => get(row).map(|count| count as f64),
            Cell::Measured(get) | Cell::Time(get) => get(row),
            Cell::Flag(_) | Cell::Name(..) => None,
        }
    }

    /// Its cell of a row.
    pub fn cell(&self, row: &R) -> Option<u64> {
        match &self.cell {
            Cell::Count(get) => Some(get(row)),
            Cell::KnownCount(get) => get(row),
            Cell::Measured(get) | Cell::Time(get) => get(row).map(f64::to_bits),
            Cell::Flag(get) => get(row).map(u64::from),
            Cell::Name(_, get) => get(row).map(|name| name as u64),
        }
    }
}

/// The cells of a row.
pub fn row<R>(columns: &[ResultColumn<R>], of: &R) -> Row {
    columns.iter().map(|column| column.cell(of)).collect()
}

/// Amplitudes of both models and ratios. `amplitude` and `ratio` are what these are of.
pub fn amplitude_columns<R: Compared, C: Channel>(
    channels: &[C],
    limits: RatioLimits,
    amplitude: &str,
    ratio: &str,
) -> Vec<ResultColumn<R>> {
    let mut columns = Vec::new();
    for (k, model) in MODELS.into_iter().enumerate() {
        for (i, channel) in channels.iter().enumerate() {
            let what = channel.description();
            let text = format!("{what}: {amplitude}, {model} model; null if it failed");
            let cell = Cell::Measured(Box::new(move |row: &R| row.amplitude(k, i)));
            let name = format!("{model}_{}", channel.name());
            let column = ResultColumn::new(name, channel.unit(), text, cell);
            columns.push(column.worse(Worse::Greater));
        }
    }
    for (i, channel) in channels.iter().enumerate() {
        let text = format!("{}: {ratio}", channel.description());
        let cell = Cell::Measured(Box::new(move |row: &R| row.ratio(i)));
        let column = ResultColumn::new(format!("ratio_{}", channel.name()), "1", text, cell);
        columns.push(column.worse(Worse::Greater).limit(limits.most, 1.0));
    }
    columns
}

/// The verdict, and how far it can be trusted; the greatest ratio and its channel come first.
/// `methods` are the names of methods, `told` what they
/// are.
pub fn verdict_columns<R: Compared, C: Channel>(
    channels: &[C],
    limits: RatioLimits,
    methods: Vec<&'static str>,
    told: &str,
) -> Vec<ResultColumn<R>> {
    let mut columns = extreme_ratio(channels, "max", R::greatest, Worse::Greater, limits.most);
    let mut rule = format!("ratio_max below {}", limits.most);
    if let Some(least) = limits.least {
        columns.extend(extreme_ratio(channels, "min", R::least, Worse::Less, least));
        rule.push_str(&format!(" and ratio_min above {least}"));
    }
    columns.extend([
        ResultColumn::new(
            "reliable",
            "",
            format!("{rule}; null where ratio_max is"),
            Cell::Flag(Box::new(|row: &R| row.reliable())),
        ),
        ResultColumn::new(
            "sensitive",
            "",
            "true where the motion is chaotic, and the row's digits are those of one trajectory: \
             plain rk4 does not agree with itself at two steps, and a near twin departs \
             exponentially; null where nothing was compared",
            Cell::Flag(Box::new(|row: &R| row.sensitive())),
        ),
        ResultColumn::new(
            "method",
            "",
            told,
            Cell::Name(methods, Box::new(|row: &R| Some(row.method()))),
        ),
        ResultColumn::new(
            "error",
            "1",
            "greatest relative error left in the row's numbers, from comparing two rungs of \
                 its method; null where \
                 nothing was compared",
            Cell::Measured(Box::new(|row: &R| row.error())),
        )
        .worse(Worse::Greater),
        ResultColumn::new(
            "converged",
            "",
            "true where error is within the accuracy asked for; null where nothing was compared",
            Cell::Flag(Box::new(|row: &R| row.converged())),
        ),
    ]);
    columns
}

/// The greatest or the least ratio, and its channel.
pub fn extreme_ratio<R: Compared, C: Channel>(
    channels: &[C],
    name: &str,
    of: fn(&R) -> Option<(usize, f64)>,
    worse: Worse,
    limit: f64,
) -> Vec<ResultColumn<R>> {
    let names = channels.iter().map(|channel| channel.name()).collect();
    let number = Cell::Measured(Box::new(move |row: &R| of(row).map(|(_, ratio)| ratio)));
    let channel = Cell::Name(names, Box::new(move |row: &R| of(row).map(|(channel, _)| channel)));
    let text = format!("{} of the defined ratios; null if none is", worse.extreme());
    let tie = format!("channel of ratio_{name}; the first of the plan's channels wins a tie");
    vec![
        ResultColumn::new(format!("ratio_{name}"), "1", text, number)
            .worse(worse)
            .limit(limit, 1.0),
        ResultColumn::new(format!("ratio_{name}_channel"), "", tie, channel),
    ]
}

/// Columns about the two integrations, the same for every plan.
pub fn run_columns<R: Compared>(statuses: Vec<&'static str>) -> Vec<ResultColumn<R>> {
    let mut columns = Vec::new();
    columns.push(ResultColumn::new(
        "status",
        "",
        "ok, or why the nonlinear model failed, or behind linear_ why the linear model alone did",
        Cell::Name(statuses, Box::new(|row: &R| Some(row.status()))),
    ));
    columns.push(
        ResultColumn::new(
            "fail_time_s",
            "s",
            "when the model named by status failed; null if none did or it never started",
            Cell::Time(Box::new(|row: &R| row.fail_time_s())),
        )
        .worse(Worse::Less),
    );
    let counts: [(&str, &str, fn(&R, usize) -> u64); 2] =
        [("steps", "accepted", R::steps), ("rejected", "rejected", R::rejected)];
    for (name, kind, count) in counts {
        for (k, model) in MODELS.into_iter().enumerate() {
            let text = format!("{kind} integration steps, {model} model");
            let cell = Cell::Count(Box::new(move |row: &R| count(row, k)));
            columns.push(ResultColumn::new(format!("{name}_{model}"), "1", text, cell));
        }
    }
    columns
}
