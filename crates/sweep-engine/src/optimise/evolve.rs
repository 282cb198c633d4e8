//! Differential evolution towards a Pareto front (GDE3).
//!
//! 1. Each member of a generation is challenged by a trial: another member plus a multiple of the
//!    difference of two more.
//! 2. The better one of member and trial survives; both survive if neither dominates.
//! 3. Survivors beyond the size of the population are removed by fronts and crowding, as in
//!    NSGA-II.
//!
//! With one objective this is plain differential evolution; the last third of its trials start from
//! the best candidate instead, with half the multiple. A candidate that violates constraints less
//! is better, whatever its objectives.
//!
//! S. Kukkonen, J. Lampinen, GDE3: the third evolution step of generalized differential evolution,
//! CEC 2005, 443-450. K. Deb, A. Pratap, S. Agarwal, T. Meyarivan, A fast and elitist
//! multiobjective genetic algorithm: NSGA-II, IEEE Transactions on Evolutionary Computation 6
//! (2002), 182-197.

use std::cmp::Ordering;

use crate::design::{Design, DesignRule};

/// The share of a trial's coordinates that come from the mutant. Basis: the papers' usual value.
/// Doubling it is not possible; halving it moves along fewer axes at once.
const CROSSOVER_RATE: f64 = 0.9;
/// The range of the factor of the difference, which is uniformly distributed. Basis: S. Das, A.
/// Konar, U. K. Chakraborty, Two improved differential evolution schemes for faster global search,
/// GECCO 2005. Doubling it makes trials leave the box.
const DIFFERENCE_FACTOR_RANGE: [f64; 2] = [0.3, 0.9];

/// The settings of a search.
#[derive(Clone, Copy, Debug)]
pub struct Evolution {
    /// The number of coordinates, each from 0 to 1.
    pub parameters: usize,
    /// The number of objectives, all minimised; the other numbers are constraint violations.
    pub objectives: usize,
    /// The number of members of a generation, at least 4.
    pub population: u64,
    /// The number of trials in all.
    pub candidates: u64,
    /// The seed of the random numbers.
    pub seed: u64,
}

/// An evaluated candidate.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The position in the unit box.
    pub position: Vec<f64>,
    /// The objectives, then the constraint violations; `None` if one of them is missing.
    pub responses: Option<Vec<f64>>,
    /// The generation, from 0.
    pub generation: u64,
}

impl Evolution {
    /// Returns the index of the first trial of the last third, if that third begins after the first
    /// generation. With one objective, these trials start from the best candidate.
    pub fn first_of_last_third(&self) -> u64 {
        let Self { candidates, population, .. } = *self;
        (candidates - candidates / 3).max(population.min(candidates))
    }
}

impl Candidate {
    /// Returns whether the candidate has all responses and violates no constraint.
    pub fn is_feasible(&self, objectives: usize) -> bool {
        self.responses.as_ref().is_some_and(|responses| {
            responses[objectives..].iter().all(|&violation| violation <= 0.0)
        })
    }
}

