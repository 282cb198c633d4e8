//! Records the loads on the cabinet, on its feet and on stops, and the speeds of dampers, from the
//! components that `load_components.rs` selects.

use super::gauge::Gauge;
use super::load_components::LoadSelection;
use super::load_laws::{LoadLaws, to_sample};
use crate::coordinates::STATES;
use crate::lanes::{InLanes as _, ToDual as _};
use crate::machine::feet::{LOAD_COMPONENTS, LoadDistribution, MAX_FEET, turning_force_n};
use crate::run::model::tub_samples;
use crate::{ModelKind, Point, Recorders};
use lane_ode::{Dual, Lane, N, Peaks, Sample, TimeAbove};

/// A reference that is greater than all loads (N). Peaks record only greatest values, so that the
/// least load is the reference less the greatest difference of reference and load.
///
/// Basis: a power of two, so that differences from it keep most digits of loads. Doubling it loses
/// one binary digit.
const REFERENCE_LOAD_N: f64 = 1_048_576.0;

/// The summand under the square root of the horizontal force (N^2). Without it the root has no
/// derivative at zero force.
///
/// Basis: it changes the force by at most 1 nN. Doubling it changes no digit of any result.
const ROOT_SUMMAND_N2: f64 = 1e-18;

/// The index of the margin against slipping, after the loads of the feet.
const SLIP_INDEX: usize = MAX_FEET;
/// The index of the margin against walking, after that against slipping.
const WALK_INDEX: usize = MAX_FEET + 1;

/// The records of one stop.
struct StopRecord<T> {
    force_peaks: Peaks<T, 1>,
    /// The time for which the depth is positive.
    contact_time: TimeAbove<T>,
}

/// The recorder of loads, over lanes.
///
/// Loads are recorded by values and slopes, without second derivatives. Within a long step the
/// motion is therefore interpolated, and loads are evaluated at the ends of a few parts of the
/// step.
pub(crate) struct LoadRecorder<T> {
    selection: LoadSelection,
    load_laws: LoadLaws<T>,
    /// The load components at the last instant.
    components: Vec<N<Dual<T>>>,
    /// The square of the force on the cabinet.
    force_squared: Peaks<T, 1>,
    /// The distances of the feet's loads, and of the two margins, below [`REFERENCE_LOAD_N`].
    distances_below_reference_n: Peaks<T, { MAX_FEET + 2 }>,
    distribution: Option<LoadDistribution<T>>,
    stops: Vec<StopRecord<T>>,
    /// The speed of each damper, if dampers are recorded.
    damper_speed_peaks: Vec<Peaks<T, 1>>,
    /// The coordinates, speeds and accelerations of [`TUB_COORDINATES`] at the start of the next
    /// step.
    previous_tub: [Sample<T>; 4],
    /// The number of parts of a step.
    substeps: u32,
}

impl<T: Lane> LoadRecorder<T> {
    /// Creates the recorder with the same point in every lane; `None` if no loads are recorded.
    #[inline(always)]
    pub(crate) fn new(
        zero: N<T>,
        recorders: Recorders,
        model: ModelKind,
        point: &Point,
        substeps: u32,
    ) -> Option<Self> {
        let elements = &point.machine.elements;
        let is_any_in_use = |group: &[Gauge]| group.iter().any(|gauge| recorders.has_gauge(*gauge));
        let count_if = |is_recorded: bool, count: usize| if is_recorded { count } else { 0 };
        let records_feet = is_any_in_use(&[Gauge::FootLoad, Gauge::SlipMargin, Gauge::WalkMargin]);
        let records_stops = is_any_in_use(&[Gauge::StopForce, Gauge::StopContact]);
        let records_dampers = recorders.has_gauge(Gauge::DamperSpeed);
        let has_cabinet_force = recorders.has_gauge(Gauge::CabinetForce);
        if !(has_cabinet_force || records_feet || records_stops || records_dampers) {
            return None;
        }
        let selection = LoadSelection {
            has_cabinet_force,
            has_feet: records_feet && point.feet.is_some(),
            stop_count: count_if(records_stops, elements.stops.len()),
            damper_count: count_if(records_dampers, elements.dampers.len()),
        };
        let load_laws = LoadLaws::new(zero, model, elements, selection);
        let mut stops = Vec::with_capacity(selection.stop_count);
        for _ in 0..selection.stop_count {
            stops.push(StopRecord {
                force_peaks: Peaks::new(zero),
                contact_time: TimeAbove::new(zero),
            });
        }
        // This is not `Option::map`, whose closure would be compiled without the kernel's
        // instruction set.
        let distribution = match &point.feet {
            Some(feet) if selection.has_feet => {
                Some(LoadDistribution::splat(zero, &feet.distribution))
            }
            _ => None,
        };
        let mut loads = Self {
            selection,
            load_laws,
            components: vec![zero.constant(); selection.component_count()],
            force_squared: Peaks::new(zero),
            distances_below_reference_n: Peaks::new(zero),
            distribution,
            stops,
            damper_speed_peaks: vec![Peaks::new(zero); selection.damper_count],
            previous_tub: [Sample::constant(zero, zero); 4],
            substeps,
        };
        for lane in 0..T::LANES {
            loads.set_point(lane, point);
        }
        Some(loads)
    }

