//! The washing machine's kinds of files, and the marks that their charts share.

use sweep_plot::chart::Mark;
use sweep_plot::label;
use sweep_plot::read::{FigureKind, ModelKinds};

/// The attractors at held speeds.
pub(crate) const DWELL: FigureKind =
    FigureKind::new("dwell", &["motion", "speed_rpm"]).with_points();
/// The periodic responses at constant speeds.
pub(crate) const STABILITY: FigureKind =
    FigureKind::new("stability", &["growth_per_s", "speed_rpm"]).with_points();
/// The modes over spin speed.
pub(crate) const MODES: FigureKind =
    FigureKind::new("modes", &["mode", "frequency_rpm", "speed_rpm"]);

/// The sections of a plan on which modes, and responses at constant speeds, depend.
pub(crate) const MACHINE_SECTIONS: &[&str] = &["machine"];

/// The kinds and sections for `sweep-plot`.
pub(crate) const MODEL_KINDS: ModelKinds = ModelKinds {
    kinds: &[DWELL, STABILITY, MODES],
    history_sections: &["machine", "spin"],
    machine_sections: MACHINE_SECTIONS,
};

/// Returns a mark that is labelled with a speed, rpm.
pub(crate) fn speed_mark(x: f64, speed_rpm: f64) -> Mark {
    let speed_text = format!("{speed_rpm:.1}");
    Mark { x, label: format!("{} rpm", label::trim_decimals(&speed_text)) }
}
