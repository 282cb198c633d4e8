//! A row on its way: both models' trajectories, each as far up its ladder as it has come.

use washer_model::{Channel, ModelKind, Point, Swing};

use crate::ladder::{Ladder, Rung};
use crate::measures::{CREEPING_M_PER_S, Floor, Left, Metric, TURN_FLOOR};
use crate::outcome::{Deviations, Outcome, Status, Trajectory};
use crate::run::{Rule, RungRun};
use crate::twin::Departure;
use crate::verdict::Verdict;

/// What an outcome must be good for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Demand {
    /// A row: every number within the accuracy, and the verdict.
    Row,
    /// The side of the limit on which the ratio is, and the ratio if it is near the limit.
    Side,
    /// How fast disturbances grow at constant speeds, and nothing of the run.
    Growth,
}

/// Ratios further from the limit than this many times their error are on their side of it.
const SURE: f64 = 2.0;

/// A model whose error times this is less than the margin is not what leaves the side in doubt.
const SHARE: f64 = 4.0;

/// An amplitude is within this many times the difference of two runs that have left their common
/// course.
const ROUGHLY: f64 = 2.0;

/// Two runs that differ by no more than this have one course.
const COMMON_COURSE: f64 = 0.05;

/// Fail times that differ by less than this share of the run are one, a fifth of what they may be
/// off: they err by a step. Where a trajectory fails for a step that is too long, the times at two
/// steps differ by more: by 6e-4 was seen.
const SAME_TIME: f64 = 2e-5;

/// Differences of metrics are shares of the greater of their value and this part of what they are
/// measured against.
const METRIC_FLOOR: f64 = 1e-3;

/// A capped hinge errs in its bend under gravity by so many times the accuracy, at most: 15 was
/// seen. So motions as small as that bend times this are for plain RK4.
const SAGS: f64 = 32.0;

/// Ringing whose bound is a greater share of the accuracy is looked at again, by modes: that takes
/// eigenvalues.
const FREE_OF_MODES: f64 = 0.1;

/// Differences of a turn's peak count so many times. Where it lies beside the turn's cut, it errs
/// with the phase of the motion, and shrinks less from rung to rung than the motion's error does.
const TURN_WEIGHT: f64 = 3.0;

/// Differences of which all is left count so many times: an error of 1.86 times one was seen.
const WEIGHT_OF_ALL: f64 = 2.0;

/// The time of a clash on a capped rung errs by so many times its difference from the rung before:
/// 2.6 was seen where drum and tub touch by a micrometre.
const CLASH_WEIGHT: f64 = 4.0;

/// One model's trajectory on its ladder.
#[derive(Clone, Debug, Default)]
struct Climb {
    /// The rung of `run`.
    rung: usize,
    /// The last run, but for a twin's.
    run: Option<RungRun>,
    /// How far each run was from the one before; absent where they do not compare.
    differences: Vec<Option<Difference>>,
    /// The error that `run` and the run before it have in common.
    unseen: f64,
    /// What `run` errs besides, however alike the runs are: by its caps, and in its least gap.
    besides: f64,
    /// What a near twin says, once there was one.
    twin: Option<Twin>,
}

/// A near twin of a run.
#[derive(Clone, Copy, Debug)]
struct Twin {
    is_chaotic: bool,
    /// How far its numbers are from the row's; absent where one of them failed.
    spread: Option<f64>,
}

/// By what rows are judged, all alike.
#[derive(Clone, Copy, Debug)]
pub struct Terms<'a> {
    /// Of both models, in the order of [`ModelKind::ALL`].
    pub ladders: &'a [Ladder; 2],
    /// What outcomes must be good for.
    pub demand: Demand,
    /// What rows take from trajectories.
    pub rule: &'a Rule,
}