    /// Begins a point's trajectory in one lane.
    pub(crate) fn set_point(&mut self, lane: usize, point: &Point) {
        self.load_laws.set_point(lane, point, self.selection);
        self.force_squared.reset(lane);
        self.distances_below_reference_n.reset(lane);
        for stop in &mut self.stops {
            stop.force_peaks.reset(lane);
            stop.contact_time.reset(lane);
        }
        for speed in &mut self.damper_speed_peaks {
            speed.reset(lane);
        }
        if let (Some(distribution), Some(feet)) = (&mut self.distribution, &point.feet) {
            distribution.set_lane(lane, &feet.distribution);
        }
    }

    /// Returns the values of a gauge for the point in one lane: one for each element of the
    /// machine, or a single one.
    pub(crate) fn gauge_values(&self, gauge: Gauge, lane: usize, point: &Point) -> Vec<f64> {
        let max_value = |peaks: &Peaks<T, 1>| peaks.lane_peaks(lane)[0];
        let min_loads = |indices: core::ops::Range<usize>| {
            let indices = if self.distribution.is_some() { indices } else { 0..0 };
            self.distances_below_reference_n.lane_peaks(lane)[indices]
                .iter()
                .map(|below_n| REFERENCE_LOAD_N - below_n)
                .collect()
        };
        match gauge {
            Gauge::ClashTime => Vec::new(),
            Gauge::CabinetForce => vec![max_value(&self.force_squared).sqrt()],
            Gauge::StopForce => {
                self.stops.iter().map(|stop| max_value(&stop.force_peaks)).collect()
            }
            Gauge::StopContact => {
                self.stops.iter().map(|stop| stop.contact_time.lane_time_s(lane)).collect()
            }
            Gauge::FootLoad => min_loads(0..point.feet.as_ref().map_or(0, |feet| feet.count)),
            Gauge::SlipMargin => min_loads(SLIP_INDEX..WALK_INDEX),
            Gauge::WalkMargin => min_loads(WALK_INDEX..WALK_INDEX + 1),
            Gauge::DamperSpeed => self.damper_speed_peaks.iter().map(max_value).collect(),
        }
    }

    /// Records the loads up to a state with derivative `dx`, in the lanes of `lanes_in_window`.
    /// `step` has the end and the length of the step (s); it is `None` at the start of a segment.
    #[inline(always)]
    pub(crate) fn record(
        &mut self,
        step: Option<(N<T>, N<T>)>,
        x: &[N<T>; STATES],
        dx: &[N<T>; STATES],
        lanes_in_window: T::Mask,
    ) {
        let current_tub = tub_samples(x, dx);
        let substep_count = if step.is_some() { self.substeps } else { 1 };
        let substep_share = 1.0 / f64::from(substep_count);
        // The end of the step is in the same loop as the other instants, so that the force laws are
        // compiled once.
        for substep in 1..=substep_count {
            let mut tub = current_tub;
            let mut step_s = None;
            if let Some((_, length_s)) = step {
                step_s = Some((substep_share * length_s).v());
                if substep < substep_count {
                    for k in 0..4 {
                        let position = substep_share * f64::from(substep);
                        tub[k] = Sample::interpolate(
                            &self.previous_tub[k],
                            &current_tub[k],
                            length_s,
                            position,
                        );
                    }
                }
            }
            self.record_instant(step_s, &tub, lanes_in_window);
        }
        self.previous_tub = current_tub;
    }

