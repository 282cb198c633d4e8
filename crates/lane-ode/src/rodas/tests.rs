use super::*;
use crate::lane::Lane;
use crate::system::{Ended, Failure, Leg, System};
use crate::tests::array::Array;

type Matrix = [[f64; STAGES]; STAGES];

/// The method in the terms of its order conditions (Hairer and Wanner II, section IV.7): k_i in
/// place of the transformed stages.
struct Conditions {
    alpha: Matrix,
    /// alpha + Gamma
    beta: Matrix,
    gamma: Matrix,
    /// Of the solution, and of its companion without the last stage.
    weights: [[f64; STAGES]; 2],
}

/// Every coefficient, flat: gamma, then the rows of a, C and the dense output.
fn coefficients() -> Vec<f64> {
    let lower = |rows: &[[f64; 7]; STAGES]| -> Vec<f64> {
        (0..STAGES).flat_map(|i| rows[i][..i].to_vec()).collect()
    };
    [vec![GAMMA], lower(&A), lower(&C), DENSE.concat()].concat()
}

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..STAGES).map(|k| a[i][k] * b[k][j]).sum()))
}

fn dot(a: &[f64; STAGES], b: &[f64; STAGES]) -> f64 {
    (0..STAGES).map(|i| a[i] * b[i]).sum()
}

/// Gamma from its inverse, I/gamma - C, row by row.
fn conditions(flat: &[f64]) -> (Conditions, [[f64; STAGES]; 3]) {
    let mut rest = flat.iter().copied();
    let per_gamma = 1.0 / rest.next().unwrap();
    let mut lower = || -> Matrix {
        let mut rows = [[0.0; STAGES]; STAGES];
        for i in 0..STAGES {
            for j in 0..i {
                rows[i][j] = rest.next().unwrap();
            }
        }
        rows
    };
    let (a, c) = (lower(), lower());
    let dense = std::array::from_fn(|_| std::array::from_fn(|_| rest.next().unwrap()));
    let mut gamma = [[0.0; STAGES]; STAGES];
    for i in 0..STAGES {
        gamma[i][i] = 1.0 / per_gamma;
        for j in 0..i {
            gamma[i][j] = (j..i).map(|k| c[i][k] * gamma[k][j]).sum::<f64>() / per_gamma;
        }
    }
    let alpha = times(&a, &gamma);
    let beta = std::array::from_fn(|i| std::array::from_fn(|j| alpha[i][j] + gamma[i][j]));
    let companion = a[STAGES - 1];
    let mut solution = companion;
    solution[STAGES - 1] = 1.0;
    let weights = [solution, companion].map(|m| in_slopes(&m, &gamma));
    (Conditions { alpha, beta, gamma, weights }, dense)
}

/// Weights of the transformed stages as weights of the k_i.
fn in_slopes(m: &[f64; STAGES], gamma: &Matrix) -> [f64; STAGES] {
    std::array::from_fn(|j| (0..STAGES).map(|i| m[i] * gamma[i][j]).sum())
}

/// A rooted tree: the subtrees at its root.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Tree(Vec<Tree>);

impl Tree {
    fn order(&self) -> usize {
        1 + self.0.iter().map(Self::order).sum::<usize>()
    }

    fn density(&self) -> f64 {
        self.0.iter().map(Self::density).product::<f64>() * self.order() as f64
    }

    /// Hairer and Wanner II, Eq. 7.11: beta where a node has one branch, alpha where it has more.
    fn stages(&self, c: &Conditions) -> [f64; STAGES] {
        let matrix = if self.0.len() == 1 { &c.beta } else { &c.alpha };
        let mut product = [1.0; STAGES];
        for branch in &self.0 {
            let below = branch.stages(c);
            for i in 0..STAGES {
                product[i] *= dot(&matrix[i], &below);
            }
        }
        product
    }
}

/// Every tree up to this order: each comes from a smaller one by a leaf more somewhere.
fn trees(order: usize) -> Vec<Tree> {
    fn grown(tree: &Tree) -> Vec<Tree> {
        let with = |mut branches: Vec<Tree>| {
            branches.sort();
            Tree(branches)
        };
        let mut all = vec![with([tree.0.clone(), vec![Tree(Vec::new())]].concat())];
        for (i, branch) in tree.0.iter().enumerate() {
            for taller in grown(branch) {
                let mut branches = tree.0.clone();
                branches[i] = taller;
                all.push(with(branches));
            }
        }
        all
    }
    let mut all = vec![Tree(Vec::new())];
    let mut level = all.clone();
    for _ in 1..order {
        level = level.iter().flat_map(grown).collect();
        level.sort();
        level.dedup();
        all.extend(level.iter().cloned());
    }
    all
}