/// Returns all candidates in order. `evaluate` returns the numbers of a generation of positions.
/// All numbers are minimised, and equal numbers lead to equal positions.
///
/// # Errors
/// The errors of `evaluate`.
pub fn evolve<E>(
    evolution: &Evolution,
    evaluate: &mut dyn FnMut(&[Vec<f64>]) -> Result<Vec<Option<Vec<f64>>>, E>,
) -> Result<Vec<Candidate>, E> {
    let Evolution { parameters, objectives, population, candidates, seed } = *evolution;
    let mut evaluated: Vec<Candidate> = Vec::new();
    let mut members: Vec<usize> = Vec::new();
    for generation in 0.. {
        let count = population.min(candidates - evaluated.len() as u64);
        if count == 0 {
            break;
        }
        let first = evaluated.len();
        let ranks = Ranks::new(&evaluated, objectives);
        let choose_better = |a, b| if ranks.compare(b, a) == Some(Ordering::Less) { b } else { a };
        let best = members.iter().copied().reduce(choose_better);
        let initial_design =
            Design::Spread { rule: DesignRule::LatinHypercube, points: count, seed };
        let position = |k: u64| -> Vec<f64> {
            if generation == 0 {
                return (0..parameters)
                    .filter_map(|axis| initial_design.position(k, axis))
                    .collect();
            }
            let trial_number = first as u64 + k;
            let start_candidate =
                best.filter(|_| objectives == 1 && trial_number >= evolution.first_of_last_third());
            create_trial(
                &evaluated,
                &members,
                (k as usize, start_candidate),
                trial_number,
                evolution,
            )
        };
        let positions: Vec<Vec<f64>> = (0..count).map(position).collect();
        let responses = evaluate(&positions)?;
        let trials = positions.into_iter().zip(responses);
        evaluated.extend(trials.map(|(position, responses)| Candidate {
            position,
            responses,
            generation,
        }));
        if generation == 0 {
            members = (0..evaluated.len()).collect();
            continue;
        }
        let ranks = Ranks::new(&evaluated, objectives);
        let mut survivors = Vec::with_capacity(2 * members.len());
        for (k, &member) in members.iter().enumerate() {
            let trial = Some(first + k).filter(|&trial| trial < evaluated.len());
            match trial.map(|trial| (trial, ranks.compare(trial, member))) {
                Some((trial, Some(Ordering::Less | Ordering::Equal))) => survivors.push(trial),
                Some((trial, None)) => survivors.extend([member, trial]),
                Some((_, Some(Ordering::Greater))) | None => survivors.push(member),
            }
        }
        members = ranks.select_best(survivors, population as usize);
    }
    Ok(evaluated)
}

/// Returns the position of the trial that challenges a member. `trial_number` selects its random
/// numbers; `start_candidate` is the best candidate, if the trial starts from it.
fn create_trial(
    candidates: &[Candidate],
    members: &[usize],
    (member, start_candidate): (usize, Option<usize>),
    trial_number: u64,
    evolution: &Evolution,
) -> Vec<f64> {
    let draws = Design::Spread {
        rule: DesignRule::MonteCarlo,
        points: evolution.candidates,
        seed: evolution.seed,
    };
    let mut axis = 0;
    let mut draw = || {
        axis += 1;
        draws.position(trial_number, axis).unwrap_or(0.5)
    };
    let mut others = [member; 4];
    for k in 1..4 {
        while others[..k].contains(&others[k]) {
            others[k] = (draw() * members.len() as f64) as usize;
        }
    }
    let [member_position, base, plus, minus] =
        others.map(|other| candidates[members[other]].position.as_slice());
    let factor = DIFFERENCE_FACTOR_RANGE[0]
        + (DIFFERENCE_FACTOR_RANGE[1] - DIFFERENCE_FACTOR_RANGE[0]) * draw();
    let (base, factor) = start_candidate
        .map_or((base, factor), |best| (candidates[best].position.as_slice(), 0.5 * factor));
    let from_mutant = (draw() * member_position.len() as f64) as usize;
    let coordinate = |k: usize| {
        let mutated = (base[k] + factor * (plus[k] - minus[k])).clamp(0.0, 1.0);
        if draw() < CROSSOVER_RATE || k == from_mutant { mutated } else { member_position[k] }
    };
    (0..member_position.len()).map(coordinate).collect()
}

/// Returns the Pareto front: the feasible candidates that no other one dominates.
pub fn find_front(candidates: &[Candidate], objectives: usize) -> Vec<usize> {
    let ranks = Ranks::new(candidates, objectives);
    let feasible = (0..candidates.len()).filter(|&k| candidates[k].is_feasible(objectives));
    let feasible: Vec<usize> = feasible.collect();
    let dominated =
        |k: usize| feasible.iter().any(|&other| ranks.compare(other, k) == Some(Ordering::Less));
    feasible.iter().copied().filter(|&k| !dominated(k)).collect()
}

/// The order of candidates by constraint violation and dominance.
struct Ranks<'a> {
    candidates: &'a [Candidate],
    objectives: usize,
    /// The sum of each candidate's violations, each divided by the greatest of all candidates.
    violations: Vec<f64>,
}

