//! How far hinge and bearings swing after jumps of the drum's acceleration.
//!
//! Where the acceleration jumps, the load of the unbalance jumps by m_u r_u times as much. Every
//! method follows the slow modes. Hinge and bearings have no damping of their own and swing about
//! their new deflection from then on. Steps longer than their periods do not follow that swing, and
//! two runs with such steps leave out the same, so that their comparison does not show it.
//!
//! The static deflection under the jump bounds it ([`Point::ringing`]). That is enough for most
//! rows, and takes no eigenvalues. The modes of bearings and hinge say nearer what each channel
//! swings, and what is left of it in the window ([`Point::ringing_left`]).

use core::array;
use core::f64::consts::TAU;
use core::ops::Range;

use crate::channel::{CHANNELS, Channel, Kind};
use crate::coordinates::COORDINATES;
use crate::fast::{SUSPENSION_MODES, rounded_down};
use crate::linear::outputs::LinearMotion;
use crate::machine::Machine;
use crate::machine::spin::{SpinState, SpinStretch};
use crate::modes::{Mode, NoModes, modes, motions};
use crate::nonlinear::outputs::Motion;
use crate::point::Point;
use lane_ode::N;

/// Free bodies swing by more than the static deflection, up to this factor. Of modes: the swing
/// that a run leaves out, and the one that it has in its place.
const MOST: f64 = 2.0;

/// The modes of the hinge, and those of the bearings, in their order by frequency.
const GROUPS: [Range<usize>; 2] =
    [SUSPENSION_MODES..SUSPENSION_MODES + 2, SUSPENSION_MODES + 2..COORDINATES];

/// Angles of the drum at which a jump is tried: the unbalance above and beside the axis.
const ANGLES_RAD: [f64; 2] = [0.0, 0.25 * TAU];

/// Motion of the tub as a share of the drum's swing: the drum has far less mass and inertia.
const SHARE_OF_TUB: f64 = 0.25;

/// The greatest swings of hinge and bearings, and how far the hinge hangs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ringing {
    hinge_rad: f64,
    bearings_m: f64,
    /// By the weight of what it carries.
    sag_rad: f64,
    /// From the hinge to the drum's front (m).
    reach_m: f64,
    /// Between the bearings (m).
    span_m: f64,
}

/// A jump of the drum's acceleration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jump {
    at_s: f64,
    by_rad_per_s2: f64,
}

/// All of them before `end_s`.
pub(crate) fn jumps(stretches: &[SpinStretch], end_s: f64) -> Vec<Jump> {
    let mut before = 0.0;
    let mut jumps = Vec::new();
    for (i, stretch) in stretches.iter().enumerate().filter(|(_, stretch)| stretch.start_s < end_s)
    {
        let at_s = stretch.start_s;
        let by_rad_per_s2 = (stretch.acceleration_rad_per_s2(at_s) - before).abs();
        if by_rad_per_s2 != 0.0 {
            jumps.push(Jump { at_s, by_rad_per_s2 });
        }
        if let Some(next) = stretches.get(i + 1) {
            before = stretch.acceleration_rad_per_s2(next.start_s);
        }
    }
    jumps
}

/// All jumps, added.
pub(crate) fn sum_rad_per_s2(jumps: &[Jump]) -> f64 {
    jumps.iter().fold(0.0, |sum, jump| sum + jump.by_rad_per_s2)
}

/// A swing of everything that a row takes from a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// Of each channel (m, rad), in the order of [`Channel::ALL`].
    pub channels: [f64; CHANNELS],
    /// Of the gap between drum and tub (m).
    pub gap_m: f64,
}

impl Swing {
    const NONE: Self = Self { channels: [0.0; CHANNELS], gap_m: 0.0 };

    fn with(&self, other: &Self, of: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            channels: array::from_fn(|i| of(self.channels[i], other.channels[i])),
            gap_m: of(self.gap_m, other.gap_m),
        }
    }
}

