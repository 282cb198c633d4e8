//! How well numbers are known, and whether the model follows the data at all.

use super::algebra::{Symmetric, dot, inverse, scaled};
use super::model::{Against, Problem, Summary};

/// Most lags of a residual's autocorrelation that are looked at.
const MOST_LAGS: usize = 400;
/// Into how many parts each record is cut.
const PARTS: usize = 24;
/// By how much more parts of the record may disagree than noise makes them, before the model is
/// said not to follow.
const DISAGREEMENT: f64 = 4.0;
/// How large a smooth residual may be, as a share of the signal.
const SMOOTH: f64 = 0.15;
/// A direction is unknown along which numbers may move by more than this share (95 %).
const UNKNOWN: f64 = 0.5;
/// Numbers with a correlation beyond this are known together rather than each.
const TOGETHER: f64 = 0.95;

/// What the residuals at a fit say.
pub(crate) struct Statistics {
    /// Covariance of the unknowns, by the residuals' own correlation in time.
    pub(crate) covariance: Vec<Vec<f64>>,
    /// By how much autocorrelation widens intervals: of each signal, the variance of a mean over
    /// that of independent samples.
    pub(crate) widening: Vec<f64>,
    /// Of each signal: the correlation of neighbouring residuals.
    pub(crate) neighbours: Vec<f64>,
    /// How much more the parts of the records disagree on the unknowns than noise makes them.
    pub(crate) disagreement: f64,
    /// Of each signal: the smooth part of the residual over the signal, root mean squares.
    pub(crate) smooth: Vec<f64>,
    /// Of the signal that is worst off in it: signal, and the time (s) around which it is.
    pub(crate) worst: (usize, [f64; 2]),
}

impl Statistics {
    /// At the end of a descent.
    pub(crate) fn of(problem: &Problem, against: &[Against], summary: &Summary) -> Self {
        let n = problem.unknowns();
        let bread = inverse(&summary.normal);
        let mut meat = vec![vec![0.0; n]; n];
        let (mut widening, mut neighbours, mut smooth) = (Vec::new(), Vec::new(), Vec::new());
        let (mut disagreement, mut freedom) = (0.0, 0.0);
        let mut worst = (0, [0.0; 2], 0.0);
        for (k, (((_, _, signal), one), sigma)) in
            problem.signals().zip(against).zip(&summary.sigma).enumerate()
        {
            let rho = autocorrelation(&one.residual);
            let of_signal = correlated(&one.slopes, &rho, 1.0 / (sigma * sigma));
            let plain = correlated(&one.slopes, &[1.0], 1.0 / (sigma * sigma));
            // Intervals are widened, never narrowed.
            let wider = (0..n).fold(1.0_f64, |most, i| {
                if plain[i][i] > 0.0 { most.max(of_signal[i][i] / plain[i][i]) } else { most }
            });
            let narrower = (0..n).any(|i| of_signal[i][i] < plain[i][i]);
            let own = if narrower { &plain } else { &of_signal };
            add(&mut meat, own, if narrower { wider } else { 1.0 });
            let square = dot(&one.residual, &one.residual);
            let first = rho.get(1).copied().unwrap_or(0.0);
            let (swing, _) = super::model::centred(signal.samples().map(|(_, v)| v).collect());
            smooth.push((first.max(0.0) * square / dot(&swing, &swing)).sqrt());
            neighbours.push(first);
            widening.push(wider);
            // What each part of the record alone would pull at the unknowns.
            let count = one.residual.len();
            for part in 0..PARTS {
                let range = part * count / PARTS..(part + 1) * count / PARTS;
                let Some(rows) = one.residual.get(range.clone()) else { continue };
                let of = |slopes: &Vec<f64>| slopes.get(range.clone()).unwrap_or_default().to_vec();
                let slopes: Vec<Vec<f64>> = one.slopes.iter().map(of).collect();
                let information = correlated(&slopes, &[1.0], wider / (sigma * sigma));
                let pull: Vec<f64> =
                    slopes.iter().map(|slope| dot(slope, rows) / (sigma * sigma)).collect();
                let (unit, scale) = scaled(&information);
                let eigen = Symmetric::of(&unit);
                let pull: Vec<f64> = pull.iter().zip(&scale).map(|(p, s)| p / s).collect();
                for (value, vector) in eigen.values.iter().zip(&eigen.vectors) {
                    if *value > 1e-6 {
                        disagreement += dot(vector, &pull).powi(2) / value;
                        freedom += 1.0;
                    }
                }
                let energy = dot(rows, rows) / (rows.len().max(1) as f64 * sigma * sigma);
                if energy > worst.2 {
                    let times = &problem.cases[one.case].measured.time_s;
                    let rows: Vec<usize> = signal.samples().map(|(row, _)| row).collect();
                    let at = |place: usize| times[rows[place.min(rows.len() - 1)]];
                    worst = (k, [at(range.start), at(range.end)], energy);
                }
            }
        }
        let disagreement = disagreement / (freedom - n as f64).max(1.0);
        let middle = product(&product(&bread, &meat), &bread);
        // What parts of the record disagree on beyond their noise is not known any better.
        let covariance = middle
            .iter()
            .map(|row| row.iter().map(|x| x * disagreement.max(1.0)).collect())
            .collect();
        let worst = (worst.0, worst.1);
        Self { covariance, widening, neighbours, disagreement, smooth, worst }
    }