/// How badly the order conditions are missed: of the solution (5), its companion and the dense
/// output (4), and the nodes.
fn worst_miss(flat: &[f64]) -> f64 {
    let (c, dense) = conditions(flat);
    let mut worst = 0.0_f64;
    for tree in trees(5) {
        let (stages, order) = (tree.stages(&c), tree.order());
        let mut miss = |weights: &[f64; STAGES], s: f64| {
            let error = dot(weights, &stages) - s.powi(order as i32) / tree.density();
            worst = worst.max(error.abs());
        };
        miss(&c.weights[0], 1.0);
        if order < 5 {
            miss(&c.weights[1], 1.0);
            for s in [0.25, 0.5, 0.75] {
                let rows = dense.map(|row| in_slopes(&row, &c.gamma));
                let inner = |i: usize| rows[0][i] + s * (rows[1][i] + s * rows[2][i]);
                let weights = std::array::from_fn(|i| s * (c.weights[0][i] + (1.0 - s) * inner(i)));
                miss(&weights, s);
            }
        }
    }
    let sum = |row: &[f64; STAGES]| row.iter().sum::<f64>();
    for i in 0..STAGES {
        worst =
            worst.max((sum(&c.alpha[i]) - NODE[i]).abs()).max((sum(&c.gamma[i]) - TIME[i]).abs());
    }
    worst
}

#[test]
fn coefficients_meet_the_order_conditions() {
    assert_eq!(trees(5).len(), 17, "rooted trees of orders 1 to 5");
    let flat = coefficients();
    let miss = worst_miss(&flat);
    assert!(miss < 1e-12, "{miss:e}");
    // A mistyped digit would show. Only what the dense output takes of the last stage, the error's
    // estimate, does not touch its order.
    let of_last_stage = |i: usize| flat.len() - i <= 3 * STAGES && (flat.len() - i) % STAGES == 1;
    for i in (0..flat.len()).filter(|&i| !of_last_stage(i)) {
        let mut wrong = flat.clone();
        wrong[i] += 1e-8 * wrong[i].abs().max(1.0);
        let miss = worst_miss(&wrong);
        assert!(miss > 1e-11, "coefficient {i} = {} could be wrong: {miss:e}", flat[i]);
    }
}

/// Two masses, a spring of stiffness `stiffness` between them and a pendulum's restoring force,
/// driven: the distance between the masses stays (nearly) what it was, however stiff the spring.
struct Coupled {
    masses: Masses,
    legs: Vec<Leg>,
    next: usize,
    start: [f64; 4],
    ended: Vec<Ended>,
    ends: Vec<[f64; 4]>,
    /// The middle of every step, by the dense output.
    seen: Vec<(f64, [f64; 4])>,
}

/// Their equations, by the stiffness of the spring.
struct Masses(f64);

/// The same for plain and dual numbers.
fn coupled<T: Lane>(stiffness: f64, push: N<T>, x: &[N<T>; 4]) -> [N<T>; 4] {
    let [a, b, va, vb] = *x;
    let force = (b - a) * stiffness;
    let (sin, _) = a.sin_cos();
    [va, vb, force - 9.0 * sin - 0.1 * va + push, 4.0 * push - 2.0 * force.v()]
}

impl<T: Lane> System<T, 4> for Masses {
    type Forcing = N<T>;
    /// Sets in so smoothly that a stiff spring does not ring.
    fn forcing(&self, t_s: N<T>) -> N<T> {
        let (sin, _) = t_s.sin_cos();
        (sin * (sin * sin)).v()
    }
    fn derivative(&self, push: &N<T>, x: &[N<T>; 4]) -> [N<T>; 4] {
        coupled(self.0, *push, x)
    }
    fn in_range(&self, x: &[N<T>; 4]) -> T::Mask {
        x[0].0.abs().less(x[0].lit(1.5).0)
    }
}

impl Task<f64, 4> for Coupled {
    type System = Masses;
    fn system(&self) -> &Masses {
        &self.masses
    }
    fn next_leg(&mut self, _: usize, ended: Ended, x: &mut [N<f64>; 4]) -> Option<Leg> {
        if ended == Ended::Idle {
            *x = self.start.map(N);
        } else {
            self.ended.push(ended);
            self.ends.push(x.map(|x| x.0));
            if matches!(ended, Ended::Failed { .. }) {
                return None;
            }
        }
        self.next += 1;
        self.legs.get(self.next - 1).copied()
    }
    fn begin(&mut self, _: &N<f64>, _: &[N<f64>; 4], _: &[N<f64>; 4]) {}
    fn observe(&mut self, _: &N<f64>, step: &Step<'_, f64, 4>) {
        let middle = step.end_s.0 - 0.5 * step.length_s.0;
        self.seen.push((middle, step.at(N(0.5)).map(|x| x.0)));
    }
}

impl Stiff<4, 2> for Coupled {
    fn partials(&self, t_s: f64, x: &[N<f64>; 4], partials: &mut Partials<2>) {
        partials.find(Array([0.0; 4]), &self.masses, t_s, x);
    }
}

