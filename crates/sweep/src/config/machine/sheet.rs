//! The keys of a data sheet in a machine file, and the planes of unbalances.

use sweep_engine::config::{Field, Form, Keys, Section, keys};
use sweep_parameter::Range;
use washer_model::{DataSheet, Machine, MachineParameter};

use super::{MachineSection, find_parameter, spin_without_parameters};

/// The key of the data sheet's mass, at the top of a machine file.
pub(super) const MOVING_MASS_KEY: &str = "moving_mass_kg";

/// The keys of a data sheet in a machine file. Numbers that the file omits follow from them.
#[derive(Default)]
pub(super) struct SheetKeys {
    /// Whether the file gives a number of a data sheet, so that it may omit numbers that follow
    /// from a complete sheet.
    pub(super) has_sheet_key: bool,
    moving_mass_kg: Option<f64>,
    drum_radius_m: Option<f64>,
    drum_depth_m: Option<f64>,
    /// The parameters that the file omits.
    pub(super) omitted_parameters: Vec<MachineParameter>,
    /// The positions along the axis that the file gives by the name of a plane.
    pub(super) plane_positions: Vec<(MachineParameter, DrumPlane)>,
}

/// A plane of the drum in which an unbalance lies.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum DrumPlane {
    /// The drum's front, whose motion is reported.
    Front,
    /// The drum's back, where it is fixed to the shaft.
    Rear,
}