    /// Why the model does not follow, if it does not.
    pub(crate) fn objection(&self, problem: &Problem) -> Option<String> {
        let mut reasons = Vec::new();
        let named = |k: usize| {
            problem.signals().nth(k).map_or_else(String::new, |(.., it)| it.quantity.column())
        };
        if let Some((k, share)) = self.smooth.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))
            && *share > SMOOTH
        {
            reasons.push(format!(
                "{:.0} % of {} are left over as a motion, not as noise",
                100.0 * share,
                named(k)
            ));
        }
        if self.disagreement > DISAGREEMENT {
            reasons.push(format!(
                "parts of the record ask for values {:.1} times as far apart as noise makes them",
                self.disagreement.sqrt()
            ));
        }
        if reasons.is_empty() {
            return None;
        }
        let (k, [from, to]) = self.worst;
        let place = format!("; worst is {} from {from:.1} to {to:.1} s", named(k));
        Some(reasons.join(", and ") + &place)
    }

    /// The covariance of the free numbers.
    pub(crate) fn of_free(&self, problem: &Problem) -> Vec<Vec<f64>> {
        let free = problem.free.len();
        self.covariance[..free].iter().map(|row| row[..free].to_vec()).collect()
    }

    /// What the data cannot tell, in words.
    pub(crate) fn untold(&self, problem: &Problem, x: &[f64]) -> Vec<String> {
        let covariance = self.of_free(problem);
        let names: Vec<&str> = problem.free.iter().map(|free| free.parameter.name()).collect();
        // Of a number that is 0 nothing is relative.
        let sizes: Vec<f64> = problem
            .free
            .iter()
            .zip(x)
            .map(|(free, x)| x.abs().max(free.start.abs()))
            .map(|size| if size > 0.0 { size } else { 1.0 })
            .collect();
        let row = |(i, row): (usize, &Vec<f64>)| -> Vec<f64> {
            row.iter().zip(&sizes).map(|(c, size)| c / (sizes[i] * size)).collect()
        };
        let relative: Vec<Vec<f64>> = covariance.iter().enumerate().map(row).collect();
        let mut said = Vec::new();
        let eigen = Symmetric::of(&relative);
        for (value, vector) in eigen.values.iter().zip(&eigen.vectors).rev() {
            let reach = 1.96 * value.max(0.0).sqrt();
            if reach < UNKNOWN {
                continue;
            }
            let most = vector.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            let sign = vector.iter().find(|v| v.abs() == most).map_or(1.0, |v| v.signum());
            let moves: Vec<String> = vector
                .iter()
                .zip(&names)
                .filter(|(v, _)| v.abs() > 0.1 * most)
                .map(|(v, name)| {
                    let percent = 100.0 * reach.min(9.99) * v * sign;
                    let way = if percent > 0.0 { "up" } else { "down" };
                    format!("{name} {way} by {:.0} %", percent.abs())
                })
                .collect();
            said.push(format!(
                "{}: that hardly changes the residual, so the data cannot tell",
                moves.join(" with ")
            ));
        }
        for i in 0..names.len() {
            for j in 0..i {
                let size = (covariance[i][i] * covariance[j][j]).sqrt();
                let correlation = covariance[i][j] / size;
                if size > 0.0 && correlation.abs() > TOGETHER {
                    let way = if correlation < 0.0 { "for" } else { "with" };
                    said.push(format!(
                        "{} goes {way} {} (correlation {correlation:.3}): they are known together \
                         better than each alone",
                        names[j], names[i]
                    ));
                }
            }
        }
        said
    }
}

