//! The fast method as a ladder: the same trajectory by finer and finer rungs, until two of them
//! agree.
//!
//! The lower rungs cap the modes of bearings and hinge (`washer_model::Cases`), each for a smaller
//! error than the one before; the last two are plain RK4 at two steps, the shorter one the
//! reference. The error of a rung is estimated from its difference to the rung before, over the
//! whole course of the motion and in every number of the row. Steps and caps say which share of
//! that difference is left as error, as long as errors are small enough to be of first order.
//! Motions that pass through bands of instability amplify errors a thousandfold and climb. Chaotic
//! motions climb to half the reference's step, where RK4 does not agree with itself and a twin
//! departs. Still shorter steps are for jumps of the drum's acceleration: the bearings keep
//! swinging after them, and only the last steps follow.
//!
//! Friction and stops give forces corners. A step that spans one errs by its own length, whatever
//! the order of its formula. Friction's harmonics also drive the hinge, which swings hardly damped
//! at 411 rad/s, and which caps detune: with bearings capped at 1300 rad/s and steps that see the
//! corners, half of 120 rows of `sweeps/friction.toml` err by more than 5.6e-3, at 2600 rad/s by
//! more than 1.7e-3. So the nonlinear model with corners keeps both as they are. Its first rungs
//! are by the additive method, which takes them implicitly and finds the corners by its error
//! estimate. Where that needs steps so short that bearings bear them, order 8 in fixed steps is
//! quicker: in steps of half a millisecond it errs less than the additive method at 3e-7.
//!
//! Nothing is taken from other points, so a row depends on the plan and its own parameters alone.

use lane_ode::Tolerance;
use lane_ode::dop853::DOP853_STABILITY_LIMIT;
use lane_ode::rk4::RK4_STABILITY_LIMIT;
use washer_model::{Caps, Cases, Formula, Gear, Geared, Method, ModelKind};
use washer_row::{Convergence, Ladder, Level, Rung};

use crate::method::{MAX_ADAPTIVE_STEPS, REFERENCE_SHARE};

/// Step of the reference method, where the machine allows it (s): amplitudes are converged to about
/// 1e-9.
const REFERENCE_STEP_S: f64 = 2e-4;

/// Step of plain RK4 where it is run first, as a multiple of the reference's.
const LONGER_STEP: f64 = 1.25;

/// Error of the reference as a share of its difference from that: 1 / (1.25^4 - 1) = 0.7 where it
/// is of fourth order. Nearly chaotic motions keep to no order; 3.3 was seen.
const REFERENCE_CONTRACTION: f64 = 4.0;

/// The same with half the reference's step: 1/15 where it is of fourth order, with that reserve.
const CONTRACTION_OF_HALVED: f64 = 0.4;

/// The same with a step that follows the bearings, whose ringing is 0.08 too small at most.
const CONTRACTION_OF_FOLLOWING: f64 = 0.2;

/// Step of RK4 times the bearings' fastest mode (rad) where it follows their ringing: it damps it
/// by 0.07 a second, their dampers by 0.3. At 0.5 rad it damps it by 2 a second, and the reference
/// at 2 rad within a few steps.
const FOLLOWED_RAD: f64 = 0.25;

/// A rung's step is shorter than the one's before by this at least.
const SHORTER: f64 = 1.5;

/// A finest rung is climbed if it costs less than this share of the reference.
const WORTH_IT: f64 = 0.5;

/// Accuracies below this are tight: caps alone hold the nonlinear model's rungs short, and rungs
/// far apart agree too little, because errors shrink with the caps' square alone.
const TIGHT: f64 = 5e-5;

/// For what errors a model's capped rungs are chosen, in parts of the accuracy. The first one only
/// shows the error of the second.
///
/// The linear model amplifies nothing: its first rung may be coarser, and a third is hardly ever
/// asked for. Its second holds the row, and what a capped hinge does to motions that do not turn
/// with the drum is more than the rule expects where a run-up is short: ten times was seen.
fn aims(model: ModelKind, accuracy: f64) -> &'static [f64] {
    match model {
        ModelKind::Nonlinear if accuracy < TIGHT => &[1.0, 0.25],
        ModelKind::Nonlinear => &[10.0, 0.15, 0.01],
        ModelKind::Linear => &[100.0, 0.12, 0.01],
    }
}

