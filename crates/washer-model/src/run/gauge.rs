//! The quantities of a trajectory that can be recorded in addition to peaks of the channels.

sweep_parameter::named! {
    /// A quantity of a trajectory that can be recorded within the window.
    pub enum Gauge {
        /// The time for which the gap is negative (s).
        ClashTime = "clash_time",
        /// The greatest magnitude of the sum of all forces of the suspension on the cabinet (N);
        /// at rest it is the weight.
        CabinetForce = "cabinet_force",
        /// The greatest force of each stop (N).
        StopForce = "stop_force",
        /// The time for which each stop is closed (s).
        StopContact = "stop_contact",
        /// The least vertical load of each foot (N), below zero where it would lift; none if the
        /// machine has no cabinet.
        FootLoad = "foot_load",
        /// The least margin against slipping (N): friction on all feet together less the
        /// horizontal force; below zero the cabinet slips. None if the machine has no cabinet.
        SlipMargin = "slip_margin",
        /// The least margin against walking (N): the margin against slipping less the part of
        /// friction that the moment about the vertical takes. None if the machine has no cabinet.
        WalkMargin = "walk_margin",
        /// The greatest speed along each damper (m/s).
        DamperSpeed = "damper_speed",
    }
}

/// Whether each gauge is in use, in the order of [`Gauge::ALL`].
pub(crate) type GaugeSelection = [bool; Gauge::ALL.len()];
