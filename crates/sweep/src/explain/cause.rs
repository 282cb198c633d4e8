//! Whether tongues come early enough, and grow enough, to make a run deviate.

use washer_model::{History, Method, ModelKind, Point, Spin, Start, history};

use super::{Passage, Swept};

/// The time between instants at which the two models are compared (s). Basis: the fastest motion of
/// the suspension takes some 0.2 s. Doubling it misses up to a twentieth of a deviation.
const INTERVAL_S: f64 = 0.005;

/// The share of the needed growth, in e-folds, that tongues have to make to be a cause: the larger
/// part. Doubling it leaves no tongue that something helps.
const CAUSE_SHARE: f64 = 0.5;

/// The deviation that decides the verdict, and what the tongues before it do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cause {
    /// The time (s) at which the nonlinear model first exceeds the limit within the window, or is
    /// farthest, if it does not.
    pub(crate) time_s: f64,
    /// The drum's speed then (rpm).
    pub(crate) speed_rpm: f64,
    /// The growth (e-folds) from the disturbance at the entry of the first tongue to that
    /// deviation; none where no tongue is entered before it.
    pub(crate) needed_e_folds: Option<f64>,
    /// The growth (e-folds) that the tongues make until then.
    pub(crate) made_e_folds: f64,
}

impl Cause {
    /// Whether the tongues make the larger part of the growth that is needed.
    pub(crate) fn is_enough(&self) -> bool {
        let is_share = |needed: f64| self.made_e_folds >= CAUSE_SHARE * needed;
        self.made_e_folds > 0.0 && self.needed_e_folds.is_some_and(is_share)
    }
}

/// Compares the models in the channel with the greatest ratio; none without a ratio.
///
/// The disturbance at an entry is the largest difference of the models over the turn before it.
pub(super) fn cause<'p>(
    (point, spin): (&Point, &Spin),
    step_s: f64,
    swept: &Swept,
    passages: impl Iterator<Item = (&'p Passage, &'p [[f64; 2]])>,
) -> Option<Cause> {
    let (place, _) = swept.verdict.greatest?;
    let channel = swept.channels[place].index();
    let run = |model| history(model, &Method::Rk4 { step_s }, point, &Start::default(), INTERVAL_S);
    let [nonlinear, linear] = [ModelKind::Nonlinear, ModelKind::Linear].map(run);
    let value = |history: &History<'_>, k: usize| Some(history.instant(k)?.channels[channel]);
    let count = nonlinear.len().min(linear.len());
    let values: Option<Vec<[f64; 2]>> =
        (0..count).map(|k| Some([value(&nonlinear, k)?, value(&linear, k)?])).collect();
    let values = values?;
    let limit = swept.limits.most * swept.amplitudes[1].get(place)?;
    let index = |time_s: f64| (time_s / INTERVAL_S) as usize;
    let window = index(swept.window_s[0])..(index(swept.window_s[1]) + 1).min(count);
    let far = |k: &usize| values[*k][0].abs();
    let first = window.clone().find(|k| far(k) > limit);
    let farthest = || window.clone().max_by(|a, b| far(a).total_cmp(&far(b)));
    let deviates = first.or_else(farthest)?;
    let time_s = deviates as f64 * INTERVAL_S;
    let speed = |at_s: f64| spin.speeds_rpm([at_s]).next().unwrap_or(0.0);
    let difference = |from_s: f64, to_s: f64| {
        let part = values.get(index(from_s)..=index(to_s).min(count - 1)).unwrap_or_default();
        part.iter().map(|[a, b]| (a - b).abs()).fold(0.0, f64::max)
    };
    let turn_s = |at_s: f64| 60.0 / speed(at_s).max(1.0);
    let mut made_e_folds = 0.0;
    let mut entry_s: Option<f64> = None;
    for (passage, growths) in passages {
        let [from_s, to_s] = passage.from_to_s;
        if from_s >= time_s {
            continue;
        }
        entry_s = Some(entry_s.map_or(from_s, |entry_s| entry_s.min(from_s)));
        made_e_folds += super::profile::e_folds(spin, [from_s, to_s.min(time_s)], growths);
    }
    let needed = |entry_s: f64| {
        let present = difference((entry_s - turn_s(entry_s)).max(0.0), entry_s);
        let deviation = difference((time_s - turn_s(time_s)).max(entry_s), time_s);
        (deviation / present).ln().max(0.0)
    };
    let needed_e_folds = entry_s.map(needed);
    Some(Cause { time_s, speed_rpm: speed(time_s), needed_e_folds, made_e_folds })
}