/// How many times shorter the finest capped rung's steps are than those of the rung before.
const FINEST_STEP: f64 = 2.5;

/// Its step times its bearings' cap, rad: nearly as high as the formula is stable.
const FINEST_STEP_TIMES_CAP: f64 = 0.96 * DOP853_STABILITY_LIMIT;

/// Up to which difference of two rungs errors are of first order.
const fn first_order(model: ModelKind) -> f64 {
    match model {
        ModelKind::Nonlinear => 0.1,
        ModelKind::Linear => 0.3,
    }
}

/// The same of plain RK4 and the finest capped rung. The difference is that rung's error: RK4's is
/// smaller by orders of magnitude.
const FIRST_ORDER_OF_RK4: f64 = 0.2;

/// Error of plain RK4 at its longer step as a share of its difference from a capped rung, as far as
/// it grows with that. Mostly it is far less; 0.013 was seen where the motion is amplified.
const CONTRACTION_TO_RK4: f64 = 0.02;

/// What it may err by itself, however near the capped rung is, where a violent motion amplifies
/// ringing of the hinge: 2.2e-4 was seen, of a difference of 7.5e-4, and 1.4e-4 of 3.4e-4.
const OWN_ERROR_OF_RK4: f64 = 3e-4;

/// A contraction that the rule expects, and that does not follow from steps and caps, is not
/// believed below this.
const LEAST_EXPECTED_SHARE: f64 = 5e-3;

/// Harmonics of the drum's speed up to this one are kept below the hinge's whirl at any accuracy
/// down to [`HARMONIC_OF_ACCURACY`]: of the third, whirls can grow.
const LEAST_HARMONIC: f64 = 3.0;

/// Each further harmonic leaves the hinge ringing less, by a factor of some ten. With heavy
/// unbalances the fourth was seen to ring by 2.4e-3 of the drum's motion, the fifth by 3.3e-4, and
/// the sixth by less than 3e-5. The accuracy down to which the fourth does not matter.
const HARMONIC_OF_ACCURACY: f64 = 1e-2;

/// How far the whirl is kept above the last harmonic that matters.
const CLEAR_OF_HARMONIC: f64 = 16.0 / 15.0;

/// Relative errors per step of the additive method's rungs, in parts of the accuracy. At 1e-3 the
/// first errs by less than a fifth of it in half of 2,274 rows of random machines with elements;
/// where stops are hit hard, each hit amplifies that.
const SHARES_AT_CORNERS: [f64; 2] = [0.1, 0.01];

/// A rung of a lower relative error per step takes longer than the first of order 8.
const LEAST_TOLERANCE: f64 = 3e-6;

/// Absolute error per step (m, rad, m/s, rad/s) over the relative one.
const ABSOLUTE_TOLERANCE: f64 = 2e-2;

/// Longest step of order 8 at corners (s), and what it is of plain RK4's longest.
const STEP_AT_CORNERS_S: f64 = 5e-4;
const STEP_TO_PLAIN: f64 = Formula::Dop853.limit() / RK4_STABILITY_LIMIT;

/// The steps of order 8 in parts of that. The second is the reference.
const STEPS_AT_CORNERS: [f64; 3] = [1.0, 0.5, 0.25];

/// Error of a rung at corners as a share of its difference from the one before: of the additive
/// method, and of each step of order 8. Of 714 rows (`sweeps/friction.toml` and random machines),
/// each run by all rungs, none that these let go erred by more than 0.47 of its accuracy; with half
/// of the third, one by 4.35.
const CONTRACTION_AT_CORNERS: f64 = 2.0;
const CONTRACTIONS_OF_ORDER_8: [f64; 3] = [1.2, 1.0, 0.4];