impl DrumPlane {
    /// All planes with their names in machine files.
    const ALL: [(Self, &'static str); 2] = [(Self::Front, "front"), (Self::Rear, "rear")];

    /// Returns the plane's position along the axis (m).
    pub(super) fn x_m(self, machine: &Machine) -> f64 {
        match self {
            Self::Front => machine.drum.front_x_m,
            Self::Rear => machine.drum.hinge_x_m,
        }
    }
}

/// Sections of unbalances.
pub(super) const UNBALANCE_SECTIONS: [&str; 2] = ["unbalance", "further_unbalances"];

/// The key of an unbalance's position along the axis.
pub(super) const UNBALANCE_POSITION_KEY: &str = "x_m";

/// The key that gives the position of an unbalance by the name of a plane.
const UNBALANCE_PLANE_KEY: &str = "plane";

/// The key of the drum's inner radius.
const DRUM_RADIUS_KEY: &str = "radius_m";

/// The key of the drum's inner depth.
const DRUM_DEPTH_KEY: &str = "depth_m";

/// The keys of the drum's size, without which no number may be omitted.
const DRUM_SIZE_KEYS: [&str; 2] = [DRUM_RADIUS_KEY, DRUM_DEPTH_KEY];

/// The range of the drum's inner radius and depth (m).
const DRUM_SIZE_FORM: Form<'_> = Form::Number(Range::Within(1e-3, 10.0));

impl SheetKeys {
    /// Creates the data sheet of a file whose keys have not been read.
    pub(super) fn new(keys: &Keys<'_>) -> Self {
        let has_any_sheet_key = |root: &Section<'_>| {
            let is_drum_key = |key: &str| root.has_inner_key("drum", key);
            root.key_location(MOVING_MASS_KEY).is_some()
                || DRUM_SIZE_KEYS.into_iter().any(is_drum_key)
        };
        Self { has_sheet_key: keys.section().is_some_and(has_any_sheet_key), ..Self::default() }
    }

    /// Walks over the data sheet's keys of element `k` of a section.
    pub(super) fn walk(&mut self, section: &MachineSection, k: usize, keys: &mut Keys<'_>) {
        match section.name {
            "" => {
                let description =
                    "mass of tub, shaft and drum without laundry, in place of the tub's, kg";
                let key = keys::Key::new(MOVING_MASS_KEY, description);
                keys.walk_key(key, &Form::Number(Range::Positive), &mut self.moving_mass_kg);
            }
            "drum" => {
                let key = keys::Key::new(
                    DRUM_RADIUS_KEY,
                    "inner radius; other numbers follow from it, m",
                );
                keys.walk_key(key, &DRUM_SIZE_FORM, &mut self.drum_radius_m);
                let key =
                    keys::Key::new(DRUM_DEPTH_KEY, "inner depth; other numbers follow from it, m");
                keys.walk_key(key, &DRUM_SIZE_FORM, &mut self.drum_depth_m);
            }
            name if UNBALANCE_SECTIONS.contains(&name) => self.walk_plane(section, k, keys),
            _ => {}
        }
    }

    /// Walks over the name of an unbalance's plane, which replaces its position along the axis.
    fn walk_plane(&mut self, section: &MachineSection, k: usize, keys: &mut Keys<'_>) {
        let description = "the drum's front, or its rear where it is fixed: in place of x_m";
        let mut plane_name: Option<String> = None;
        let plane_names = DrumPlane::ALL.map(|(_, name)| name);
        let field = keys.walk_key(
            keys::Key::new(UNBALANCE_PLANE_KEY, description),
            &Form::Word(&plane_names),
            &mut plane_name,
        );
        let plane =
            DrumPlane::ALL.into_iter().find(|(_, name)| plane_name.as_deref() == Some(name));
        let (Field::Present(location), Some((plane, _))) = (field, plane) else { return };
        let Some(table) = keys.section() else { return };
        if table.key_location(UNBALANCE_POSITION_KEY).is_some() {
            let title = format!("`{UNBALANCE_PLANE_KEY}` beside `{UNBALANCE_POSITION_KEY}`");
            let expected = "expected only one of them: both say where the unbalance is";
            table.report.refuse::<()>(&location.location, title, expected);
        }
        let name = format!("{}{UNBALANCE_POSITION_KEY}", section.element_prefix(k));
        table.report.record_location(name.as_str(), location.location);
        // The paper's machine has no further unbalances, so it has no parameters of them.
        let machine = machine_with_unbalances(k + 1);
        self.plane_positions
            .extend(find_parameter(&name, &machine).map(|parameter| (parameter, plane)));
    }

    /// Returns whether the position of element `k` along the axis is given by the name of a plane.
    pub(super) fn has_plane(&self, section: &MachineSection, k: usize, key: &str) -> bool {
        let name = format!("{}{UNBALANCE_POSITION_KEY}", section.element_prefix(k));
        key == UNBALANCE_POSITION_KEY
            && self.plane_positions.iter().any(|(parameter, _)| parameter.name() == name)
    }

    /// Sets the parameters that the file omits by their rules, which become the parameters'
    /// sources.
    pub(super) fn fill_omitted(self, machine: &mut Machine, root: &Section<'_>) {
        let report = root.report;
        let is_omitted =
            |name: &str| self.omitted_parameters.iter().any(|parameter| parameter.name() == name);
        let mass_is_omitted = ["tub_mass_kg", "shaft_mass_kg", "drum_mass_kg"].map(is_omitted);
        let sheet = DataSheet {
            moving_mass_kg: self.moving_mass_kg,
            drum_radius_m: self.drum_radius_m.unwrap_or_default(),
            drum_depth_m: self.drum_depth_m.unwrap_or_default(),
        };
        let is_complete = self.drum_radius_m.is_some() && self.drum_depth_m.is_some();
        if !self.omitted_parameters.is_empty() {
            for key in DRUM_SIZE_KEYS.into_iter().filter(|key| !root.has_inner_key("drum", key)) {
                let expected = "the drum's inner radius_m and depth_m in [drum], from which the \
                                numbers that are left out follow";
                root.report_missing(key, expected);
            }
        }
        if sheet.moving_mass_kg.is_some() && !mass_is_omitted[0] {
            let title = format!("`{MOVING_MASS_KEY}` beside the tub's mass");
            let expected =
                "expected no `mass_kg` in [tub]: it is the moving mass less shaft and drum";
            let location =
                root.key_location(MOVING_MASS_KEY).unwrap_or_else(|| root.location().clone());
            report.refuse::<()>(&location, title, expected);
        } else if mass_is_omitted.contains(&true) && sheet.moving_mass_kg.is_none() {
            let expected = "the mass of tub, shaft and drum without laundry, or `mass_kg` of each";
            root.report_missing(MOVING_MASS_KEY, expected);
        } else if is_complete {
            sheet.fill_omitted(&self.omitted_parameters, machine);
        }
        for parameter in &self.omitted_parameters {
            let Some(value) = parameter.get(machine, &spin_without_parameters()) else { continue };
            if is_complete && !parameter.range().contains(value) {
                let name = parameter.name();
                let range = parameter.range();
                let title = format!("the rule for the left-out `{name}` gives {value:.4}");
                report.refuse::<()>(
                    root.location(),
                    title,
                    format!("expected {range}: give the number"),
                );
            }
            if let Some(assumption) = parameter.assumption() {
                report.record_default_rule(parameter.name(), assumption.rule);
            }
        }
    }
}

/// Returns the paper's machine with a number of further unbalances.
fn machine_with_unbalances(further_count: usize) -> Machine {
    let mut machine = Machine::paper();
    machine.further_unbalances = vec![Default::default(); further_count];
    machine
}