/// The swing of a group of modes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decaying {
    /// After a jump by 1 rad/s^2.
    per_jump: Swing,
    decay_per_s: f64,
}

impl Point {
    /// A bound on the swing of hinge and bearings after all jumps of the drum's acceleration. Steps
    /// longer than their periods leave it out; steps that follow the hinge leave out what the
    /// bearings swing.
    #[must_use]
    pub fn ringing(&self, follows_hinge: bool) -> Swing {
        let ringing = if follows_hinge { self.ringing.of_bearings() } else { self.ringing };
        Swing { channels: ringing.channels(), gap_m: ringing.gap_m() }
    }

    /// The same by their modes, of jumps before the end of an interval (s), as far as it is left at
    /// its beginning: each group decays as its least damped mode does, at rest or at the drum's
    /// greatest speed.
    ///
    /// With friction nothing counts as decayed: that may hold the tub, whose dampers are all that
    /// takes energy from these modes. A machine without modes keeps the bound.
    #[must_use]
    pub fn ringing_left(&self, follows_hinge: bool, [from_s, to_s]: [f64; 2]) -> Swing {
        let bound = self.ringing(follows_hinge);
        let Ok(groups) = self.ringing_by_modes.get_or_init(|| by_modes(self)) else {
            return bound;
        };
        let mut sum = Swing::NONE;
        for Decaying { per_jump, decay_per_s } in &groups[usize::from(follows_hinge)..] {
            let left = |jump: &Jump| {
                let for_s = (from_s - jump.at_s).max(0.0);
                jump.by_rad_per_s2 * libm::exp(-decay_per_s * for_s)
            };
            let before = self.jumps.iter().filter(|jump| jump.at_s < to_s);
            let left_rad_per_s2 = before.map(left).fold(0.0, |sum, left| sum + left);
            sum = sum.with(per_jump, |sum, of| sum + MOST * left_rad_per_s2 * of);
        }
        sum.with(&bound, f64::min)
    }
}

fn by_modes(point: &Point) -> Result<[Decaying; 2], NoModes> {
    let fastest_rad_per_s = point.legs.last().map_or(0.0, |leg| leg.fastest_rad_per_s);
    let at_speeds = [motions(point, 0.0, None)?, motions(point, fastest_rad_per_s, None)?];
    let swings = per_jump(point)?;
    Ok(array::from_fn(|group| {
        let all = at_speeds.iter().flat_map(|all| &all[GROUPS[group].clone()]);
        let least_per_s = all.map(|motion| -motion.s.re).fold(f64::INFINITY, f64::min);
        let has_friction = !point.friction_speeds.is_empty();
        let decay_per_s = if has_friction { 0.0 } else { rounded_down(least_per_s.max(0.0)) };
        Decaying { per_jump: swings[group], decay_per_s }
    }))
}

/// What hinge and bearings swing after a jump by 1 rad/s^2 while the drum turns slowly: each mode
/// about its static deflection. Channels of one kind have the greatest of them.
fn per_jump(point: &Point) -> Result<[Swing; 2], NoModes> {
    let mut greatest = [Swing::NONE; 2];
    for theta_rad in ANGLES_RAD {
        let force = |acceleration| point.matrices(theta_rad, 0.0, acceleration).force;
        let (before, after) = (force(0.0), force(1.0));
        let modes = modes(point, theta_rad, 0.0)?;
        for (greatest, group) in greatest.iter_mut().zip(GROUPS) {
            let mut sum = Swing::NONE;
            for mode in &modes.modes[group] {
                let jump = array::from_fn(|i| after[i] - before[i]);
                sum = sum.with(&swing(point, theta_rad, mode, &jump), |sum, of| sum + of);
            }
            *greatest = greatest.with(&sum, f64::max);
        }
    }
    let of_kind = |swing: &Swing| {
        let greatest = |channel: Channel| {
            let alike = Channel::ALL.iter().filter(|other| other.kind() == channel.kind());
            let swings = alike.map(|other| swing.channels[other.index()]);
            rounded_down(swings.fold(0.0, f64::max))
        };
        Swing { channels: Channel::ALL.map(greatest), gap_m: rounded_down(swing.gap_m) }
    };
    Ok(greatest.map(|swing| of_kind(&swing)))
}