/// The same of the difference before that, at least, because two rungs may meet by chance.
const OF_EARLIER_AT_CORNERS: f64 = 0.05;

/// A contraction better than this is not believed.
const BEST_CONTRACTION: f64 = 1e-3;

/// The rungs of the fast method for these cases.
pub(crate) fn ladder(cases: &Cases<'_>, model: ModelKind, accuracy: f64) -> Ladder {
    let following_step_s = following_step_s(cases);
    let follows = |step_s: f64| step_s <= following_step_s;
    let plain = |step_s: f64, contraction: f64, believed_to: f64| Rung {
        level: Level::Rk4,
        method: Method::Rk4 { step_s },
        convergence: Convergence { contraction, believed_to, ..Convergence::NONE },
        left_out: [cases.left_out_of_hinge(step_s), if follows(step_s) { 0.0 } else { 1.0 }],
    };
    let reference_step_s = reference_step_s(cases);
    if has_corners(cases, model) {
        let tolerances = SHARES_AT_CORNERS.map(|share| share * accuracy).into_iter();
        let mut rungs: Vec<Rung> =
            tolerances.filter(|relative| *relative > LEAST_TOLERANCE).map(additive).collect();
        let [longest, reference, finer] = order_8(cases);
        rungs.extend([longest, reference]);
        // These damp what bearings swing.
        let step_s = following_step_s.min(REFERENCE_STEP_S);
        let following = plain(step_s, CONTRACTION_OF_FOLLOWING, f64::INFINITY);
        return Ladder::checked(rungs, Some(AT_CORNERS.to_owned())).with_finer([finer, following]);
    }
    let mut rungs = capped(cases, model, accuracy);
    let held_back = if rungs.is_empty() { too_fast(cases, accuracy) } else { None };
    let mut longer = plain(LONGER_STEP * reference_step_s, 1.0, FIRST_ORDER_OF_RK4);
    if !rungs.is_empty() {
        longer.convergence.contraction = CONTRACTION_TO_RK4;
        longer.convergence.own_error = OWN_ERROR_OF_RK4;
    }
    rungs.extend([longer, plain(reference_step_s, REFERENCE_CONTRACTION, f64::INFINITY)]);
    let halved_s = 0.5 * reference_step_s;
    let halved = plain(halved_s, CONTRACTION_OF_HALVED, f64::INFINITY);
    // Two steps that are nearly the same would agree on an error that neither shows.
    let shorter_s = following_step_s.min(0.5 * halved_s);
    let following = plain(shorter_s, CONTRACTION_OF_FOLLOWING, f64::INFINITY);
    let finer = [Some(halved), (!follows(halved_s)).then_some(following)];
    Ladder::checked(rungs, held_back).with_finer(finer.into_iter().flatten())
}

/// The method that a row without doubts climbs to at most.
pub(crate) fn reference(cases: &Cases<'_>, model: ModelKind) -> Method {
    let [_, at_corners, _] = order_8(cases);
    match has_corners(cases, model) {
        true => at_corners.method,
        false => Method::Rk4 { step_s: reference_step_s(cases) },
    }
}

fn has_corners(cases: &Cases<'_>, model: ModelKind) -> bool {
    model == ModelKind::Nonlinear && cases.are_nonsmooth()
}

/// A rung for forces with corners.
fn at_corners(level: Level, method: Method, contraction: f64) -> Rung {
    let convergence = Convergence {
        contraction,
        of_earlier: OF_EARLIER_AT_CORNERS,
        believed_to: f64::INFINITY,
        ..Convergence::NONE
    };
    Rung { level, method, convergence, left_out: [0.0, 1.0] }
}

/// The additive method, of this relative error per step.
fn additive(relative: f64) -> Rung {
    let absolute = ABSOLUTE_TOLERANCE * relative;
    let tolerance = Tolerance { relative, absolute, max_steps: MAX_ADAPTIVE_STEPS };
    at_corners(Level::Additive, Method::Additive(tolerance), CONTRACTION_AT_CORNERS)
}

