//! The columns of a trace: instants, channels, and the quantities of [`TraceExtras`].

use std::f64::consts::TAU;

use lane_ode::Failure;
use sweep_engine::Table;
use washer_model::{COORDINATES, Channel, History, InstantOutputs, ModelKind, SuspensionForces};

use super::{TraceExtras, TraceRun};

/// Distance from a whole turn (rad) below which an angle is reported as 0. Basis: some ten times
/// the rounding error of the angle after the most turns that a run can have. Doubling it changes
/// no angle that is sampled between whole turns.
const WHOLE_TURN_TOLERANCE_RAD: f64 = 1e-7;

/// Adds the columns of histories, in which the runs stand one below the other. Returns for each
/// model and each run why the integration failed, if it did.
pub(super) fn add_columns(
    table: &mut Table,
    runs: &[&TraceRun],
    models: &[(ModelKind, Vec<History<'_>>)],
    extras: TraceExtras,
) -> Vec<Vec<Option<String>>> {
    let times = runs.iter().flat_map(|run| run.times_s.iter().copied().map(Some));
    table.add_numbers("time_s", "s", "time since the start", times);
    let speeds = runs.iter().flat_map(|run| run.spin.speeds_rpm(run.times_s.iter().copied()));
    table.add_numbers("speed_rpm", "rpm", "spin of the shaft", speeds.map(Some));
    if extras.angle {
        let angles = runs.iter().flat_map(|run| run.spin.angles_rad(run.times_s.iter().copied()));
        // Instants of whole turns are rounded, so their angles may be just below 2 pi.
        let is_whole_turn = |angle: f64| angle.min(TAU - angle) < WHOLE_TURN_TOLERANCE_RAD;
        let rounded_angles = angles.map(|angle| if is_whole_turn(angle) { 0.0 } else { angle });
        let description = "angle of the drum, 0 where the unbalance is up";
        table.add_numbers("drum_angle_rad", "rad", description, rounded_angles.map(Some));
    }
    let instant_counts: Vec<usize> = runs.iter().map(|run| run.times_s.len()).collect();
    let models: Vec<ModelColumns<'_>> = models
        .iter()
        .map(|(kind, histories)| ModelColumns::new(kind.name(), histories, &instant_counts))
        .collect();
    models.iter().for_each(|model| model.add_channels(table));
    models.iter().for_each(|model| model.add_gap(table));
    if extras.rates {
        models.iter().for_each(|model| model.add_rates(table));
    }
    if extras.states {
        models.iter().for_each(|model| model.add_states(table));
    }
    if extras.forces {
        models.iter().for_each(|model| model.add_forces(table));
    }
    models.iter().map(ModelColumns::failures).collect()
}

/// The columns of one model.
struct ModelColumns<'a> {
    model: &'static str,
    histories: &'a [History<'a>],
    /// The number of instants of each history.
    counts: &'a [usize],
    instants: Vec<Option<InstantOutputs>>,
}