    /// Evaluates and records the loads at one motion of the tub. `step_s` is the time since the
    /// last instant; it is `None` at the start of a segment.
    #[inline(always)]
    fn record_instant(
        &mut self,
        step_s: Option<N<T>>,
        tub: &[Sample<T>; 4],
        lanes_in_window: T::Mask,
    ) {
        let Self { selection, load_laws, components, .. } = self;
        let force_squared = load_laws.evaluate(*selection, tub, components);
        if selection.has_cabinet_force {
            record_peaks(&mut self.force_squared, step_s, &[force_squared], lanes_in_window);
        }
        if let Some(distribution) = &self.distribution {
            let distances_below_reference_n =
                distances_below_reference(distribution, &self.components);
            record_peaks(
                &mut self.distances_below_reference_n,
                step_s,
                &distances_below_reference_n,
                lanes_in_window,
            );
        }
        let first_stop = self.selection.first_stop_component();
        let (stops, damper_speeds) = self.components[first_stop..].split_at(2 * self.stops.len());
        for (record, depth_and_force) in self.stops.iter_mut().zip(stops.chunks(2)) {
            let depth = to_sample(depth_and_force[0]);
            let force = to_sample(depth_and_force[1]);
            record_peaks(&mut record.force_peaks, step_s, &[force], lanes_in_window);
            match step_s {
                Some(step_s) => {
                    record.contact_time.advance_by_slopes(step_s, &depth, lanes_in_window)
                }
                None => record.contact_time.begin(&depth),
            }
        }
        for (peaks, speed) in self.damper_speed_peaks.iter_mut().zip(damper_speeds) {
            record_peaks(peaks, step_s, &[to_sample(*speed)], lanes_in_window);
        }
    }
}

/// Computes the distances below [`REFERENCE_LOAD_N`] of the load of each foot and of both margins,
/// from the load on the cabinet.
#[inline(always)]
fn distances_below_reference<T: Lane>(
    distribution: &LoadDistribution<T>,
    components: &[N<Dual<T>>],
) -> [Sample<T>; MAX_FEET + 2] {
    let distribution = distribution.constant();
    let reference_n = components[0].lit(REFERENCE_LOAD_N);
    let mut load = [reference_n; LOAD_COMPONENTS];
    load.copy_from_slice(&components[..LOAD_COMPONENTS]);
    let mut distances_below_reference_n = [to_sample(reference_n); MAX_FEET + 2];
    let mut foot_loads = distribution.cabinet_weight_loads;
    for k in 0..MAX_FEET {
        for i in 0..LOAD_COMPONENTS {
            foot_loads[k] += distribution.loads_per_component[k][i] * load[i];
        }
        distances_below_reference_n[k] = to_sample(reference_n - foot_loads[k]);
    }
    let force_squared = load[0] * load[0] + load[2] * load[2] + load[0].lit(ROOT_SUMMAND_N2);
    let slip_margin = distribution.friction_coefficient * (distribution.cabinet_weight - load[1])
        - force_squared.sqrt();
    let walk_margin =
        slip_margin - turning_force_n(&distribution.foot_positions, &foot_loads, &load);
    distances_below_reference_n[SLIP_INDEX] = to_sample(reference_n - slip_margin);
    distances_below_reference_n[WALK_INDEX] = to_sample(reference_n - walk_margin);
    distances_below_reference_n
}

/// Passes samples to their peaks: after a step of length `step_s`, or at the start of a segment if
/// it is `None`.
#[inline(always)]
fn record_peaks<T: Lane, const M: usize>(
    peaks: &mut Peaks<T, M>,
    step_s: Option<N<T>>,
    samples: &[Sample<T>; M],
    lanes_in_window: T::Mask,
) {
    match step_s {
        Some(step_s) => peaks.advance_by_slopes(step_s, samples, lanes_in_window),
        None => peaks.begin(samples, lanes_in_window),
    }
}