/// What a mode of unit modal mass swings about its deflection under a load.
fn swing(point: &Point, theta_rad: f64, mode: &Mode, load: &[f64; COORDINATES]) -> Swing {
    let work = |part: usize| (0..COORDINATES).map(|i| mode.shape[i][part] * load[i]).sum::<f64>();
    let (re, im) = (work(0), work(1));
    let scale = (re * re + im * im).sqrt() / (mode.magnitude_rad_per_s * mode.magnitude_rad_per_s);
    let spin = SpinState::new(N(theta_rad).sin_cos(), N(0.0), N(0.0));
    let still = [N(0.0); COORDINATES];
    let outputs = |q: [N<f64>; COORDINATES]| {
        let of = LinearMotion::new(&spin, &Motion { q, u: still, a: still });
        let outputs = &point.linear_outputs;
        (outputs.channels(&of), outputs.radial(&of))
    };
    // A shape is real but for damping: what is imaginary swings beside it.
    let (at_rest, at_rest_radial) = outputs(still);
    let parts = [0, 1].map(|part| outputs(array::from_fn(|i| N(scale * mode.shape[i][part]))));
    let mut sum = Swing::NONE;
    for (channels, radial) in parts {
        let swing = Swing {
            channels: array::from_fn(|i| (channels[i].value - at_rest[i].value).0.abs()),
            gap_m: (0..radial.len())
                .map(|i| (radial[i].value - at_rest_radial[i].value).0)
                .fold(0.0, |squares, of| squares + of * of)
                .sqrt(),
        };
        sum = sum.with(&swing, |sum, of| sum + of);
    }
    sum
}

impl Ringing {
    /// After jumps of the drum's acceleration whose sum is given (rad/s^2).
    pub(crate) fn new(machine: &Machine, jumps_rad_per_s2: f64) -> Self {
        let bearings = &machine.bearings;
        let span_m = (bearings.front_x_m - bearings.rear_x_m).abs();
        let softer = bearings.front_stiffness_n_per_m.min(bearings.rear_stiffness_n_per_m);
        let (mut moment_n_m, mut on_bearings_n) = (0.0, 0.0);
        let hinge_x_m = machine.drum.hinge_x_m;
        let mut hanging_kg_m = machine.drum.mass_kg * (machine.drum.centre_x_m - hinge_x_m);
        for unbalance in core::iter::once(&machine.unbalance).chain(&machine.further_unbalances) {
            let load_n = unbalance.mass_kg * unbalance.radius_m.abs() * jumps_rad_per_s2;
            moment_n_m += load_n * (unbalance.x_m - hinge_x_m).abs();
            hanging_kg_m += unbalance.mass_kg * (unbalance.x_m - hinge_x_m);
            on_bearings_n += load_n * (1.0 + unbalance.x_m.abs() / span_m);
        }
        let flexure_n_m_per_rad = machine.flexure.stiffness_n_m_per_rad;
        Self {
            hinge_rad: moment_n_m / flexure_n_m_per_rad,
            bearings_m: on_bearings_n / softer,
            sag_rad: hanging_kg_m.abs() * machine.gravity_m_per_s2 / flexure_n_m_per_rad,
            reach_m: (machine.drum.front_x_m - hinge_x_m).abs(),
            span_m,
        }
    }

    /// The part of it that is the bearings'.
    pub(crate) fn of_bearings(&self) -> Self {
        Self { hinge_rad: 0.0, ..*self }
    }

    /// The greatest swing of the gap between drum and tub (m).
    pub(crate) fn gap_m(&self) -> f64 {
        MOST * (1.0 + SHARE_OF_TUB) * self.drum_front_m()
    }

    fn tilt_rad(&self) -> f64 {
        self.hinge_rad + self.bearings_m / self.span_m
    }