impl<'a> Terms<'a> {
    fn of(self, model: usize, point: &'a Point) -> Judge<'a> {
        let (ladder, model) = (&self.ladders[model], ModelKind::ALL[model]);
        Judge { ladder, point, model, rule: self.rule }
    }
}

/// What one model's runs at a point are judged by.
#[derive(Clone, Copy)]
struct Judge<'a> {
    ladder: &'a Ladder,
    point: &'a Point,
    model: ModelKind,
    rule: &'a Rule,
}

impl Climb {
    fn take(&mut self, rung: usize, now: RungRun, by: Judge<'_>) {
        let Some(before) = self.run.take() else {
            (self.rung, self.run) = (rung, Some(now));
            return;
        };
        let found = by.difference(&before, &now);
        if rung == by.ladder.twin() {
            let departure = Departure::new(&by.point.departure(&before.course, &now.course));
            let spread = found.map(|found| found.of_numbers);
            self.twin = Some(Twin { is_chaotic: departure.is_exponential(), spread });
            self.run = Some(before);
            return;
        }
        let is = &by.ladder.rungs[rung];
        self.unseen = by.unseen(&now, is);
        let of_clash = by.of_clash(&before, &now, is);
        self.besides = by.of_sag(&now, is).max(of_clash).max(by.of_gap(&now, is));
        self.differences.push(found);
        (self.rung, self.run) = (rung, Some(now));
    }

    /// How far the last run is from the one before.
    fn difference(&self) -> Option<Difference> {
        *self.differences.last()?
    }

    /// How far the numbers of the one before were from its own, if there was one.
    fn earlier(&self) -> f64 {
        let earlier = self.differences.iter().rev().nth(1);
        earlier.map_or(0.0, |found| found.map_or(f64::INFINITY, |found| found.of_numbers))
    }

    /// The error left of what is compared; absent where nothing says so. `unseen` is what no
    /// comparison shows.
    fn error_with(&self, ladder: &Ladder, unseen: f64) -> Option<f64> {
        let convergence = &ladder.rungs[self.rung].convergence;
        // Not a number, and left out, where no share of an infinite one counts.
        let unseen = unseen.max(convergence.of_earlier * self.earlier());
        if self.is_chaotic() {
            return self.spread().map(|spread| (ROUGHLY * spread).max(unseen));
        }
        let found = self.difference()?;
        let is_common = found.of_course <= COMMON_COURSE;
        let is_finer = ladder.is_finer(self.rung);
        // From the reference on, a course in common is enough: phases that differ, and bearings
        // that still ring in another, are no number's error. Nothing behind it settles the course.
        if is_finer || is_common && Some(self.rung) == ladder.reference() {
            let share = if is_common { convergence.contraction } else { ROUGHLY };
            return Some((share * found.of_numbers).max(unseen));
        }
        let of_caps = convergence.of_caps * found.of_caps;
        Some(convergence.error_left(found.greatest(), unseen).max(of_caps).max(found.left))
    }

    fn error(&self, ladder: &Ladder) -> Option<f64> {
        let error = self.error_with(ladder, self.unseen)?.max(self.besides);
        error.is_finite().then_some(error)
    }

    /// The error left, also where errors are not of first order any more.
    fn roughly(&self, ladder: &Ladder) -> Option<f64> {
        let of_numbers = self.spread().map(|spread| (ROUGHLY * spread).max(self.unseen));
        self.error(ladder).zip(of_numbers).map(|(error, of_numbers)| error.min(of_numbers))
    }

    /// Whether a twin departs as chaos has it.
    fn is_chaotic(&self) -> bool {
        self.twin.is_some_and(|twin| twin.is_chaotic)
    }

    /// How far the numbers of the row are from those of the run before, and from the twin's.
    fn spread(&self) -> Option<f64> {
        let from_before = self.difference()?.of_numbers;
        match self.twin {
            Some(twin) => twin.spread.map(|spread| spread.max(from_before)),
            None => Some(from_before),
        }
    }