/// The rungs of order 8 for forces with corners.
fn order_8(cases: &Cases<'_>) -> [Rung; 3] {
    let stable_s = cases.plain_step_s().map_or(f64::INFINITY, |step_s| STEP_TO_PLAIN * step_s);
    let longest_s = STEP_AT_CORNERS_S.min(stable_s);
    [0, 1, 2].map(|place| {
        let method = Method::Dop853 { step_s: STEPS_AT_CORNERS[place] * longest_s };
        at_corners(Level::Dop853, method, CONTRACTIONS_OF_ORDER_8[place])
    })
}

/// Why a machine with friction or stops has no rungs with capped modes.
const AT_CORNERS: &str =
    "no modes are capped, because friction and stops give forces corners, which shake the hinge";

/// Why elements or the drum's speed keep a machine from the quick rungs, if they do.
fn too_fast(cases: &Cases<'_>, accuracy: f64) -> Option<String> {
    let (has, needs) = (cases.hinge_to_drum(), least_hinge_to_drum(accuracy));
    if has < needs {
        return Some(format!(
            "rk4 alone, because the hinge is only {has:.2} times as fast as the drum, and this \
             accuracy needs {needs:.2}"
        ));
    }
    let fastest = cases.stiffened_rad_per_s()?;
    Some(format!(
        "rk4 alone, because stiffened springs and bushings can swing the tub at {fastest:.0} \
         rad/s, too fast for longer steps"
    ))
}

/// The rungs with capped modes, if any are worth their time.
///
/// How much less a rung errs than the one before: the greatest share that is left of any part of an
/// error, with something in reserve. For the linear model, whose rungs are held short by truncation
/// alone, it is what the rule expects, but for what caps move more than the motion: of a gap and a
/// clash 0.4 of the difference was seen to be left, where the rule expects 0.001. Corners without
/// an equilibrium or without modes are rows that say so; the rest climbs by plain RK4.
fn capped(cases: &Cases<'_>, model: ModelKind, accuracy: f64) -> Vec<Rung> {
    if cases.hinge_to_drum() < least_hinge_to_drum(accuracy) {
        return Vec::new();
    }
    let mut chosen: Vec<(Level, f64, Geared)> = Vec::new();
    for (level, aim) in
        [Level::Fast, Level::Fast, Level::Fine].into_iter().zip(aims(model, accuracy))
    {
        // The nonlinear model has one gear after the first: what instability amplifies later is
        // small while the drum is slow, and a window may end early.
        let found = match chosen.is_empty() || model == ModelKind::Linear {
            true => cases.choose(model, aim * accuracy),
            false => cases.choose_steady(model, aim * accuracy),
        };
        let Ok(Some(geared)) = found else { break };
        // Where strong dampers hold both steps short, they agree on an error that neither shows.
        let is_near = |before: &Geared| before.top().step_s < SHORTER * geared.top().step_s;
        chosen.pop_if(|(_, _, before)| is_near(before));
        chosen.push((level, aim * accuracy, geared));
    }
    let plain_evaluations_per_s = Formula::Rk4.evaluations_per_s(reference_step_s(cases));
    let evaluations_per_s =
        |geared: &Geared| Formula::of(model).evaluations_per_s(geared.top().step_s);
    let finest =
        chosen.last().filter(|_| model == ModelKind::Nonlinear).map(|(_, _, last)| refined(last));
    let finest = finest.filter(|it| evaluations_per_s(it) < WORTH_IT * plain_evaluations_per_s);
    chosen.extend(finest.map(|finest| (Level::Finest, f64::INFINITY, finest)));
    let rung = |(place, (level, _, geared)): (usize, &(Level, f64, Geared))| {
        let before = place.checked_sub(1).map(|before| &chosen[before]);
        let believed = |share: f64| share.clamp(BEST_CONTRACTION, 1.0);
        let of_caps = before.map_or(1.0, |(_, _, before)| {
            believed(reserve(place, accuracy) * geared.share_of_error(before))
        });
        let contraction = match (model, before) {
            (ModelKind::Linear, Some((_, _, before))) => {
                let expected = expected_share(cases, model, before, geared);
                believed(expected.max(LEAST_EXPECTED_SHARE))
            }
            _ => of_caps,
        };
        Rung {
            level: *level,
            method: Method::Geared(*geared),
            left_out: [1.0, 1.0],
            convergence: Convergence {
                contraction,
                of_caps,
                believed_to: first_order(model),
                expected: match before {
                    Some((_, aim, _))
                        if model == ModelKind::Nonlinear && *level != Level::Finest =>
                    {
                        *aim
                    }
                    // The linear model amplifies no ringing. What reaches the finest rung is
                    // amplified far more than ringing is: of Fig. 12's rows this rule sent 46 on
                    // to RK4, which they agree with to 1.1e-4.
                    _ => f64::INFINITY,
                },
                ..Convergence::NONE
            },
        }
    };
    chosen.iter().enumerate().map(rung).collect()
}

