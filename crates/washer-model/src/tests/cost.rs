//! Tests of the number of arithmetic operations of a right-hand side.

use super::instruments::{paper_machine, prepare_point, triangular_spin};
use crate::coordinates::STATES;
use crate::nonlinear::coupling::{Caps, Coupling};
use crate::run::model::{LaneModel, LinearModel, NonlinearModel};
use core::cell::Cell;
use lane_ode::{Lane, N, Real};

/// Numbers of arithmetic operations. A fused multiplication and addition counts as both; changes of
/// sign do not count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct OperationCount {
    multiplications: u32,
    additions: u32,
    /// The number of fused multiplications and additions.
    fused_operations: u32,
    divisions: u32,
    square_roots: u32,
    /// The number of evaluations of sine and cosine of an angle, whose own operations are not
    /// counted.
    sine_cosine_pairs: u32,
}

thread_local! {
    static OPERATION_COUNT: Cell<OperationCount> = const { Cell::new(OperationCount {
        multiplications: 0,
        additions: 0,
        fused_operations: 0,
        divisions: 0,
        square_roots: 0,
        sine_cosine_pairs: 0,
    }) };
}

fn update_count(change: impl FnOnce(&mut OperationCount)) {
    OPERATION_COUNT.with(|cell| {
        let mut operations = cell.get();
        change(&mut operations);
        cell.set(operations);
    });
}

/// Returns the result of a function, and the number of its operations.
fn count_operations<R>(function: impl FnOnce() -> R) -> (R, OperationCount) {
    OPERATION_COUNT.with(|cell| cell.set(OperationCount::default()));
    let result = function();
    (result, OPERATION_COUNT.with(Cell::get))
}

fn count_fused() {
    update_count(|operations| {
        operations.multiplications += 1;
        operations.additions += 1;
        operations.fused_operations += 1;
    });
}

/// A number that counts its operations.
#[derive(Clone, Copy, Debug)]
struct CountingNumber(f64);

impl Real for CountingNumber {
    type Mask = bool;
    fn lit(self, value: f64) -> Self {
        Self(value)
    }
    fn add(self, b: Self) -> Self {
        update_count(|operations| operations.additions += 1);
        Self(self.0 + b.0)
    }
    fn sub(self, b: Self) -> Self {
        update_count(|operations| operations.additions += 1);
        Self(self.0 - b.0)
    }
    fn mul(self, b: Self) -> Self {
        update_count(|operations| operations.multiplications += 1);
        Self(self.0 * b.0)
    }
    fn div(self, b: Self) -> Self {
        update_count(|operations| operations.divisions += 1);
        Self(self.0 / b.0)
    }
    fn neg(self) -> Self {
        Self(-self.0)
    }
    fn mul_add(self, b: Self, c: Self) -> Self {
        count_fused();
        Self(self.0.mul_add(b.0, c.0))
    }
    fn mul_sub(self, b: Self, c: Self) -> Self {
        count_fused();
        Self(self.0.mul_add(b.0, -c.0))
    }
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        count_fused();
        Self((-self.0).mul_add(b.0, c.0))
    }
    fn sqrt(self) -> Self {
        update_count(|operations| operations.square_roots += 1);
        Self(self.0.sqrt())
    }
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    fn sin_cos(self) -> (Self, Self) {
        update_count(|operations| operations.sine_cosine_pairs += 1);
        let (sin, cos) = Real::sin_cos(self.0);
        (Self(sin), Self(cos))
    }
    fn less(self, b: Self) -> bool {
        self.0 < b.0
    }
    fn select(mask: bool, a: Self, b: Self) -> Self {
        if mask { a } else { b }
    }
    fn all(mask: bool) -> bool {
        mask
    }
}

impl Lane for CountingNumber {
    const LANES: usize = 1;
    fn get(self, _: usize) -> f64 {
        self.0
    }
    fn set(&mut self, _: usize, value: f64) {
        self.0 = value;
    }
    fn round(self) -> Self {
        Self(self.0.round_ties_even())
    }
    fn bits(mask: bool) -> u32 {
        u32::from(mask)
    }
}

/// Counts the operations of the forcing, which stages at the same time share, and of the
/// derivative. Asserts that the derivative has the same bits as with plain numbers.
fn count_evaluation<M: LaneModel<CountingNumber>, P: LaneModel<f64>>(
    caps: Option<Caps>,
) -> [OperationCount; 2] {
    let point = prepare_point(paper_machine(0.4, 140.0), triangular_spin(), 50.0);
    let model = M::splat(
        N(CountingNumber(0.0)),
        &point,
        Coupling::new(N(CountingNumber(0.0)), caps.as_ref()),
    );
    let mut x = P::rest_state(&point);
    for (i, x) in x.iter_mut().enumerate() {
        *x += 1e-4 * i as f64;
    }
    let (forcing, forcing_cost) = count_operations(|| model.forcing(N(CountingNumber(7.3))));
    let (dx, derivative_cost) =
        count_operations(|| model.derivative(&forcing, &x.map(|x| N(CountingNumber(x)))));
    let uncounted_model = P::splat(N(0.0), &point, Coupling::new(N(0.0), caps.as_ref()));
    let expected = uncounted_model.derivative(&uncounted_model.forcing(N(7.3)), &x.map(N));
    for i in 0..STATES {
        assert_eq!(dx[i].0.0.to_bits(), expected[i].0.to_bits(), "state {i}");
    }
    [forcing_cost, derivative_cost]
}

