//! What hinge and bearings swing after jumps of the drum's acceleration, by their modes: each about
//! its static deflection under the jump. It takes eigenvalues; `point/ringing.rs` has a bound that
//! takes none.

use core::array;
use core::f64::consts::TAU;
use core::ops::Range;

use crate::fast::{SUSPENSION_MODES, rounded_down};
use crate::linear::outputs::LinearMotion;
use crate::machine::spin::SpinState;
use crate::modes::motions;
use crate::nonlinear::outputs::MovingCoordinates;
use crate::point::ringing::{Decaying, Jump};
use crate::{COORDINATES, Channel, Mode, NoModes, Point, Swing, modes};
use lane_ode::N;

/// The swing that a run leaves out, and the one that it has in its place.
const MOST: f64 = 2.0;

/// The modes of the hinge, and those of the bearings, in their order by frequency.
const GROUPS: [Range<usize>; 2] =
    [SUSPENSION_MODES..SUSPENSION_MODES + 2, SUSPENSION_MODES + 2..COORDINATES];

/// Angles of the drum at which a jump is tried: the unbalance above and beside the axis.
const ANGLES_RAD: [f64; 2] = [0.0, 0.25 * TAU];

impl Point {
    /// [`Self::ringing`] by modes, after jumps before the end of an interval (s), as far as it is
    /// left at its beginning: hinge and bearings each decay as the least damped of their modes
    /// does, at rest or at the drum's greatest speed.
    ///
    /// With friction nothing counts as decayed: that may hold the tub, whose dampers are all that
    /// takes energy from these modes. A machine without modes keeps the bound.
    pub fn ringing_left(&self, left_out: [f64; 2], [from_s, to_s]: [f64; 2]) -> Swing {
        let bound = self.ringing(left_out);
        let Some(groups) = self.ringing_by_modes.get_or_init(|| by_modes(self).ok()) else {
            return bound;
        };
        let mut sum = Swing::NONE;
        for (Decaying { per_jump, decay_per_s }, share) in groups.iter().zip(left_out) {
            let left = |jump: &Jump| {
                let for_s = (from_s - jump.at_s).max(0.0);
                jump.by_rad_per_s2 * libm::exp(-decay_per_s * for_s)
            };
            let before = self.jumps.iter().filter(|jump| jump.at_s < to_s);
            let left_rad_per_s2 = before.map(left).fold(0.0, |sum, left| sum + left);
            sum = sum.with(per_jump, |sum, of| sum + share * MOST * left_rad_per_s2 * of);
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
        let of = LinearMotion::new(&spin, &MovingCoordinates { q, u: still, a: still });
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Machine, Profile, Spin, Timing, prepare};
    use lane_ode::Simd;

    fn point(machine: Machine, spin: Spin) -> Point {
        let timing = Timing { end_s: 20.0, window_s: [10.0, 18.0], checkpoints: 0 };
        prepare(Simd::Scalar, &[(machine, spin)], &timing).remove(0).unwrap()
    }

    fn ramp(peak_rpm: f64, ramp_s: f64) -> Spin {
        Spin::Ramped { profile: Profile::Ramp, peak_rpm, ramp_s }
    }

    #[test]
    fn what_decays_is_less_later_and_nothing_decays_with_friction() {
        let machine = Machine::paper();
        let rings = point(machine.clone(), ramp(300.0, 20.0));
        let left = |rings: &Point, from_s| rings.ringing_left([1.0; 2], [from_s, 20.0]);
        let [early, late] = [0.0, 10.0].map(|from_s| left(&rings, from_s));
        // 240 N s/m: the hinge's modes decay by some 0.2 /s.
        let share = late.gap_m / early.gap_m;
        assert!((0.05..0.4).contains(&share), "{share}");
        let mut with_friction = machine;
        with_friction.dampers[0].friction_n = 20.0;
        let rings = point(with_friction, ramp(300.0, 20.0));
        let [early, late] = [0.0, 10.0].map(|from_s| left(&rings, from_s));
        assert_eq!(early, late);
    }

    #[test]
    fn modes_say_less_than_the_bound_and_not_nothing() {
        let rings = point(Machine::paper(), ramp(300.0, 20.0));
        for left_out in [[1.0, 1.0], [0.1, 1.0], [0.0, 1.0]] {
            let bound = rings.ringing(left_out);
            let by_modes = rings.ringing_left(left_out, [0.0, 20.0]);
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
        let ringing = |point: &Point, within_s| point.ringing_left([1.0; 2], within_s).gap_m;
        let once = ringing(&at_end, [10.0, 20.0]);
        assert_eq!(
            at_end.ringing([1.0; 2]),
            point(Machine::paper(), ramp(300.0, 20.0)).ringing([1.0; 2])
        );
        assert!(ringing(&inside, [10.0, 18.0]) > 2.0 * once);
        assert!(ringing(&behind, [10.0, 18.0]) < 1.1 * once);
        assert!(ringing(&behind, [10.0, 20.0]) > 2.0 * once);
    }
}
