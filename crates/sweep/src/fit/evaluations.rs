//! The stored evaluations of a fit. A repeated fit reads them instead of computing them again, and
//! has the same result bit by bit.

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

/// The duration from which on an evaluation is written immediately. Basis: a write takes some
/// milliseconds. Doubling it doubles the computing time that a killed process may lose.
const IMMEDIATE_WRITE_TIME: Duration = Duration::from_millis(100);

/// The store of a problem's evaluations.
#[derive(Debug)]
pub(crate) struct Evaluations {
    unknown_count: usize,
    signal_count: usize,
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
        let unknown_count = problem.unknown_count();
        let signal_count = problem.signals().count();
        Ok(Self { unknown_count, signal_count, trials: Mutex::new(trials) })
    }

    /// Returns the normal equations at some unknowns: those in the store, or else computed ones.
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
        let cells = self.equation_cells(equations.as_ref());
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
    fn equation_cells(&self, equations: Option<&NormalEquations>) -> RowCells {
        let Some(NormalEquations { cost, sigma, normal_matrix: normal, rhs }) = equations else {
            return vec![
                None;
                1 + self.signal_count + (self.unknown_count + 1) * self.unknown_count
            ];
        };
        let numbers = std::iter::once(cost).chain(sigma).chain(normal.iter().flatten()).chain(rhs);
        numbers.map(|number| Some(number.to_bits())).collect()
    }

    /// Returns the normal equations of these cells; `None` for a failed evaluation.
    fn read_equations(&self, cells: &RowCells) -> Option<NormalEquations> {
        let numbers: Option<Vec<f64>> = cells.iter().map(|cell| cell.map(f64::from_bits)).collect();
        let numbers = numbers?;
        let (cost, cells_after_cost) = numbers.split_first()?;
        let (sigma, cells_after_sigma) = cells_after_cost.split_at_checked(self.signal_count)?;
        let (normal, rhs) =
            cells_after_sigma.split_at_checked(self.unknown_count * self.unknown_count)?;
        Some(NormalEquations {
            cost: *cost,
            sigma: sigma.to_vec(),
            normal_matrix: normal.chunks(self.unknown_count.max(1)).map(<[f64]>::to_vec).collect(),
            rhs: rhs.to_vec(),
        })
    }
}

/// Returns the columns of evaluations: the unknowns, then the cost and the normal equations.
fn evaluation_columns(problem: &Problem<'_>) -> TrialColumns {
    let mut keys = Vec::new();
    for free in &problem.free_parameters {
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
        let shift_column = |case| {
            DeclaredColumn::new(format!("file_{case}_shift_s"), "s", description, CellType::Axis)
        };
        keys.extend((1..=problem.cases.len()).map(shift_column));
    }
    let unknown_numbers = 1..=problem.unknown_count();
    let number_column = |name: String, description: &str| {
        DeclaredColumn::new(name, "1", description, CellType::Measured)
    };
    let mut responses = vec![number_column("cost".to_owned(), "twice the negative log-likelihood")];
    for signal in 1..=problem.signals().count() {
        responses.push(number_column(format!("noise_{signal}"), "noise of a signal, in its unit"));
    }
    for row in unknown_numbers.clone() {
        for column in unknown_numbers.clone() {
            let description = "entry of the normal matrix J'WJ";
            responses.push(number_column(format!("normal_{row}_{column}"), description));
        }
    }
    for row in unknown_numbers {
        responses.push(number_column(format!("gradient_{row}"), "entry of J'Wr"));
    }
    TrialColumns { key_columns: keys, value_columns: responses }
}

/// Returns the job of a problem, which identifies its store: the plans of its cases, a hash of the
/// measurements, and the options of the fit.
fn evaluation_job<'a>(problem: &'a Problem<'_>) -> Job<'a> {
    let mut measurement_hasher = blake3::Hasher::new();
    for case in &problem.cases {
        measurement_hasher.update(format!("{:?}", case.measurement).as_bytes());
    }
    let Problem { free_parameters: free, model_kind: model, fits_shift, method, .. } = problem;
    let mut job = Job::new(&problem.cases[0].plan);
    job.layout.kind = FileKind::ModelFile;
    let plans = problem.cases.iter().map(|case| case.plan.to_json());
    job.plan["fit"] = json!({
        "cases": plans.collect::<Vec<_>>(),
        "measured": measurement_hasher.finalize().to_hex().as_str(),
        "free": free.iter().map(|free| format!("{free:?}")).collect::<Vec<_>>(),
        "model": model.name(),
        "shift": fits_shift,
        "method": format!("{method:?}"),
    });
    job
}