impl<'a> Ranks<'a> {
    fn new(candidates: &'a [Candidate], objectives: usize) -> Self {
        let excesses = || {
            candidates
                .iter()
                .filter_map(|candidate| Some(&candidate.responses.as_ref()?[objectives..]))
        };
        let conditions = excesses().next().map_or(0, <[f64]>::len);
        let greatest: Vec<f64> = (0..conditions)
            .map(|k| excesses().map(|all| all[k]).fold(f64::MIN_POSITIVE, f64::max))
            .collect();
        let violation = |candidate: &Candidate| match &candidate.responses {
            Some(responses) => responses[objectives..]
                .iter()
                .zip(&greatest)
                .map(|(excess, greatest)| excess / greatest)
                .sum(),
            None => f64::INFINITY,
        };
        Self { candidates, objectives, violations: candidates.iter().map(violation).collect() }
    }

    fn objectives(&self, candidate: usize) -> &[f64] {
        self.candidates[candidate].responses.as_ref().map_or(&[], |all| &all[..self.objectives])
    }

    /// Compares two candidates: `Less` if the first is better, `None` if neither dominates.
    fn compare(&self, first: usize, second: usize) -> Option<Ordering> {
        let [a, b] = [self.violations[first], self.violations[second]];
        if a > 0.0 || b > 0.0 {
            return Some(a.total_cmp(&b));
        }
        let pairs = || self.objectives(first).iter().zip(self.objectives(second));
        match (pairs().any(|(a, b)| a < b), pairs().any(|(a, b)| a > b)) {
            (true, true) => None,
            (true, false) => Some(Ordering::Less),
            (false, true) => Some(Ordering::Greater),
            (false, false) => Some(Ordering::Equal),
        }
    }

    /// Returns at most `max_count` of these candidates, front by front; the most crowded of the
    /// last front are removed.
    fn select_best(&self, mut remaining: Vec<usize>, max_count: usize) -> Vec<usize> {
        let mut selected = Vec::with_capacity(max_count);
        while remaining.len() + selected.len() > max_count && selected.len() < max_count {
            let dominated = |k: &usize| {
                remaining.iter().any(|&other| self.compare(other, *k) == Some(Ordering::Less))
            };
            let (dominated_rest, mut front): (Vec<usize>, Vec<usize>) =
                remaining.iter().partition(|k| dominated(k));
            while front.len() + selected.len() > max_count {
                front.remove(self.find_most_crowded(&front));
            }
            selected.extend(front);
            remaining = dominated_rest;
        }
        if selected.len() < max_count {
            selected.extend(remaining);
        }
        selected
    }

