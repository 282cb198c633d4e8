//! The rating of ISO/TS 18571 for a curve against a measured one: corridor, phase, magnitude and
//! slope, each 1 where they agree and 0 where nothing does.

use serde::Serialize;

use super::algebra::dot;

/// Half widths of the inner and the outer corridor, in parts of the measured peak.
const CORRIDORS: [f64; 2] = [0.05, 0.5];
/// The farthest shift in time, and the farthest warp, in parts of the record.
const FARTHEST_SHIFT: f64 = 0.2;
const WINDOW: f64 = 0.1;
/// Errors at which magnitude and slope are rated 0.
const WORST_MAGNITUDE: f64 = 0.5;
const WORST_SLOPE: f64 = 2.0;
/// Samples that slopes are averaged over.
const AVERAGED: usize = 9;
/// Weights of the four: the corridor counts twice.
const WEIGHTS: [f64; 4] = [0.4, 0.2, 0.2, 0.2];
/// Longer records are thinned: the warp's work grows with the square.
const LONGEST: usize = 4000;

/// Ratings from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Rating {
    pub(crate) corridor: f64,
    pub(crate) phase: f64,
    pub(crate) magnitude: f64,
    pub(crate) slope: f64,
    pub(crate) overall: f64,
}

/// Rates a model against a measurement, both at the same even instants.
pub(crate) fn rate(measured: &[f64], model: &[f64]) -> Rating {
    let every = measured.len().div_ceil(LONGEST).max(1);
    let thin = |values: &[f64]| values.iter().copied().step_by(every).collect::<Vec<f64>>();
    let (measured, model) = (&thin(measured)[..], &thin(model)[..]);
    let corridor = corridor(measured, model);
    let (shift, phase) = phase(measured, model);
    let [measured, model] = overlap(measured, model, shift);
    let magnitude = magnitude(measured, model);
    let slope = slope(measured, model);
    let parts = [corridor, phase, magnitude, slope];
    let overall = parts.iter().zip(WEIGHTS).map(|(part, weight)| part * weight).sum();
    Rating { corridor, phase, magnitude, slope, overall }
}

fn corridor(measured: &[f64], model: &[f64]) -> f64 {
    let peak = measured.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
    let [inner, outer] = CORRIDORS.map(|share| share * peak);
    let rated = |(measured, model): (&f64, &f64)| {
        let part = ((outer - (measured - model).abs()) / (outer - inner)).clamp(0.0, 1.0);
        part * part
    };
    measured.iter().zip(model).map(rated).sum::<f64>() / measured.len() as f64
}

/// The shift of the model, in samples, at which both correlate best; and its rating.
fn phase(measured: &[f64], model: &[f64]) -> (isize, f64) {
    let farthest = (FARTHEST_SHIFT * measured.len() as f64) as isize;
    let correlation = |shift: isize| {
        let [a, b] = overlap(measured, model, shift);
        dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
    };
    // The least shift wins a tie.
    let tried = (0..=farthest).flat_map(|shift| [shift, -shift]);
    let (best, _) = tried.fold((0, f64::NEG_INFINITY), |best, shift| {
        let found = correlation(shift);
        if found > best.1 { (shift, found) } else { best }
    });
    let share = best.unsigned_abs() as f64 / farthest.max(1) as f64;
    (best, (1.0 - share).max(0.0))
}

/// The stretches of both that lie over each other once the model is shifted.
fn overlap<'a>(measured: &'a [f64], model: &'a [f64], shift: isize) -> [&'a [f64]; 2] {
    let by = shift.unsigned_abs();
    let left = measured.len() - by;
    match shift < 0 {
        true => [&measured[..left], &model[by..]],
        false => [&measured[by..], &model[..left]],
    }
}

/// The rating of magnitudes, with differences in time warped away.
fn magnitude(measured: &[f64], model: &[f64]) -> f64 {
    let n = measured.len();
    let reach = ((WINDOW * n as f64).ceil() as usize).max(1);
    // Of each row, the cells around the diagonal: the least sum on the way there, and whence.
    let width = 2 * reach + 1;
    let mut sums = vec![f64::INFINITY; width + 1];
    let mut ways = vec![0_u8; n * width];
    for i in 0..n {
        let before = sums.clone();
        sums.fill(f64::INFINITY);
        for cell in 0..width {
            let Some(j) = (i + cell).checked_sub(reach).filter(|j| *j < n) else { continue };
            let cost = (measured[i] - model[j]) * (measured[i] - model[j]);
            // Cells of the row before are one to the right.
            let diagonal = before[cell];
            let up = before[cell + 1];
            let left = if cell > 0 { sums[cell - 1] } else { f64::INFINITY };
            let (way, least) = match (i, j) {
                (0, 0) => (0, 0.0),
                _ if diagonal <= up && diagonal <= left => (0, diagonal),
                _ if up <= left => (1, up),
                _ => (2, left),
            };
            sums[cell] = cost + least;
            ways[i * width + cell] = way;
        }
    }
    let (mut i, mut j) = (n - 1, n - 1);
    let (mut apart, mut size) = (0.0, 0.0);
    loop {
        apart += (measured[i] - model[j]).abs();
        size += measured[i].abs();
        if i == 0 && j == 0 {
            break;
        }
        match ways[i * width + (j + reach - i)] {
            _ if i == 0 => j -= 1,
            _ if j == 0 => i -= 1,
            0 => (i, j) = (i - 1, j - 1),
            1 => i -= 1,
            _ => j -= 1,
        }
    }
    (1.0 - apart / size / WORST_MAGNITUDE).clamp(0.0, 1.0)
}

fn slope(measured: &[f64], model: &[f64]) -> f64 {
    let slopes = |values: &[f64]| -> Vec<f64> {
        let steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.windows(AVERAGED).map(|some| some.iter().sum::<f64>()).collect()
    };
    let (measured, model) = (slopes(measured), slopes(model));
    let apart: f64 = measured.iter().zip(&model).map(|(a, b)| (a - b).abs()).sum();
    let size: f64 = measured.iter().map(|a| a.abs()).sum();
    if size > 0.0 { (1.0 - apart / size / WORST_SLOPE).clamp(0.0, 1.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(shift: f64, size: f64) -> Vec<f64> {
        let at = |k: i32| {
            let t = f64::from(k) - shift;
            size * (0.05 * t).sin() * (-((t - 500.0) / 200.0).powi(2)).exp()
        };
        (0..1000).map(at).collect()
    }

    #[test]
    fn each_rating_sees_its_own_fault() {
        let measured = wave(0.0, 1.0);
        let same = rate(&measured, &measured);
        assert_eq!(same.overall, 1.0, "{same:?}");
        let late = rate(&measured, &wave(20.0, 1.0));
        assert!((late.phase - 0.9).abs() < 1e-12 && late.magnitude > 0.99, "{late:?}");
        assert!(late.corridor < 0.8 && late.slope > 0.99, "{late:?}");
        let small = rate(&measured, &wave(0.0, 0.8));
        assert!(small.phase == 1.0 && (small.slope - 0.9).abs() < 0.01, "{small:?}");
        // Warping in time makes up for some of a fifth.
        assert!((0.55..0.9).contains(&small.magnitude), "{small:?}");
        let upside_down: Vec<f64> = measured.iter().map(|value| -value).collect();
        assert!(rate(&measured, &upside_down).overall < 0.75);
    }
}
