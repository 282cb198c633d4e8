//! The stored evaluations of a fit. A repeated fit reads them in place of computing them, and gives
//! the same bits.

use std::path::Path;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use serde_json::json;
use sweep_engine::store::{
    CellType, DeclaredColumn, Job, OpenOutcome, RowCells, StoreError, TrialColumns, TrialKey,
    Trials,
};
use sweep_engine::tell;
use sweep_files::FileKind;
use sweep_files::panics::lock;

use super::model::{NormalEquations, Problem};

/// The time of an evaluation that is written at once. Basis: a write takes some milliseconds.
/// Doubling it doubles the computing time that a killed process may lose.
const IMMEDIATE_WRITE_TIME: Duration = Duration::from_millis(100);

/// The evaluations of a problem, in the store.
#[derive(Debug)]
pub(crate) struct Evaluations {
    unknowns: usize,
    signals: usize,
    trials: Mutex<Trials>,
}

impl Evaluations {
    /// Opens the evaluations of a problem whose machine file goes to `output`.
    ///
    /// # Errors
    /// Returns the errors of [`Trials::open`].
    pub(crate) fn open(
        output: &Path,
        problem: &Problem<'_>,
        fresh: bool,
    ) -> Result<Self, StoreError> {
        let OpenOutcome::Open(mut trials) =
            Trials::open(output, &evaluation_job(problem), evaluation_columns(problem), fresh)?
        else {
            let path = output.display();
            return Err(StoreError::Refused(format!("{path} is the result of another command")));
        };
        trials.take_notes().iter().for_each(|note| tell(note));
        if trials.trial_count() > 0 {
            tell(&format!("going on: {} evaluations are there", trials.trial_count()));
        }
        let unknowns = problem.unknowns();
        let signals = problem.signals().count();
        Ok(Self { unknowns, signals, trials: Mutex::new(trials) })
    }

    /// Returns the normal equations at some unknowns, stored or computed now.
    ///
    /// # Errors
    /// Returns the errors of `compute` and of the file system.
    pub(crate) fn find_or_compute<E: From<StoreError>>(
        &self,
        x: &[f64],
        compute: impl FnOnce() -> Result<Option<NormalEquations>, E>,
    ) -> Result<Option<NormalEquations>, E> {
        let key: TrialKey = x.iter().map(|x| x.to_bits()).collect();
        if let Some(cells) = lock(&self.trials).find_values(&key) {
            return Ok(self.read_equations(cells));
        }
        let start_time = Instant::now();
        let equations = compute()?;
        let is_costly = start_time.elapsed() >= IMMEDIATE_WRITE_TIME;
        let cells = self.to_cells(equations.as_ref());
        let mut trials = lock(&self.trials);
        trials.add_trial(key, cells)?;
        if is_costly || trials.is_write_due() {
            trials.write()?;
        }
        drop(trials);
        Ok(equations)
    }

    /// Writes the evaluations that are only in memory.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub(crate) fn write(&self) -> Result<(), StoreError> {
        lock(&self.trials).write()
    }

    /// Removes the stored evaluations once the machine file is written, and returns a note if that
    /// fails.
    pub(crate) fn complete(self) -> Option<String> {
        sweep_files::panics::into_content(self.trials).complete()
    }

    /// Returns the cells of normal equations, in the order of [`evaluation_columns`].
    fn to_cells(&self, equations: Option<&NormalEquations>) -> RowCells {
        let Some(NormalEquations { cost, sigma, normal, rhs }) = equations else {
            return vec![None; 1 + self.signals + (self.unknowns + 1) * self.unknowns];
        };
        let numbers = std::iter::once(cost).chain(sigma).chain(normal.iter().flatten()).chain(rhs);
        numbers.map(|number| Some(number.to_bits())).collect()
    }

    /// Returns the normal equations of these cells; `None` for a failed evaluation.
    fn read_equations(&self, cells: &RowCells) -> Option<NormalEquations> {
        let numbers: Option<Vec<f64>> = cells.iter().map(|cell| cell.map(f64::from_bits)).collect();
        let numbers = numbers?;
        let (cost, rest) = numbers.split_first()?;
        let (sigma, rest) = rest.split_at_checked(self.signals)?;
        let (normal, rhs) = rest.split_at_checked(self.unknowns * self.unknowns)?;
        Some(NormalEquations {
            cost: *cost,
            sigma: sigma.to_vec(),
            normal: normal.chunks(self.unknowns.max(1)).map(<[f64]>::to_vec).collect(),
            rhs: rhs.to_vec(),
        })
    }
}

/// Returns the columns of evaluations: the unknowns, then the cost and the normal equations.
fn evaluation_columns(problem: &Problem<'_>) -> TrialColumns {
    let mut keys = Vec::new();
    for free in &problem.free {
        let parameter = &free.parameter;
        let name = match free.case {
            None => parameter.name().to_owned(),
            Some(case) => format!("file_{}_{}", case + 1, parameter.name()),
        };
        let description = parameter.description();
        keys.push(DeclaredColumn::new(name, parameter.unit(), description, CellType::Axis));
    }
    if problem.fits_shift {
        let description = "shift of the file's clock";
        let shift = |case| {
            DeclaredColumn::new(format!("file_{case}_shift_s"), "s", description, CellType::Axis)
        };
        keys.extend((1..=problem.cases.len()).map(shift));
    }
    let unknowns = 1..=problem.unknowns();
    let number = |name: String, description: &str| {
        DeclaredColumn::new(name, "1", description, CellType::Measured)
    };
    let mut responses = vec![number("cost".to_owned(), "twice the negative log-likelihood")];
    for signal in 1..=problem.signals().count() {
        responses.push(number(format!("noise_{signal}"), "noise of a signal, in its unit"));
    }
    for row in unknowns.clone() {
        for column in unknowns.clone() {
            let description = "entry of the normal matrix J'WJ";
            responses.push(number(format!("normal_{row}_{column}"), description));
        }
    }
    for row in unknowns {
        responses.push(number(format!("gradient_{row}"), "entry of J'Wr"));
    }
    TrialColumns { key_columns: keys, value_columns: responses }
}

/// Returns the job of a problem: the plans of its cases, and a hash of the measurements.
fn evaluation_job<'a>(problem: &'a Problem<'_>) -> Job<'a> {
    let mut measurement = blake3::Hasher::new();
    for case in &problem.cases {
        measurement.update(format!("{:?}", case.measurement).as_bytes());
    }
    let Problem { free, model, fits_shift, method, .. } = problem;
    let mut job = Job::new(&problem.cases[0].plan);
    job.layout.kind = FileKind::ModelFile;
    let plans = problem.cases.iter().map(|case| case.plan.to_json());
    job.plan["fit"] = json!({
        "cases": plans.collect::<Vec<_>>(),
        "measured": measurement.finalize().to_hex().as_str(),
        "free": free.iter().map(|free| format!("{free:?}")).collect::<Vec<_>>(),
        "model": model.name(),
        "shift": fits_shift,
        "method": format!("{method:?}"),
    });
    job
}