    fn failed(&self) -> bool {
        self.run.as_ref().is_some_and(|run| run.trajectory.status != Status::Ok)
    }

    /// The run to ask for next for an error of at most `tolerance`; none if it is there, or if no
    /// further run would help.
    fn higher(&self, by: Judge<'_>) -> Option<usize> {
        let Some(run) = &self.run else { return Some(by.first()) };
        let (ladder, tolerance) = (by.ladder, by.rule.accuracy);
        let reference = ladder.reference()?;
        if self.failed() && self.rung + 1 < reference {
            // It may be the caps that do not hold: RK4 has the word, and at both steps.
            return Some(reference - 1);
        }
        let is_settled = |error: Option<f64>| error.is_some_and(|error| error <= tolerance);
        if is_settled(self.error(ladder)) || self.is_chaotic() {
            return None;
        }
        let is_in_doubt = !is_settled(self.error_with(ladder, 0.0));
        if self.rung >= ladder.judge().unwrap_or(reference) {
            // What two steps of plain RK4 leave in doubt may be chaos, which no step settles.
            let may_be_chaos = is_in_doubt && by.model == ModelKind::Nonlinear;
            if may_be_chaos && self.twin.is_none() && Some(self.rung) == ladder.judge() {
                return Some(ladder.twin());
            }
            // The last step is for bearings that ring.
            if self.unseen.max(self.besides) <= tolerance {
                return None;
            }
        }
        let mut higher = self.rung + 1..ladder.rungs.len();
        if is_in_doubt {
            return higher.next();
        }
        // Rungs that leave as much out as this one settle nothing.
        let last = higher.clone().last();
        higher.find(|rung| by.left_out(run, &ladder.rungs[*rung]) <= tolerance).or(last)
    }
}

/// A point's row in the making: each model as far up its ladder as it has come.
#[derive(Clone, Debug, Default)]
pub struct Climbs([Climb; 2]);

/// What a row needs next.
#[derive(Clone, Debug)]
pub enum Next {
    /// These runs: positions in [`ModelKind::ALL`] and on that model's ladder.
    Runs(Vec<(usize, usize)>),
    /// Nothing.
    Done(Box<Outcome>),
}

impl Climbs {
    /// A run of a model that was asked for.
    pub fn take(&mut self, kind: (usize, usize), run: RungRun, point: &Point, terms: Terms<'_>) {
        let (model, rung) = kind;
        self.0[model].take(rung, run, terms.of(model, point));
    }

    /// The last run of a model with its rung and the error left in it, once there is one. The error
    /// is absent where nothing says so.
    pub fn last(&self, model: usize, ladder: &Ladder) -> Option<(&RungRun, usize, Option<f64>)> {
        let climb = &self.0[model];
        climb.run.as_ref().map(|run| (run, climb.rung, climb.error(ladder)))
    }

    /// Steps of a model's last run; none before it.
    pub fn steps(&self, model: usize) -> u64 {
        self.0[model].run.as_ref().map_or(0, |run| run.trajectory.steps)
    }