    fn drum_front_m(&self) -> f64 {
        self.bearings_m + self.reach_m * self.tilt_rad()
    }

    /// The greatest swing of each channel (m, rad), in the order of `Channel::ALL`.
    pub(crate) fn channels(&self) -> [f64; CHANNELS] {
        in_channels(MOST * self.drum_front_m(), MOST * self.tilt_rad())
    }

    /// How far each channel (m, rad) is where it is for the hinge's sag.
    pub(crate) fn sag(&self) -> [f64; CHANNELS] {
        in_channels(self.reach_m * self.sag_rad, self.sag_rad)
    }
}

/// What a motion of the drum's front and tilt is in each channel, at most.
fn in_channels(drum_front_m: f64, tilt_rad: f64) -> [f64; CHANNELS] {
    Channel::ALL.map(|channel| match channel.kind() {
        Kind::DrumPoint => drum_front_m,
        Kind::TubPoint => SHARE_OF_TUB * drum_front_m,
        Kind::TubAngle => SHARE_OF_TUB * tilt_rad,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Spin, Timing, prepare};
    use lane_ode::Simd;

    fn point(machine: Machine, spin: Spin) -> Point {
        let timing = Timing { end_s: 20.0, window_s: [10.0, 18.0], checkpoints: 0 };
        prepare(Simd::Scalar, &[(machine, spin)], &timing).remove(0).unwrap()
    }

    fn ramp(peak_rpm: f64, ramp_s: f64) -> Spin {
        Spin::Ramp { peak_rpm, ramp_s }
    }

    #[test]
    fn what_decays_is_less_later_and_nothing_decays_with_friction() {
        let machine = Machine::paper();
        let rings = point(machine.clone(), ramp(300.0, 20.0));
        let [early, late] = [0.0, 10.0].map(|from_s| rings.ringing_left(false, [from_s, 20.0]));
        // 240 N s/m: the hinge's modes decay by some 0.2 /s.
        let share = late.gap_m / early.gap_m;
        assert!((0.05..0.4).contains(&share), "{share}");
        let mut with_friction = machine;
        with_friction.dampers[0].friction_n = 20.0;
        let rings = point(with_friction, ramp(300.0, 20.0));
        let [early, late] = [0.0, 10.0].map(|from_s| rings.ringing_left(false, [from_s, 20.0]));
        assert_eq!(early, late);
    }

    #[test]
    fn modes_say_less_than_the_bound_and_not_nothing() {
        let rings = point(Machine::paper(), ramp(300.0, 20.0));
        for follows_hinge in [false, true] {
            let bound = rings.ringing(follows_hinge);
            let by_modes = rings.ringing_left(follows_hinge, [0.0, 20.0]);
            let of_bound = by_modes.with(&bound, |swing, bound| swing / bound);
            let least = of_bound.channels.into_iter().fold(of_bound.gap_m, f64::min);
            assert!(by_modes != bound && least > 0.01, "{of_bound:?}");
        }
    }

    #[test]
    fn a_jump_counts_from_when_it_happens() {
        let to = |peak_s: f64| Spin::Table {
            time_s: vec![0.0, peak_s, 2.0 * peak_s],
            speed_rpm: vec![0.0, 15.0 * peak_s, 0.0],
        };
        // At the run's end, in the window, and between the two.
        let [at_end, inside, behind] =
            [20.0, 14.0, 19.0].map(|peak_s| point(Machine::paper(), to(peak_s)));
        let ringing = |point: &Point, within_s| point.ringing_left(false, within_s).gap_m;
        let once = ringing(&at_end, [10.0, 20.0]);
        assert_eq!(
            at_end.ringing(false),
            point(Machine::paper(), ramp(300.0, 20.0)).ringing(false)
        );
        assert!(ringing(&inside, [10.0, 18.0]) > 2.0 * once);
        assert!(ringing(&behind, [10.0, 18.0]) < 1.1 * once);
        assert!(ringing(&behind, [10.0, 20.0]) > 2.0 * once);
    }
}