pub(super) fn add(sum: &mut [Vec<f64>], part: &[Vec<f64>], factor: f64) {
    for (sum, part) in sum.iter_mut().zip(part) {
        sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += factor * part);
    }
}

fn product(a: &[Vec<f64>], b: &[Vec<f64>]) -> Vec<Vec<f64>> {
    // The second is symmetric.
    a.iter().map(|row| b.iter().map(|column| dot(row, column)).collect()).collect()
}

/// Sum over all pairs of samples of slope, correlation by lag, slope; once over the noise squared.
fn correlated(slopes: &[Vec<f64>], rho: &[f64], weight: f64) -> Vec<Vec<f64>> {
    let n = slopes.len();
    let mut sum = vec![vec![0.0; n]; n];
    for (lag, rho) in rho.iter().enumerate() {
        for i in 0..n {
            for j in 0..n {
                let late = slopes[j].get(lag..).unwrap_or_default();
                let product = weight * rho * dot(&slopes[i], late);
                sum[i][j] += product;
                if lag > 0 {
                    sum[j][i] += product;
                }
            }
        }
    }
    sum
}

/// The autocorrelation by lag, tapered to nothing where it is no more than chance; as if the
/// samples were even in time, which gaps only interrupt.
fn autocorrelation(residual: &[f64]) -> Vec<f64> {
    let count = residual.len();
    let square = dot(residual, residual);
    let chance = 2.0 / (count as f64).sqrt();
    let mut rho = vec![1.0];
    let mut quiet = 0;
    while rho.len() < MOST_LAGS.min(count / 4) && quiet < 5 && square > 0.0 {
        let next = dot(residual, &residual[rho.len()..]) / square;
        quiet = if next.abs() < chance { quiet + 1 } else { 0 };
        rho.push(next);
    }
    rho.truncate(rho.len() - quiet);
    let length = rho.len() as f64;
    // Bartlett's taper keeps variances positive.
    rho.iter_mut().enumerate().for_each(|(lag, rho)| *rho *= 1.0 - lag as f64 / length);
    rho
}

#[cfg(test)]
mod tests {
    use super::*;
    use sweep_engine::design::{Design, Distribution, Shape};

    #[test]
    fn correlated_noise_widens_an_interval_by_what_it_does_to_a_mean() {
        let noise = Design::MonteCarlo { points: 0, seed: 11 };
        let shape = Shape::Normal { mean: 0.0, sd: 1.0 };
        let normal = Distribution { shape, from: -6.0, to: 6.0 };
        let mut last = 0.0;
        let residual: Vec<f64> = (0..20_000)
            .map(|k| {
                last = 0.8 * last + normal.quantile(noise.place(k, 0).unwrap());
                last
            })
            .collect();
        let rho = autocorrelation(&residual);
        let slopes = vec![vec![1.0; residual.len()]];
        let wider = correlated(&slopes, &rho, 1.0)[0][0] / residual.len() as f64;
        // (1 + 0.8) / (1 - 0.8) for an endless record; the taper takes some.
        assert!((5.0..10.0).contains(&wider), "{wider}: {}", rho.len());
        let white: Vec<f64> =
            (0..20_000).map(|k| normal.quantile(noise.place(k, 1).unwrap())).collect();
        assert_eq!(autocorrelation(&white), [1.0]);
    }
}