    /// What is to be done once every run that was asked for is there. `id` is what the outcome
    /// calls the point.
    pub fn next(&self, id: u64, point: &Point, terms: Terms<'_>) -> Next {
        let Terms { ladders, demand, rule } = terms;
        if demand == Demand::Growth {
            return Next::Done(Box::new(Outcome::failed(id, Status::Ok)));
        }
        let outcome = self.outcome(id, point, terms);
        let margin = outcome.as_ref().and_then(|outcome| margin(outcome, rule));
        let is_sure = |climb: &Climb, ladder: &Ladder| match (demand, margin) {
            (Demand::Side, Some(margin)) => {
                climb.roughly(ladder).is_some_and(|error| SURE * error <= margin)
            }
            _ => false,
        };
        let higher = |(model, climb): (usize, &Climb)| {
            let rung = climb.higher(terms.of(model, point))?;
            (!is_sure(climb, &ladders[model])).then_some((model, rung))
        };
        let mut runs: Vec<_> = self.0.iter().enumerate().filter_map(higher).collect();
        let Some(outcome) = outcome.filter(|_| runs.is_empty()) else { return Next::Runs(runs) };
        // The verdict is plain RK4's: where the error left could turn it, RK4 has the word.
        let errors = [0, 1].map(|model| self.0[model].error(&ladders[model]));
        let sum: f64 = errors.iter().flatten().sum();
        if let Some(margin) = margin.filter(|margin| *margin <= sum) {
            for (model, climb) in self.0.iter().enumerate() {
                let reference = ladders[model].reference();
                let Some(reference) = reference.filter(|reference| climb.rung < *reference) else {
                    continue;
                };
                match demand {
                    // By way of its first step: only RK4 against RK4 tells chaos from a coarse
                    // rung.
                    Demand::Row => runs.push((model, (climb.rung + 1).max(reference - 1))),
                    // The next rung may settle the side; where it cannot, the one after does.
                    Demand::Side if errors[model].is_some_and(|error| SHARE * error > margin) => {
                        runs.push((model, climb.rung + 1));
                    }
                    Demand::Side | Demand::Growth => {}
                }
            }
        }
        if runs.is_empty() { Next::Done(Box::new(outcome)) } else { Next::Runs(runs) }
    }

    /// The row as it is now, once both models have run.
    fn outcome(&self, id: u64, point: &Point, terms: Terms<'_>) -> Option<Outcome> {
        let Terms { ladders, rule, .. } = terms;
        let [nonlinear, linear] = &self.0;
        let trajectory = |climb: &Climb| climb.run.as_ref().map(|run| run.trajectory.clone());
        let mut outcome = Outcome::new(id, trajectory(nonlinear)?, trajectory(linear)?);
        outcome.compare_turns(&rule.channels);
        outcome.method = ladders[0].rungs[nonlinear.rung].level;
        if rule.measures.metrics.contains(&Metric::StaticSag) {
            outcome.static_sag_m = Some(point.static_sag_m());
        }
        if ladders.iter().all(|ladder| ladder.reference().is_some()) {
            let errors = nonlinear.error(&ladders[0]).zip(linear.error(&ladders[1]));
            outcome.error = errors.map(|(nonlinear, linear)| nonlinear.max(linear));
            outcome.converged = Some(outcome.error.is_some_and(|error| error <= rule.accuracy));
            // A twin that is off where RK4 agrees with itself leaves an error, and no chaos.
            let of_rk4 = nonlinear.difference().map(|difference| difference.of_numbers);
            let disagrees = of_rk4.is_none_or(|of_numbers| of_numbers > rule.accuracy);
            outcome.sensitive = Some(nonlinear.is_chaotic() && disagrees);
        }
        Some(outcome)
    }
}

/// How far the ratios are from a limit, as a share of the limit.
fn margin(outcome: &Outcome, rule: &Rule) -> Option<f64> {
    let Verdict { least, greatest, .. } = Verdict::new(outcome, rule.channels.len(), rule.limits);
    Some(rule.limits.margin(least?.1, greatest?.1))
}

/// How far two runs are apart, relative.
#[derive(Clone, Copy, Debug, Default)]
struct Difference {
    /// Over the course of the motion.
    of_course: f64,
    /// In every number that a row takes from it.
    of_numbers: f64,
    /// In those of them that caps move more than the motion.
    of_caps: f64,
    /// In those of which all of it is left.
    left: f64,
}

impl Difference {
    fn greatest(self) -> f64 {
        self.of_course.max(self.of_numbers)
    }
}