impl<'a> ModelColumns<'a> {
    fn new(model: &'static str, histories: &'a [History<'a>], counts: &'a [usize]) -> Self {
        let instants = histories
            .iter()
            .zip(counts)
            .flat_map(|(history, &count)| (0..count).map(|k| history.instant_outputs(k)))
            .collect();
        Self { model, histories, counts, instants }
    }

    fn add_column(
        &self,
        table: &mut Table,
        (name, unit, description): (&str, &str, &str),
        quantity_of: impl Fn(&InstantOutputs) -> f64,
    ) {
        let description = format!("{description}, {} model; null from where it failed", self.model);
        let values = self.instants.iter().map(|instant| instant.as_ref().map(&quantity_of));
        table.add_numbers(name, unit, &description, values);
    }

    fn add_channels(&self, table: &mut Table) {
        for channel in Channel::ALL {
            let name = format!("{}_{}", self.model, channel.name());
            let description = format!("{} from equilibrium", channel.description());
            self.add_column(table, (&name, channel.unit(), &description), |instant| {
                instant.channels[channel.index()]
            });
        }
    }

    fn add_rates(&self, table: &mut Table) {
        for channel in Channel::ALL {
            let channel_name = channel.name();
            let unit = channel.unit();
            let channel_index = channel.index();
            let column_name =
                |time_unit: &str| format!("{}_{channel_name}_{unit}_per_{time_unit}", self.model);
            let description = channel.description();
            let rate_description = format!("rate of the {description}");
            self.add_column(
                table,
                (&column_name("s"), &format!("{unit}/s"), &rate_description),
                |instant| instant.rates[channel_index],
            );
            let acceleration_description = format!("acceleration of the {description}");
            let unit = format!("{unit}/s^2");
            self.add_column(
                table,
                (&column_name("s2"), &unit, &acceleration_description),
                |instant| instant.accelerations[channel_index],
            );
        }
    }

    fn add_gap(&self, table: &mut Table) {
        let name = format!("gap_{}_m", self.model);
        self.add_column(table, (&name, "m", "gap between drum and tub"), |instant| instant.gap_m);
    }

    fn add_states(&self, table: &mut Table) {
        for i in 0..COORDINATES {
            let (unit, per_s) = if i < 4 { ("m", "m/s") } else { ("rad", "rad/s") };
            let name = format!("q{}_{}_{unit}", i + 1, self.model);
            let description = format!("coordinate q{} from equilibrium", i + 1);
            self.add_column(table, (&name, unit, &description), |instant| instant.deviations[i]);
            let name = format!("u{}_{}_{unit}_per_s", i + 1, self.model);
            self.add_column(table, (&name, per_s, &format!("speed of q{}", i + 1)), |instant| {
                instant.speeds[i]
            });
        }
    }

    fn add_forces(&self, table: &mut Table) {
        let forces: Vec<Option<SuspensionForces>> = self
            .histories
            .iter()
            .zip(self.counts)
            .flat_map(|(history, &count)| (0..count).map(|k| history.forces(k)))
            .collect();
        let mut add_force =
            |force: &str, description: &str, value: &dyn Fn(&SuspensionForces) -> f64| {
                let name = format!("{force}_{}_n", self.model);
                let description =
                    format!("{description}, {} model; null from where it failed", self.model);
                table.add_numbers(
                    &name,
                    "N",
                    &description,
                    forces.iter().map(|forces| forces.as_ref().map(value)),
                );
            };
        let Some(first_forces) = forces.first().and_then(Option::as_ref) else { return };
        let axis_letters = ["x", "y", "z"];
        for (kind, (element, force, description, components)) in
            SuspensionForces::ELEMENT_KINDS.into_iter().enumerate()
        {
            for k in 0..first_forces.by_kind()[kind].len() {
                let mut name = format!("{element}_{}_{force}", k / components + 1);
                let mut description = description.to_owned();
                if components > 1 {
                    name += &format!("_{}", axis_letters[k % components]);
                    description += &(k % components + 1).to_string();
                }
                add_force(&name, &description, &|forces| forces.by_kind()[kind][k]);
            }
        }
        let element_kinds =
            if first_forces.stop_forces_n.is_empty() && first_forces.bushing_forces_n.is_empty() {
                "all springs and dampers"
            } else {
                "all springs, dampers, stops and bushings"
            };
        for (k, axis) in axis_letters.into_iter().enumerate() {
            let description = format!("force of {element_kinds} on the cabinet along c{}", k + 1);
            add_force(&format!("cabinet_force_{axis}"), &description, &|forces| {
                forces.cabinet_force_n[k]
            });
        }
        for k in 0..first_forces.foot_loads_n.len() {
            let description = "vertical load of the foot, negative where it would lift";
            add_force(&format!("foot_{}_load", k + 1), description, &|forces| {
                forces.foot_loads_n[k]
            });
        }
        if first_forces.slip_margin_n.is_some() {
            let description = "margin of the cabinet against slipping, friction on all feet \
                               together less the horizontal force";
            add_force("slip_margin", description, &|forces| {
                forces.slip_margin_n.unwrap_or(f64::NAN)
            });
            let description = "margin of the cabinet against walking: that against slipping less \
                               what turning takes of it";
            add_force("walk_margin", description, &|forces| {
                forces.walk_margin_n.unwrap_or(f64::NAN)
            });
        }
    }

    /// Returns the reason and the time of each history's failure, if it failed.
    fn failures(&self) -> Vec<Option<String>> {
        let failure_text = |history: &History<'_>| {
            let (reason, time_s) = history.failure?;
            let failure_words = match reason {
                Failure::Diverged => "diverged",
                Failure::StepTooSmall => "needs steps too small for double precision",
                Failure::StepLimit => "used up its allowance of steps",
            };
            Some(format!(
                "the {} model {failure_words} at {time_s:.4} s: its columns are null from there on",
                self.model
            ))
        };
        self.histories.iter().map(failure_text).collect()
    }
}
