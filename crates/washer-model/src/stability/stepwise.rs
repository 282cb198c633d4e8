//! The effect of a turn's steps themselves on small disturbances of its start: the turn once more,
//! over dual numbers.
//!
//! Steps that are longer than forces' corners are wide land beside these or on them, and what they
//! make of a disturbance is not what the motion makes of it (`monodromy.rs`). Newton's method asks
//! for the steps' own.

use super::monodromy::Square;
use super::turn::{Clock, Unwatched, turn};
use crate::coordinates::STATES;
use crate::run::model::Nonlinear;
use lane_ode::{Aside, Dual, Lane, N};

/// A turn from a state. Lanes share its disturbances.
pub(super) struct Stepwise<T> {
    pub(super) zero: N<T>,
    /// A number that is the same in every lane.
    pub(super) model: Nonlinear<Dual<T>>,
    pub(super) clock: Clock<Dual<T>>,
    pub(super) start: [f64; STATES],
}

impl<T: Lane> Aside for Stepwise<T> {
    type Output = Square;

    #[inline(always)]
    fn run(self) -> Square {
        let mut groups = vec![[self.zero.constant(); STATES]; STATES.div_ceil(T::LANES)];
        for j in 0..STATES {
            let group = &mut groups[j / T::LANES];
            for i in 0..STATES {
                group[i].0.value.set(j % T::LANES, self.start[i]);
            }
            group[j].0.slope.set(j % T::LANES, 1.0);
        }
        turn(&self.model, &self.clock, &mut groups, None::<&mut Unwatched>);
        let mut matrix = [[N(0.0); STATES]; STATES];
        for i in 0..STATES {
            for j in 0..STATES {
                matrix[i][j] = N(groups[j / T::LANES][i].0.slope.get(j % T::LANES));
            }
        }
        matrix
    }
}

#[cfg(test)]
mod tests {
    use crate::stability::tests::{idle_stop, prepared, with};
    use crate::{Dwell, Machine, Point, respond};

    /// The paper's machine with 0.3 kg on dampers of 30 N s/m, whose response folds back.
    fn folded(change: impl Fn(&mut Machine)) -> Point {
        let mut machine = with(0.3, 30.0);
        change(&mut machine);
        prepared(machine, 100.0)
    }

    #[test]
    fn an_element_that_does_nothing_leaves_the_curve_where_it_is() {
        let points = [
            folded(|_| {}),
            folded(|machine| machine.stops.push(idle_stop())),
            folded(|machine| machine.dampers[0].friction_n = 1e-6),
        ];
        let [without, others @ ..] = points.each_ref().map(|point| {
            let dwells = [60.0, 110.0, 185.0, 255.0].map(|speed_rpm| Dwell { point, speed_rpm });
            let found: Vec<_> =
                respond(&dwells, lane_ode::Cancel::Never).into_iter().map(Result::unwrap).collect();
            found.concat().into_iter().filter(|response| response.is_on_curve).collect::<Vec<_>>()
        });
        // At 255 rpm it has three.
        assert_eq!(without.len(), 6);
        for with in others {
            assert_eq!(with.len(), without.len());
            for (one, other) in with.iter().zip(&without) {
                let at = one.speed_rpm;
                assert_eq!(one.branch, other.branch, "{at}");
                for (a, b) in one.nonlinear.iter().zip(&other.nonlinear) {
                    assert!((a / b - 1.0).abs() < 1e-3, "{at}: {a} for {b}");
                }
                let folds =
                    one.between_rpm.iter().flatten().zip(other.between_rpm.iter().flatten());
                assert!(folds.into_iter().all(|(a, b)| (a - b).abs() < 0.05), "{at}");
            }
        }
    }
}