impl Judge<'_> {
    /// The rung to begin with: the reference's longer step where the first rung leaves out more of
    /// what the gap rings than it may err, even at the end of the run.
    fn first(&self) -> usize {
        let share = |swing: &Swing| swing.gap_m / self.point.clearance_m();
        let of_gap = |rung| self.of_ringing(rung, |_| [self.rule.end_s; 2], share);
        match self.ladder.reference() {
            Some(reference) if of_gap(&self.ladder.rungs[0]) > self.rule.accuracy => reference - 1,
            _ => 0,
        }
    }

    /// How far two runs are apart; `None` if one of them failed, or both at different times.
    fn difference(&self, a: &RungRun, b: &RungRun) -> Option<Difference> {
        let (of_a, of_b) = (&a.trajectory, &b.trajectory);
        if of_a.status != of_b.status {
            return None;
        }
        if of_b.status != Status::Ok {
            let (a_s, b_s) = of_a.fail_time_s.zip(of_b.fail_time_s)?;
            let is_one = (a_s - b_s).abs() <= SAME_TIME * self.rule.end_s;
            return is_one.then_some(Difference::default());
        }
        let of_course = self.point.course_difference(self.model, &a.course, &b.course);
        let [of_motion, of_caps, left] = self.of_numbers(of_a, of_b);
        let of_numbers = of_motion.max(of_caps).max(left);
        Some(Difference { of_course, of_numbers, of_caps, left })
    }

    /// The error that this rung has in common with others, so that no comparison shows it: what
    /// bearings and hinge swing after jumps.
    fn unseen(&self, run: &RungRun, rung: &Rung) -> f64 {
        let share = |swing: &Swing| self.of_motion(&swing.channels, &run.trajectory);
        let of_swings = self.of_ringing(rung, |_| self.point.window_s(), share);
        let of_clash = self.clash_s(run).zip(run.clash_doubt_s);
        of_clash.map_or(of_swings, |(time_s, doubt_s)| {
            of_swings.max(doubt_s / time_s.max(self.clash_floor_s()))
        })
    }

    /// What caps make of the time of a clash, or of a stop's contact, that just happens, by its
    /// difference from the run before: it is as the root of the depth, and has no first order.
    fn of_clash(&self, before: &RungRun, run: &RungRun, rung: &Rung) -> f64 {
        let numbers = self.rule.measures.of_model().zip(&before.trajectory.metrics);
        let numbers = numbers.zip(&run.trajectory.metrics).filter(|((number, _), _)| {
            rung.level.is_capped() && number.metric.facts().floor == Floor::PartOfWindow
        });
        let floor_s = self.clash_floor_s();
        let shares = numbers.map(|((_, a_s), b_s)| (a_s - b_s).abs() / b_s.max(floor_s));
        CLASH_WEIGHT * shares.fold(0.0, f64::max)
    }

    /// What the gap rings where it may be least, as a share of the clearance. No motion amplifies
    /// it.
    fn of_gap(&self, run: &RungRun, rung: &Rung) -> f64 {
        let Some(gap_m) = run.trajectory.min_gap_m else { return 0.0 };
        let least_m = gap_m.abs().max(self.point.clearance_m());
        let from_s = |bound: &Swing| self.point.gap_least_from_s(&run.course, bound.gap_m);
        let within_s = |bound: &Swing| [from_s(bound), self.rule.end_s];
        self.of_ringing(rung, within_s, |swing| swing.gap_m / least_m)
    }

    /// The error of a run like this one by what a rung leaves out of ringing and sag.
    fn left_out(&self, run: &RungRun, rung: &Rung) -> f64 {
        self.unseen(run, rung).max(self.of_gap(run, rung)).max(self.of_sag(run, rung))
    }

    /// What a rung leaves out of ringing, in parts of the motion by `share`: by a bound, and where
    /// that is not enough, by modes and what is left of them in an interval.
    fn of_ringing(
        &self,
        rung: &Rung,
        within_s: impl Fn(&Swing) -> [f64; 2],
        share: impl Fn(&Swing) -> f64,
    ) -> f64 {
        let bound = self.point.ringing(rung.left_out);
        match share(&bound) > FREE_OF_MODES * self.rule.accuracy {
            true => share(&self.point.ringing_left(rung.left_out, within_s(&bound))),
            false => share(&bound),
        }
    }

    /// What caps make of the hinge's bend under gravity. No motion amplifies that.
    fn of_sag(&self, run: &RungRun, rung: &Rung) -> f64 {
        if !rung.level.is_capped() {
            return 0.0;
        }
        let sags = self.point.hinge_sag().map(|sag| SAGS * self.rule.accuracy * sag);
        self.of_motion(&sags, &run.trajectory)
    }

    /// The greatest of these deviations (m, rad) as a share of the motion's in the same channel.
    fn of_motion(&self, deviations: &Deviations, numbers: &Trajectory) -> f64 {
        let share = |channel: &Channel, of: f64| match deviations[channel.index()] {
            0.0 => 0.0,
            deviation => deviation / of,
        };
        let channels = || self.rule.channels.iter();
        let of_amplitudes = channels().zip(&numbers.amplitudes).map(|(of, most)| share(of, *most));
        let of_turns = numbers.turns.iter().flat_map(|turn| {
            channels().map(|channel| share(channel, turn[channel.index()].max(TURN_FLOOR)))
        });
        of_amplitudes.chain(of_turns).fold(0.0, f64::max)
    }

    /// The time of a clash, if the row has it.
    fn clash_s(&self, run: &RungRun) -> Option<f64> {
        let mut metrics = self.rule.measures.of_model().zip(&run.trajectory.metrics);
        metrics.find(|(number, _)| number.metric == Metric::ClashTime).map(|(_, time_s)| *time_s)
    }

    /// A clash that just happens is a time that just is not zero: shorter ones are compared with
    /// this.
    fn clash_floor_s(&self) -> f64 {
        let [from_s, to_s] = self.rule.window_s;
        METRIC_FLOOR * (to_s - from_s)
    }

    /// The greatest relative differences of what a row takes from two trajectories, by what is left
    /// of them ([`Left`]).
    fn of_numbers(&self, a: &Trajectory, b: &Trajectory) -> [f64; 3] {
        let Self { point, rule, .. } = self;
        let mut greatest = [0.0_f64; 3];
        let mut compare = |left: Left, a: f64, b: f64, least: f64| {
            if a != b {
                // A quotient that is no number must not pass for none.
                let share = (a - b).abs() / b.abs().max(least);
                let share = if left == Left::All { WEIGHT_OF_ALL * share } else { share };
                let greatest = &mut greatest[left as usize];
                *greatest = if share.is_nan() { f64::INFINITY } else { greatest.max(share) };
            }
        };
        for (a, b) in a.amplitudes.iter().zip(&b.amplitudes) {
            compare(Left::OfMotion, *a, *b, 0.0);
        }
        if let Some((a, b)) = a.min_gap_m.zip(b.min_gap_m) {
            compare(Left::OfCaps, a, b, point.clearance_m());
        }
        for ((a, b), number) in a.metrics.iter().zip(&b.metrics).zip(rule.measures.of_model()) {
            let facts = number.metric.facts();
            let least = match facts.floor {
                Floor::None => 0.0,
                Floor::PartOfWindow => self.clash_floor_s(),
                Floor::Weight => point.weight_n(),
                Floor::PartOfWeight => METRIC_FLOOR * point.weight_n(),
                Floor::Creeping => CREEPING_M_PER_S,
            };
            compare(facts.left, *a, *b, least);
        }
        for (a, b) in a.turns.iter().zip(&b.turns) {
            for channel in &rule.channels {
                let i = channel.index();
                let (a, b) = (a[i].max(TURN_FLOOR), b[i].max(TURN_FLOOR));
                compare(Left::OfMotion, b + TURN_WEIGHT * (a - b), b, 0.0);
            }
        }
        greatest
    }
}