fn run(stiffness: f64, ends_s: &[f64], relative: f64) -> Coupled {
    let starts = [0.0].into_iter().chain(ends_s.iter().copied());
    let legs =
        starts.zip(ends_s).map(|(start_s, &end_s)| Leg { start_s, end_s, step_s: 1e-4 }).collect();
    let mut task = Coupled {
        masses: Masses(stiffness),
        legs,
        next: 0,
        start: [0.0; 4],
        ended: Vec::new(),
        ends: Vec::new(),
        seen: Vec::new(),
    };
    let tolerance = Tolerance { relative, absolute: 1e-3 * relative, max_steps: 100_000 };
    integrate(&mut task, &tolerance);
    task
}

#[test]
fn partials_are_exact_and_do_not_depend_on_the_lanes() {
    let task = run(50.0, &[], 1e-3);
    let x = [0.4, 0.5, -1.0, 2.0].map(N);
    let mut one = Partials::<2>::zero();
    one.find(0.0, &task.masses, 2.0, &x);
    let mut four = Partials::<2>::zero();
    four.find(Array([0.0; 4]), &task.masses, 2.0, &x);
    assert_eq!(format!("{one:?}"), format!("{four:?}"));
    let close =
        |ours: N<f64>, exact: f64| assert!((ours.0 - exact).abs() < 1e-13, "{} {exact}", ours.0);
    let [[aa, ab], [ba, bb]] = one.by_coordinate;
    close(aa, -50.0 - 9.0 * 0.4_f64.cos());
    close(ab, 50.0);
    close(ba, 100.0);
    close(bb, -100.0);
    close(one.by_speed[0][0], -0.1);
    close(one.by_speed[1][0], 0.0);
    let rate = 3.0 * 2.0_f64.sin().powi(2) * 2.0_f64.cos();
    close(one.by_time[0], rate);
    close(one.by_time[1], 4.0 * rate);
}

#[test]
fn it_converges_with_its_tolerance_between_steps_as_at_them() {
    let ends = [1.0, 7.0];
    let fine = run(50.0, &ends, 1e-12);
    let mut last = f64::INFINITY;
    for relative in [1e-4, 1e-6, 1e-8] {
        let coarse = run(50.0, &ends, relative);
        let error =
            |a: &[f64; 4], b: &[f64; 4]| (0..4).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max);
        let at_end = error(&coarse.ends[1], &fine.ends[1]);
        // Where a middle of a coarse step is, by one more run that ends there.
        let (time, middle) = coarse.seen[coarse.seen.len() * 2 / 3];
        let inside = error(&middle, &run(50.0, &[1.0, time], 1e-12).ends[1]);
        assert!(
            at_end < 20.0 * relative && inside < 20.0 * relative,
            "{relative}: {at_end:e} {inside:e}"
        );
        assert!(at_end < 0.1 * last, "{at_end:e} after {last:e}");
        last = at_end;
    }
}

#[test]
fn a_stiff_spring_costs_no_steps() {
    let count = |task: &Coupled| match task.ended.last() {
        Some(Ended::Arrived(count)) => count.accepted + count.rejected,
        other => panic!("{other:?}"),
    };
    let soft = run(1e6, &[10.0], 1e-6);
    let stiff = run(1e14, &[10.0], 1e-6);
    // An explicit method would need a hundred million.
    assert!(count(&soft) < 1000 && count(&stiff) < 1000, "{} {}", count(&soft), count(&stiff));
    let (a, b) = (soft.ends[0], stiff.ends[0]);
    assert!((a[0] - b[0]).abs() < 1e-4 && (a[1] - b[1]).abs() < 1e-4, "{a:?} {b:?}");
    assert!((b[0] - b[1]).abs() < 1e-9, "{b:?}");
}

#[test]
fn failures_say_why_and_when() {
    let until_failure = |stiffness: f64, start: [f64; 4], max_steps: u64| {
        let legs = vec![Leg { start_s: 0.0, end_s: 10.0, step_s: 1e-4 }];
        let mut task = Coupled { legs, start, next: 0, ..run(stiffness, &[], 1e-6) };
        integrate(&mut task, &Tolerance { relative: 1e-6, absolute: 1e-9, max_steps });
        task.ended
    };
    let ended = until_failure(50.0, [0.0; 4], 20);
    let [Ended::Failed { reason: Failure::StepLimit, time_s, count }] = ended[..] else {
        panic!("{ended:?}")
    };
    assert!(time_s > 0.0 && time_s < 10.0 && count.accepted + count.rejected == 20);

    let ended = until_failure(50.0, [1.4, 1.4, 3.0, 3.0], 1000);
    let [Ended::Failed { reason: Failure::Diverged, time_s, .. }] = ended[..] else {
        panic!("{ended:?}")
    };
    assert!(time_s > 0.01 && time_s < 0.1, "{time_s}");

    let ended = until_failure(f64::INFINITY, [0.0; 4], 1000);
    assert!(
        matches!(ended[..], [Ended::Failed { reason: Failure::StepTooSmall, .. }]),
        "{ended:?}"
    );
}
