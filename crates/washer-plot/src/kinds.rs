//! The washing machine's own kinds of files, and marks that they share.

use sweep_plot::chart::Mark;
use sweep_plot::label;
use sweep_plot::read::{Kind, Known};

/// Motions that held speeds end in.
pub(crate) const DWELL: Kind = Kind::of("dwell", &["motion", "speed_rpm"]).with_points();
/// Periodic responses over constant speeds.
pub(crate) const STABILITY: Kind =
    Kind::of("stability", &["growth_per_s", "speed_rpm"]).with_points();
/// Modes over spin speed.
pub(crate) const MODES: Kind = Kind::of("modes", &["mode", "frequency_rpm", "speed_rpm"]);

/// What modes, and responses at constant speeds, follow from.
pub(crate) const MACHINE: &[&str] = &["machine"];

/// What the engine is told of them.
pub(crate) const KNOWN: Known =
    Known { kinds: &[DWELL, STABILITY, MODES], of_runs: &["machine", "spin"], of_machine: MACHINE };

/// A mark with a speed beside it, rpm.
pub(crate) fn mark_of_speed(x: f64, speed_rpm: f64) -> Mark {
    let speed = format!("{speed_rpm:.1}");
    Mark { x, label: format!("{} rpm", label::trimmed(&speed)) }
}
