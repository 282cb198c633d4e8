//! Periodic responses over a grid and speeds: every point at every speed, on all threads.

pub(crate) mod file;
pub(crate) mod tongues;

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use lane_ode::Simd;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};
use washer_model::{Dwell, NoAnswer, Response, Target, Timing, prepare, respond};

use crate::engine::together_or_alone;
use crate::exit::Error;
use crate::interrupt::Interrupt;
use crate::plan::Plan;
use crate::progress::Progress;

/// Speeds of one point that are looked at together: enough to fill lanes, few enough that a signal
/// is soon heard.
const AT_ONCE: usize = 48;

/// Most rows: what stands in memory until the file is written is some 600 bytes each.
pub(crate) const MOST_ROWS: u64 = 10_000_000;

/// Why a row has no response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Missing {
    /// The machine has no static equilibrium.
    NoEquilibrium,
    /// Newton's method found none.
    NoResponse,
    /// The multipliers could not be computed.
    NoMultipliers,
    /// A defect of this program, kept to the row.
    Panicked,
}

impl Missing {
    /// As in the `status` column.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::NoEquilibrium => "no_equilibrium",
            Self::NoResponse => "no_response",
            Self::NoMultipliers => "no_multipliers",
            Self::Panicked => "panicked",
        }
    }
}

/// What is found of a row.
pub(crate) type Answer = Result<Box<Response>, Missing>;

/// Refuses a grid whose axes say something else than the speeds, or nothing at a constant speed.
///
/// # Errors
/// [`Error::Option`].
pub(crate) fn check(plan: &Plan, given: &str, speeds: usize) -> Result<(), Error> {
    let refuse = |expected: String| {
        Err(Error::Option { option: "--speed", given: given.to_owned(), expected })
    };
    for axis in &plan.axes {
        let name = axis.parameter.name();
        match axis.parameter.target() {
            Target::Spin => {
                return refuse(format!(
                    "a grid without the axis `{name}`: here the drum turns at each speed of \
                     --speed in turn, whatever its profile; remove the axis, and give its range \
                     as --speed"
                ));
            }
            Target::Window(_) => {
                return refuse(format!(
                    "a grid without the axis `{name}`: a periodic response is the same in every \
                     turn, and has no window; remove the axis"
                ));
            }
            Target::Machine | Target::Bearings(_) | Target::Springs(_) | Target::Dampers(_) => {}
        }
    }
    let rows = plan.points().saturating_mul(speeds as u64);
    if rows > MOST_ROWS {
        return refuse(format!(
            "at most {MOST_ROWS} rows; {} points at {speeds} speeds are {rows}",
            plan.points()
        ));
    }
    Ok(())
}

/// Every point's answers at every speed, in grid order; `None` if a signal stopped it. On all
/// threads of the rayon pool that it is called in.
pub(crate) fn answers(
    plan: &Plan,
    simd: Simd,
    speeds_rpm: &[f64],
    progress: &Mutex<Progress>,
    interrupt: &Interrupt,
) -> Option<Vec<Answer>> {
    let parts = speeds_rpm.len().div_ceil(AT_ONCE);
    let done = AtomicU64::new(0);
    let work = |unit: usize| {
        if interrupt.stopped() {
            return None;
        }
        let speeds_rpm = speeds_rpm.chunks(AT_ONCE).nth(unit % parts).unwrap_or_default();
        let answers = of_point(plan, simd, (unit / parts) as u64, speeds_rpm);
        let done = done.fetch_add(answers.len() as u64, Ordering::Relaxed);
        // A thread that finds another showing it goes on.
        if let Ok(mut progress) = progress.try_lock() {
            progress.show(done + answers.len() as u64);
        }
        Some(answers)
    };
    let units = usize::try_from(plan.points()).unwrap_or(usize::MAX).saturating_mul(parts);
    let found: Option<Vec<Vec<Answer>>> = (0..units).into_par_iter().map(work).collect();
    Some(found?.into_iter().flatten().collect())
}

/// One point at some speeds.
fn of_point(plan: &Plan, simd: Simd, point: u64, speeds_rpm: &[f64]) -> Vec<Answer> {
    let scenario = plan.scenario(point);
    // The response at a constant speed knows nothing of the run.
    let timing = Timing { end_s: 1.0, window_s: [0.0, 1.0], checkpoints: 0 };
    let machine = [(scenario.machine, scenario.spin)];
    let ready = together_or_alone(
        &machine,
        |machine| {
            let ready = prepare(simd, machine, &timing).into_iter();
            ready.map(|point| point.map_err(|_| Missing::NoEquilibrium)).collect()
        },
        || Err(Missing::Panicked),
    );
    let Some(Ok(point)) = ready.first() else {
        let missing = match ready.first() {
            Some(Err(missing)) => *missing,
            _ => Missing::Panicked,
        };
        return speeds_rpm.iter().map(|_| Err(missing)).collect();
    };
    let dwells: Vec<Dwell<'_>> =
        speeds_rpm.iter().map(|&speed_rpm| Dwell { point, speed_rpm }).collect();
    together_or_alone(
        &dwells,
        |dwells| {
            let answers = respond(simd, dwells).into_iter();
            answers
                .map(|answer| match answer {
                    Ok(response) => Ok(Box::new(response)),
                    Err(NoAnswer::NoResponse) => Err(Missing::NoResponse),
                    Err(NoAnswer::Eigenvalues) => Err(Missing::NoMultipliers),
                })
                .collect()
        },
        || Err(Missing::Panicked),
    )
}