    /// Returns the index of the member of a front with the least crowding distance.
    fn find_most_crowded(&self, front: &[usize]) -> usize {
        let mut distances = vec![0.0; front.len()];
        for k in 0..self.objectives {
            let value = |index: usize| self.objectives(front[index]).get(k).copied().unwrap_or(0.0);
            let mut order: Vec<usize> = (0..front.len()).collect();
            order.sort_by(|&a, &b| value(a).total_cmp(&value(b)));
            let [low, high] = [order[0], order[order.len() - 1]];
            distances[low] = f64::INFINITY;
            distances[high] = f64::INFINITY;
            let extent = (value(high) - value(low)).max(f64::MIN_POSITIVE);
            for triple in order.windows(3) {
                distances[triple[1]] += (value(triple[2]) - value(triple[0])) / extent;
            }
        }
        let nearest = (0..front.len()).min_by(|&a, &b| distances[a].total_cmp(&distances[b]));
        nearest.unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;

    fn run_evolution(
        evolution: Evolution,
        respond: impl Fn(&[f64]) -> Option<Vec<f64>>,
    ) -> Vec<Candidate> {
        let mut evaluate = |positions: &[Vec<f64>]| {
            Ok::<_, Infallible>(positions.iter().map(|position| respond(position)).collect())
        };
        let Ok(candidates) = evolve(&evolution, &mut evaluate);
        assert_eq!(candidates.len() as u64, evolution.candidates);
        assert!(
            candidates
                .iter()
                .flat_map(|candidate| &candidate.position)
                .all(|x| (0.0..=1.0).contains(x))
        );
        candidates
    }

    const SEARCH: Evolution =
        Evolution { parameters: 2, objectives: 1, population: 32, candidates: 1500, seed: 1 };

    #[test]
    fn rosenbrocks_function_is_minimised() {
        // The function is Rosenbrock's in [-2, 2], with its minimum at (1, 1): (0.75, 0.75) of the
        // box.
        let candidates = run_evolution(SEARCH, |position| {
            let [x, y] = [4.0 * position[0] - 2.0, 4.0 * position[1] - 2.0];
            Some(vec![(1.0 - x).powi(2) + 100.0 * (y - x * x).powi(2)])
        });
        let best = &candidates[find_front(&candidates, 1)[0]];
        assert!(best.position.iter().all(|x| (x - 0.75).abs() < 2e-3), "{best:?}");
    }

    #[test]
    fn the_minimum_is_feasible_and_has_objectives() {
        // The minimum of x + y with x y >= 0.25 is at (0.5, 0.5); there are no responses for x >
        // 0.9.
        let candidates = run_evolution(SEARCH, |position| {
            let trial_number =
                vec![position[0] + position[1], (0.25 - position[0] * position[1]).max(0.0)];
            (position[0] <= 0.9).then_some(trial_number)
        });
        let best = &candidates[find_front(&candidates, 1)[0]];
        let sum = best.responses.as_ref().unwrap()[0];
        assert!(best.is_feasible(1) && (1.0..1.0005).contains(&sum), "{best:?}");
        assert_eq!(find_front(&candidates[..0], 1), [0; 0]);
    }

    #[test]
    fn a_pareto_front_is_covered_from_end_to_end() {
        // The problem is Schaffer's, with the front from x = 0 to 2, where sqrt(f) + sqrt(g) = 2.
        let two_objectives = Evolution { parameters: 1, objectives: 2, ..SEARCH };
        let candidates = run_evolution(two_objectives, |position| {
            let x = 20.0 * position[0] - 10.0;
            Some(vec![x * x, (x - 2.0) * (x - 2.0)])
        });
        let mut roots: Vec<f64> = find_front(&candidates, 2)
            .iter()
            .map(|&k| candidates[k].responses.as_ref().unwrap()[0].sqrt())
            .collect();
        roots.sort_by(f64::total_cmp);
        assert!(roots.len() > 100 && roots[0] < 0.02 && roots[roots.len() - 1] > 1.98, "{roots:?}");
        assert!(roots.windows(2).all(|pair| pair[1] - pair[0] < 0.1), "{roots:?}");
    }

    #[test]
    fn a_short_search_ends_close_to_the_minimum() {
        // Without trials from the best candidate, the median of the minima exceeds 1e-4.
        let bowl =
            |position: &[f64]| (position[0] - 0.3).powi(2) + 3.0 * (position[1] - 0.6).powi(2);
        let least = |seed| {
            let short = Evolution { candidates: 256, seed, ..SEARCH };
            let candidates = run_evolution(short, |position| Some(vec![bowl(position)]));
            bowl(&candidates[find_front(&candidates, 1)[0]].position)
        };
        let mut minima: Vec<f64> = (0..21).map(least).collect();
        minima.sort_by(f64::total_cmp);
        assert!(minima[10] < 5e-5, "{minima:?}");
    }

    #[test]
    fn equal_answers_lead_to_equal_candidates() {
        let sphere = |position: &[f64]| Some(vec![position.iter().map(|x| x * x).sum()]);
        let short = Evolution { candidates: 150, ..SEARCH };
        assert_eq!(run_evolution(SEARCH, sphere)[..100], run_evolution(short, sphere)[..100]);
        assert_ne!(
            run_evolution(short, sphere),
            run_evolution(Evolution { seed: 2, ..short }, sphere)
        );
    }
}