/// Share that the rule expects to be left of a coarser choice's error.
fn expected_share(cases: &Cases<'_>, model: ModelKind, coarser: &Geared, finer: &Geared) -> f64 {
    let [coarser, finer] =
        [coarser, finer].map(|geared| cases.expected_error(model, geared).unwrap_or(f64::INFINITY));
    if finer.is_finite() { finer / coarser } else { 1.0 }
}

/// How many times greater than reckoned the share of an error that is left may be. Where caps are
/// as low as the first rung's, a mode's shift is less than proportional to it. Where the accuracy
/// is tight, 2.8 times as much was seen to be left in motions that amplify errors a hundredfold.
fn reserve(rung: usize, accuracy: f64) -> f64 {
    match rung {
        1 if accuracy < TIGHT => 2.5,
        1 => 2.0,
        _ => 1.5,
    }
}

/// How many times faster than the drum the hinge must be for runs with capped modes. After a
/// harmonic of the drum's speed has passed its whirl, the hinge rings, and two such runs may differ
/// in that much or little. So what rings must be less than the accuracy.
///
/// The linear model has no harmonics beyond the second. But where its hinge is slower than this, a
/// short run-up was seen to be off by ten times what the rule expects of the caps.
fn least_hinge_to_drum(accuracy: f64) -> f64 {
    // The quotient of two powers of ten may come out a hair above one.
    let further = ((HARMONIC_OF_ACCURACY / accuracy).log10() - 1e-9).ceil().max(0.0);
    CLEAR_OF_HARMONIC * (LEAST_HARMONIC + further)
}

/// With shorter steps, and caps as high as these bear.
fn refined(geared: &Geared) -> Geared {
    let refined = |gear: Gear| {
        let step_s = gear.step_s / FINEST_STEP;
        let bearings_rad_per_s = FINEST_STEP_TIMES_CAP / step_s;
        let higher = bearings_rad_per_s / gear.caps.bearings_rad_per_s;
        let hinge_rad_per_s = gear.caps.hinge_rad_per_s.map(|cap| higher * cap);
        Gear { step_s, caps: Caps { bearings_rad_per_s, hinge_rad_per_s }, ..gear }
    };
    Geared { gears: geared.gears.map(refined) }
}

/// The longest step of RK4 that follows the bearings.
fn following_step_s(cases: &Cases<'_>) -> f64 {
    let share = FOLLOWED_RAD / RK4_STABILITY_LIMIT;
    cases.plain_step_s().map_or(f64::INFINITY, |longest_s| share * longest_s)
}

/// Step of the reference method.
pub(crate) fn reference_step_s(cases: &Cases<'_>) -> f64 {
    let stable_s =
        cases.plain_step_s().map_or(f64::INFINITY, |longest_s| REFERENCE_SHARE * longest_s);
    REFERENCE_STEP_S.min(stable_s)
}
