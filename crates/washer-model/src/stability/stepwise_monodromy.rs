//! The derivative of a discrete turn by its start: all steps are integrated with dual numbers.
//!
//! If steps are longer than the width of a force's corner, their effect on a disturbance differs
//! from that of the motion (`monodromy.rs`). Newton's method for the discrete turn needs the
//! derivative of the steps.

use super::monodromy::StateMatrix;
use super::turn::{NoObserver, StepGrid, integrate_turn};
use crate::coordinates::STATES;
use crate::run::model::NonlinearModel;
use lane_ode::{Dual, Lane, N, OutOfLine};

/// The computation of the monodromy matrix of a discrete turn. Lanes hold its columns.
pub(super) struct StepwiseMonodromy<T> {
    pub(super) zero: N<T>,
    /// The model and the steps, the same in every lane.
    pub(super) model: NonlinearModel<Dual<T>>,
    pub(super) grid: StepGrid<Dual<T>>,
    pub(super) start_state: [f64; STATES],
}

impl<T: Lane> OutOfLine for StepwiseMonodromy<T> {
    type Output = StateMatrix;

    #[inline(always)]
    fn run(self) -> StateMatrix {
        let mut lane_groups = vec![[self.zero.constant(); STATES]; STATES.div_ceil(T::LANES)];
        for j in 0..STATES {
            let lane_group = &mut lane_groups[j / T::LANES];
            for i in 0..STATES {
                lane_group[i].0.value.set(j % T::LANES, self.start_state[i]);
            }
            lane_group[j].0.slope.set(j % T::LANES, 1.0);
        }
        integrate_turn(&self.model, &self.grid, &mut lane_groups, None::<&mut NoObserver>);
        let mut matrix = [[N(0.0); STATES]; STATES];
        for i in 0..STATES {
            for j in 0..STATES {
                matrix[i][j] = N(lane_groups[j / T::LANES][i].0.slope.get(j % T::LANES));
            }
        }
        matrix
    }
}

#[cfg(test)]
mod tests {
    use crate::stability::tests::{idle_stop, machine_with, prepare_at_speed};
    use crate::{HeldSpeed, Machine, Point, find_responses};

    /// Returns the paper's machine with 0.3 kg on dampers of 30 N s/m, whose curve of responses has
    /// folds.
    fn folding_machine(change: impl Fn(&mut Machine)) -> Point {
        let mut machine = machine_with(0.3, 30.0);
        change(&mut machine);
        prepare_at_speed(machine, 100.0)
    }

    #[test]
    fn an_element_without_force_does_not_change_the_curve() {
        let points = [
            folding_machine(|_| {}),
            folding_machine(|machine| machine.stops.push(idle_stop())),
            folding_machine(|machine| machine.dampers[0].friction_n = 1e-6),
        ];
        let [plain_responses, other_responses @ ..] = points.each_ref().map(|point| {
            let held_speeds =
                [60.0, 110.0, 185.0, 255.0].map(|speed_rpm| HeldSpeed { point, speed_rpm });
            let responses: Vec<_> = find_responses(&held_speeds, lane_ode::Cancel::Never)
                .into_iter()
                .map(Result::unwrap)
                .collect();
            responses
                .concat()
                .into_iter()
                .filter(|response| response.is_on_curve)
                .collect::<Vec<_>>()
        });
        // There are three responses at 255 rpm, and one at each other speed.
        assert_eq!(plain_responses.len(), 6);
        for responses in other_responses {
            assert_eq!(responses.len(), plain_responses.len());
            for (response_with_element, response_without_element) in
                responses.iter().zip(&plain_responses)
            {
                let speed_rpm = response_with_element.speed_rpm;
                assert_eq!(
                    response_with_element.branch, response_without_element.branch,
                    "{speed_rpm}"
                );
                for (a, b) in response_with_element
                    .nonlinear_peaks
                    .iter()
                    .zip(&response_without_element.nonlinear_peaks)
                {
                    assert!((a / b - 1.0).abs() < 1e-3, "{speed_rpm}: {a} for {b}");
                }
                let fold_pairs = response_with_element
                    .fold_speeds_rpm
                    .iter()
                    .flatten()
                    .zip(response_without_element.fold_speeds_rpm.iter().flatten());
                assert!(fold_pairs.into_iter().all(|(a, b)| (a - b).abs() < 0.05), "{speed_rpm}");
            }
        }
    }
}
