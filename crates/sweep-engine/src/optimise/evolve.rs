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
    pub parameter_count: usize,
    /// The number of objectives, all minimised; the other numbers are constraint violations.
    pub objective_count: usize,
    /// The number of members of a generation, at least 4.
    pub population_size: u64,
    /// The number of trials in all.
    pub candidate_count: u64,
    /// The seed of the random numbers.
    pub seed: u64,
}

/// An evaluated candidate.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The position in the unit box.
    pub position: Vec<f64>,
    /// The objectives, then the constraint violations; `None` if one of them is missing.
    pub evaluation: Option<Vec<f64>>,
    /// The generation, from 0.
    pub generation: u64,
}

impl Evolution {
    /// Returns the index of the first trial of the last third, if that third begins after the first
    /// generation. With one objective, these trials start from the best candidate.
    pub fn first_of_last_third(&self) -> u64 {
        let Self { candidate_count: candidates, population_size: population, .. } = *self;
        (candidates - candidates / 3).max(population.min(candidates))
    }
}

impl Candidate {
    /// Returns whether the candidate has all responses and violates no constraint.
    pub fn is_feasible(&self, objectives: usize) -> bool {
        self.evaluation.as_ref().is_some_and(|responses| {
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
    let Evolution {
        parameter_count: parameters,
        objective_count: objectives,
        population_size: population,
        candidate_count: candidates,
        seed,
    } = *evolution;
    let mut evaluated_candidates: Vec<Candidate> = Vec::new();
    let mut member_indices: Vec<usize> = Vec::new();
    for generation in 0.. {
        let generation_size = population.min(candidates - evaluated_candidates.len() as u64);
        if generation_size == 0 {
            break;
        }
        let first_trial = evaluated_candidates.len();
        let ranking = CandidateRanking::new(&evaluated_candidates, objectives);
        let choose_better =
            |a, b| if ranking.compare(b, a) == Some(Ordering::Less) { b } else { a };
        let best_member = member_indices.iter().copied().reduce(choose_better);
        let initial_design =
            Design::Spread { rule: DesignRule::LatinHypercube, points: generation_size, seed };
        let trial_position = |k: u64| -> Vec<f64> {
            if generation == 0 {
                return (0..parameters)
                    .filter_map(|axis| initial_design.position(k, axis))
                    .collect();
            }
            let trial_number = first_trial as u64 + k;
            let start_candidate = best_member
                .filter(|_| objectives == 1 && trial_number >= evolution.first_of_last_third());
            create_trial(
                &evaluated_candidates,
                &member_indices,
                (k as usize, start_candidate),
                trial_number,
                evolution,
            )
        };
        let positions: Vec<Vec<f64>> = (0..generation_size).map(trial_position).collect();
        let evaluations = evaluate(&positions)?;
        let trials = positions.into_iter().zip(evaluations);
        evaluated_candidates.extend(trials.map(|(trial_position, evaluations)| Candidate {
            position: trial_position,
            evaluation: evaluations,
            generation,
        }));
        if generation == 0 {
            member_indices = (0..evaluated_candidates.len()).collect();
            continue;
        }
        let ranking = CandidateRanking::new(&evaluated_candidates, objectives);
        let mut surviving_indices = Vec::with_capacity(2 * member_indices.len());
        for (k, &member) in member_indices.iter().enumerate() {
            let trial_index = Some(first_trial + k)
                .filter(|&trial_index| trial_index < evaluated_candidates.len());
            match trial_index.map(|trial_index| (trial_index, ranking.compare(trial_index, member)))
            {
                Some((trial_index, Some(Ordering::Less | Ordering::Equal))) => {
                    surviving_indices.push(trial_index)
                }
                Some((trial_index, None)) => surviving_indices.extend([member, trial_index]),
                Some((_, Some(Ordering::Greater))) | None => surviving_indices.push(member),
            }
        }
        member_indices = ranking.select_best(surviving_indices, population as usize);
    }
    Ok(evaluated_candidates)
}

/// Returns the position of the trial that challenges a member. `trial_number` selects its random
/// numbers; `start_candidate` is the best candidate, if the trial starts from it.
fn create_trial(
    candidates: &[Candidate],
    member_indices: &[usize],
    (member, start_candidate): (usize, Option<usize>),
    trial_number: u64,
    evolution: &Evolution,
) -> Vec<f64> {
    let random_design = Design::Spread {
        rule: DesignRule::MonteCarlo,
        points: evolution.candidate_count,
        seed: evolution.seed,
    };
    let mut axis = 0;
    let mut draw_number = || {
        axis += 1;
        random_design.position(trial_number, axis).unwrap_or(0.5)
    };
    let mut chosen_members = [member; 4];
    for k in 1..4 {
        while chosen_members[..k].contains(&chosen_members[k]) {
            chosen_members[k] = (draw_number() * member_indices.len() as f64) as usize;
        }
    }
    let [member_position, base_position, plus_position, minus_position] =
        chosen_members.map(|other| candidates[member_indices[other]].position.as_slice());
    let difference_factor = DIFFERENCE_FACTOR_RANGE[0]
        + (DIFFERENCE_FACTOR_RANGE[1] - DIFFERENCE_FACTOR_RANGE[0]) * draw_number();
    let (base_position, difference_factor) = start_candidate
        .map_or((base_position, difference_factor), |best| {
            (candidates[best].position.as_slice(), 0.5 * difference_factor)
        });
    let mutant_axis = (draw_number() * member_position.len() as f64) as usize;
    let trial_coordinate = |k: usize| {
        let mutant_coordinate = (base_position[k]
            + difference_factor * (plus_position[k] - minus_position[k]))
            .clamp(0.0, 1.0);
        if draw_number() < CROSSOVER_RATE || k == mutant_axis {
            mutant_coordinate
        } else {
            member_position[k]
        }
    };
    (0..member_position.len()).map(trial_coordinate).collect()
}

/// Returns the Pareto front: the feasible candidates that no other one dominates.
pub fn find_pareto_front(candidates: &[Candidate], objectives: usize) -> Vec<usize> {
    let ranking = CandidateRanking::new(candidates, objectives);
    let feasible_candidates =
        (0..candidates.len()).filter(|&k| candidates[k].is_feasible(objectives));
    let feasible_candidates: Vec<usize> = feasible_candidates.collect();
    let is_dominated = |k: usize| {
        feasible_candidates.iter().any(|&other| ranking.compare(other, k) == Some(Ordering::Less))
    };
    feasible_candidates.iter().copied().filter(|&k| !is_dominated(k)).collect()
}

/// The order of candidates by constraint violation and dominance.
struct CandidateRanking<'a> {
    candidates: &'a [Candidate],
    objective_count: usize,
    /// The sum of each candidate's violations, each divided by the greatest of all candidates.
    relative_violations: Vec<f64>,
}

impl<'a> CandidateRanking<'a> {
    fn new(candidates: &'a [Candidate], objectives: usize) -> Self {
        let constraint_violations = || {
            candidates
                .iter()
                .filter_map(|candidate| Some(&candidate.evaluation.as_ref()?[objectives..]))
        };
        let condition_count = constraint_violations().next().map_or(0, <[f64]>::len);
        let greatest_violations: Vec<f64> = (0..condition_count)
            .map(|k| constraint_violations().map(|all| all[k]).fold(f64::MIN_POSITIVE, f64::max))
            .collect();
        let relative_violation = |candidate: &Candidate| match &candidate.evaluation {
            Some(responses) => responses[objectives..]
                .iter()
                .zip(&greatest_violations)
                .map(|(excess, greatest_violations)| excess / greatest_violations)
                .sum(),
            None => f64::INFINITY,
        };
        Self {
            candidates,
            objective_count: objectives,
            relative_violations: candidates.iter().map(relative_violation).collect(),
        }
    }

    fn objectives(&self, candidate: usize) -> &[f64] {
        self.candidates[candidate]
            .evaluation
            .as_ref()
            .map_or(&[], |all| &all[..self.objective_count])
    }

    /// Compares two candidates: `Less` if the first is better, `None` if neither dominates.
    fn compare(&self, first: usize, second: usize) -> Option<Ordering> {
        let [a, b] = [self.relative_violations[first], self.relative_violations[second]];
        if a > 0.0 || b > 0.0 {
            return Some(a.total_cmp(&b));
        }
        let objective_pairs = || self.objectives(first).iter().zip(self.objectives(second));
        match (objective_pairs().any(|(a, b)| a < b), objective_pairs().any(|(a, b)| a > b)) {
            (true, true) => None,
            (true, false) => Some(Ordering::Less),
            (false, true) => Some(Ordering::Greater),
            (false, false) => Some(Ordering::Equal),
        }
    }

    /// Returns at most `max_count` of these candidates, front by front; the most crowded of the
    /// last front are removed.
    fn select_best(&self, mut remaining: Vec<usize>, max_count: usize) -> Vec<usize> {
        let mut selected_candidates = Vec::with_capacity(max_count);
        while remaining.len() + selected_candidates.len() > max_count
            && selected_candidates.len() < max_count
        {
            let is_dominated = |k: &usize| {
                remaining.iter().any(|&other| self.compare(other, *k) == Some(Ordering::Less))
            };
            let (dominated_rest, mut front): (Vec<usize>, Vec<usize>) =
                remaining.iter().partition(|k| is_dominated(k));
            while front.len() + selected_candidates.len() > max_count {
                front.remove(self.find_most_crowded(&front));
            }
            selected_candidates.extend(front);
            remaining = dominated_rest;
        }
        if selected_candidates.len() < max_count {
            selected_candidates.extend(remaining);
        }
        selected_candidates
    }

    /// Returns the index of the member of a front with the least crowding distance.
    fn find_most_crowded(&self, front: &[usize]) -> usize {
        let mut distances = vec![0.0; front.len()];
        for k in 0..self.objective_count {
            let objective_at =
                |index: usize| self.objectives(front[index]).get(k).copied().unwrap_or(0.0);
            let mut sorted_indices: Vec<usize> = (0..front.len()).collect();
            sorted_indices.sort_by(|&a, &b| objective_at(a).total_cmp(&objective_at(b)));
            let [low, high] = [sorted_indices[0], sorted_indices[sorted_indices.len() - 1]];
            distances[low] = f64::INFINITY;
            distances[high] = f64::INFINITY;
            let objective_range = (objective_at(high) - objective_at(low)).max(f64::MIN_POSITIVE);
            for triple in sorted_indices.windows(3) {
                distances[triple[1]] +=
                    (objective_at(triple[2]) - objective_at(triple[0])) / objective_range;
            }
        }
        let most_crowded = (0..front.len()).min_by(|&a, &b| distances[a].total_cmp(&distances[b]));
        most_crowded.unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;

    fn run_evolution(
        evolution: Evolution,
        evaluate_position: impl Fn(&[f64]) -> Option<Vec<f64>>,
    ) -> Vec<Candidate> {
        let mut evaluate = |positions: &[Vec<f64>]| {
            Ok::<_, Infallible>(
                positions.iter().map(|position| evaluate_position(position)).collect(),
            )
        };
        let Ok(candidates) = evolve(&evolution, &mut evaluate);
        assert_eq!(candidates.len() as u64, evolution.candidate_count);
        assert!(
            candidates
                .iter()
                .flat_map(|candidate| &candidate.position)
                .all(|x| (0.0..=1.0).contains(x))
        );
        candidates
    }

    const TEST_EVOLUTION: Evolution = Evolution {
        parameter_count: 2,
        objective_count: 1,
        population_size: 32,
        candidate_count: 1500,
        seed: 1,
    };

    #[test]
    fn rosenbrocks_function_is_minimised() {
        // The function is Rosenbrock's in [-2, 2], with its minimum at (1, 1): (0.75, 0.75) of the
        // box.
        let candidates = run_evolution(TEST_EVOLUTION, |position| {
            let [x, y] = [4.0 * position[0] - 2.0, 4.0 * position[1] - 2.0];
            Some(vec![(1.0 - x).powi(2) + 100.0 * (y - x * x).powi(2)])
        });
        let best = &candidates[find_pareto_front(&candidates, 1)[0]];
        assert!(best.position.iter().all(|x| (x - 0.75).abs() < 2e-3), "{best:?}");
    }

    #[test]
    fn the_minimum_is_feasible_and_has_objectives() {
        // The minimum of x + y with x y >= 0.25 is at (0.5, 0.5); there are no responses for x >
        // 0.9.
        let candidates = run_evolution(TEST_EVOLUTION, |position| {
            let evaluation =
                vec![position[0] + position[1], (0.25 - position[0] * position[1]).max(0.0)];
            (position[0] <= 0.9).then_some(evaluation)
        });
        let best = &candidates[find_pareto_front(&candidates, 1)[0]];
        let best_sum = best.evaluation.as_ref().unwrap()[0];
        assert!(best.is_feasible(1) && (1.0..1.0005).contains(&best_sum), "{best:?}");
        assert_eq!(find_pareto_front(&candidates[..0], 1), [0; 0]);
    }

    #[test]
    fn a_pareto_front_is_covered_from_end_to_end() {
        // The problem is Schaffer's, with the front from x = 0 to 2, where sqrt(f) + sqrt(g) = 2.
        let two_objectives = Evolution { parameter_count: 1, objective_count: 2, ..TEST_EVOLUTION };
        let candidates = run_evolution(two_objectives, |position| {
            let x = 20.0 * position[0] - 10.0;
            Some(vec![x * x, (x - 2.0) * (x - 2.0)])
        });
        let mut front_roots: Vec<f64> = find_pareto_front(&candidates, 2)
            .iter()
            .map(|&k| candidates[k].evaluation.as_ref().unwrap()[0].sqrt())
            .collect();
        front_roots.sort_by(f64::total_cmp);
        assert!(
            front_roots.len() > 100
                && front_roots[0] < 0.02
                && front_roots[front_roots.len() - 1] > 1.98,
            "{front_roots:?}"
        );
        assert!(front_roots.windows(2).all(|pair| pair[1] - pair[0] < 0.1), "{front_roots:?}");
    }

    #[test]
    fn a_short_search_ends_close_to_the_minimum() {
        // Without trials from the best candidate, the median of the minima exceeds 1e-4.
        let bowl_function =
            |position: &[f64]| (position[0] - 0.3).powi(2) + 3.0 * (position[1] - 0.6).powi(2);
        let least_found = |seed| {
            let short_evolution = Evolution { candidate_count: 256, seed, ..TEST_EVOLUTION };
            let candidates =
                run_evolution(short_evolution, |position| Some(vec![bowl_function(position)]));
            bowl_function(&candidates[find_pareto_front(&candidates, 1)[0]].position)
        };
        let mut minima: Vec<f64> = (0..21).map(least_found).collect();
        minima.sort_by(f64::total_cmp);
        assert!(minima[10] < 5e-5, "{minima:?}");
    }

    #[test]
    fn equal_answers_lead_to_equal_candidates() {
        let sphere_function = |position: &[f64]| Some(vec![position.iter().map(|x| x * x).sum()]);
        let short_evolution = Evolution { candidate_count: 150, ..TEST_EVOLUTION };
        assert_eq!(
            run_evolution(TEST_EVOLUTION, sphere_function)[..100],
            run_evolution(short_evolution, sphere_function)[..100]
        );
        assert_ne!(
            run_evolution(short_evolution, sphere_function),
            run_evolution(Evolution { seed: 2, ..short_evolution }, sphere_function)
        );
    }
}