/// Counts the operations of an observation within the window: channels and radial distance.
fn count_observation<M: LaneModel<CountingNumber>>() -> OperationCount {
    let point = prepare_point(paper_machine(0.4, 140.0), triangular_spin(), 50.0);
    let model = M::splat(N(CountingNumber(0.0)), &point, Coupling::Springs);
    let x = core::array::from_fn(|i| N(CountingNumber(1e-4 * i as f64)));
    let forcing = model.forcing(N(CountingNumber(7.3)));
    count_operations(|| model.observe(&forcing, &x, &x, true)).1
}

const CAPS: Option<Caps> = Some(Caps { bearings_rad_per_s: 700.0, hinge_rad_per_s: Some(700.0) });

fn nonlinear_cost(caps: Option<Caps>) -> [OperationCount; 2] {
    count_evaluation::<NonlinearModel<CountingNumber>, NonlinearModel<f64>>(caps)
}

fn linear_cost(caps: Option<Caps>) -> [OperationCount; 2] {
    count_evaluation::<LinearModel<CountingNumber>, LinearModel<f64>>(caps)
}

/// Returns the sum of all operations but sines and cosines.
fn sum_operations(count: OperationCount) -> u32 {
    count.multiplications + count.additions + count.divisions + count.square_roots
}

/// Creates operations from their numbers in the order of the fields.
const fn operation_count(
    [
        multiplications,
        additions,
        fused_operations,
        divisions,
        square_roots,
        sine_cosine_pairs,
    ]: [u32; 6],
) -> OperationCount {
    OperationCount {
        multiplications,
        additions,
        fused_operations,
        divisions,
        square_roots,
        sine_cosine_pairs,
    }
}

/// The expected cost of forcing and derivative. A change of the model changes these numbers.
const NONLINEAR_COST: [OperationCount; 2] =
    [operation_count([31, 34, 18, 0, 0, 0]), operation_count([557, 410, 319, 12, 4, 6])];
const LINEAR_COST: [OperationCount; 2] =
    [operation_count([348, 257, 241, 2, 0, 0]), operation_count([143, 135, 131, 0, 0, 0])];
const NONLINEAR_MASS_SCALED_COST: OperationCount = operation_count([753, 580, 474, 16, 4, 6]);
const LINEAR_MASS_SCALED_COST: OperationCount = operation_count([175, 161, 157, 0, 0, 0]);
const NONLINEAR_OBSERVATION_COST: OperationCount = operation_count([410, 278, 209, 0, 0, 6]);
const LINEAR_OBSERVATION_COST: OperationCount = operation_count([334, 267, 215, 0, 0, 0]);

#[test]
fn the_nonlinear_right_hand_side_stays_below_the_naive_formulation() {
    let [forcing, derivative] = nonlinear_cost(None);
    eprintln!("nonlinear: right-hand side {derivative:?}; spin {forcing:?}");
    let OperationCount { multiplications, additions, divisions, square_roots, .. } = derivative;
    assert!(multiplications < 825 && additions < 605 && divisions <= 14 && square_roots <= 4);
    assert_eq!([forcing, derivative], NONLINEAR_COST);
}

#[test]
fn the_cost_of_the_linear_right_hand_side_is_unchanged() {
    let [forcing, derivative] = linear_cost(None);
    eprintln!("linear: right-hand side {derivative:?}; spin and matrices {forcing:?}");
    assert_eq!([forcing, derivative], LINEAR_COST);
}

#[test]
fn the_cost_of_mass_scaling_is_unchanged() {
    let [nonlinear, linear] = [nonlinear_cost(CAPS)[1], linear_cost(CAPS)[1]];
    eprintln!("mass-scaled: nonlinear right-hand side {nonlinear:?}; linear {linear:?}");
    assert_eq!([nonlinear, linear], [NONLINEAR_MASS_SCALED_COST, LINEAR_MASS_SCALED_COST]);
}

#[test]
fn the_cost_of_observation_is_unchanged() {
    let observation_costs = [
        count_observation::<NonlinearModel<CountingNumber>>(),
        count_observation::<LinearModel<CountingNumber>>(),
    ];
    eprintln!("observed: nonlinear {:?}; linear {:?}", observation_costs[0], observation_costs[1]);
    assert_eq!(observation_costs, [NONLINEAR_OBSERVATION_COST, LINEAR_OBSERVATION_COST]);
}

#[test]
fn a_linear_step_costs_less_than_a_nonlinear_one() {
    for caps in [None, CAPS] {
        // A step of RK4 has four derivatives, and the forcing at two new times.
        let step_operations = |[forcing, derivative]: [OperationCount; 2]| {
            4 * sum_operations(derivative) + 2 * sum_operations(forcing)
        };
        let [nonlinear, linear] = [nonlinear_cost(caps), linear_cost(caps)].map(step_operations);
        eprintln!("RK4 step, {caps:?}: {nonlinear} operations nonlinear, {linear} linear");
        assert!(linear < nonlinear);
    }
}
