//! The setup of the module: all data for its computations.

use lane_ode::Tolerance;
use sweep_parameter::RatioLimits;
use washer_model::{
    Channel, ElementList, Machine, MachineParameter, Method, MethodKind, Profile, Spin,
};
use washer_row::{Criterion, Measures, Metric, RefinementLevels, RowRule};

use crate::numbers::NumberWalk;

/// The machine, its spin, the sliders, and the refinement levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The machine, before a point's values are set.
    pub machine: Machine,
    /// The spin, before a point's values are set.
    pub spin: Spin,
    /// The number of parts of a run. Two runs are compared at the end of each part.
    pub checkpoints: u32,
    /// The rule of rows: the results, and the accuracy of checked numbers.
    pub rule: RowRule,
    /// The parameters that a point sets.
    pub sliders: Sliders,
    /// The refinement levels of the nonlinear and of the linear model, for points that differ from
    /// the setup only in axes. The levels' notes are not encoded.
    pub levels: [RefinementLevels; 2],
    /// The refinement levels for points that differ in any slider, within its range.
    pub wide_levels: [RefinementLevels; 2],
}

/// The parameters that a point sets.
#[derive(Clone, Debug, PartialEq)]
pub struct Sliders {
    /// The parameters, axes of the map first.
    pub parameters: Vec<MachineParameter>,
    /// The number of axes among them.
    pub axis_count: usize,
}

impl Setup {
    /// Encodes the setup as numbers.
    pub fn to_numbers(&self) -> Vec<f64> {
        let mut walk = NumberWalk::Write(Vec::new());
        // Only reading can fail.
        let _ = self.clone().walk(&mut walk);
        let NumberWalk::Write(numbers) = walk else { return Vec::new() };
        numbers
    }

    /// Decodes a setup from [`Self::to_numbers`]; `None` for other numbers.
    pub fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let direct_levels = RefinementLevels::direct(Method::new(MethodKind::Rk4));
        let levels = [direct_levels.clone(), direct_levels];
        let mut setup = Self {
            machine: Machine::paper(),
            spin: Spin::Table { time_s: Vec::new(), speed_rpm: Vec::new() },
            checkpoints: 0,
            rule: RowRule {
                end_s: 0.0,
                window_s: [0.0; 2],
                accuracy: 0.0,
                limits: RatioLimits { upper: 0.0, lower: None },
                channels: Vec::new(),
                measures: Measures::default(),
            },
            sliders: Sliders { parameters: Vec::new(), axis_count: 0 },
            wide_levels: levels.clone(),
            levels,
        };
        setup.walk(&mut NumberWalk::Read(numbers))?;
        Some(setup)
    }

    fn walk(&mut self, walk: &mut NumberWalk<'_>) -> Option<()> {
        let Self { machine, spin, .. } = self;
        for list in ElementList::all() {
            let count = walk.walk_count((list.count)(machine))?;
            if walk.is_reading() {
                (list.resize)(machine, count);
            }
        }
        let cabinet_count = walk.walk_count(usize::from(machine.cabinet.is_some()))?;
        machine.cabinet = (cabinet_count > 0).then(|| machine.cabinet.unwrap_or_default());
        walk_profile(walk, spin)?;
        let parameters = MachineParameter::all(machine, spin);
        // The parameters of single elements come after those that set all elements.
        for parameter in &parameters {
            let mut value = parameter.get(machine, spin);
            walk.walk_optional(&mut value)?;
            if let Some(value) = value.filter(|_| walk.is_reading()) {
                parameter.set(machine, spin, value);
            }
        }
        // If a spring has no free length, it follows from the positions of its ends.
        for spring in &mut machine.springs {
            walk.walk_optional(&mut spring.free_length_m)?;
        }
        self.checkpoints = u32::try_from(walk.walk_count(self.checkpoints as usize)?).ok()?;
        walk_rule(walk, &mut self.rule)?;
        let RowRule { measures, .. } = &mut self.rule;
        (measures.stops, measures.feet) = (machine.stops.len(), machine.feet.len());
        measures.dampers = machine.dampers.len();
        walk.walk_choices(&mut self.sliders.parameters, &parameters)?;
        self.sliders.axis_count = walk.walk_count(self.sliders.axis_count)?;
        let mut all_levels = self.levels.iter_mut().chain(&mut self.wide_levels);
        all_levels.try_for_each(|levels| walk_levels(walk, levels))
    }
}

/// Writes or reads the profile of the spin; its numbers are parameters.
fn walk_profile(walk: &mut NumberWalk<'_>, spin: &mut Spin) -> Option<()> {
    let profile_code = walk.walk_count(match spin {
        Spin::Ramped { profile, .. } => *profile as usize,
        Spin::Table { time_s, .. } => Profile::ALL.len() + time_s.len(),
    })?;
    if walk.is_reading() {
        *spin = match Profile::ALL.get(profile_code) {
            Some(&profile) => Spin::Ramped { profile, peak_rpm: 0.0, ramp_s: 0.0 },
            None => {
                let zeros = vec![0.0; profile_code - Profile::ALL.len()];
                Spin::Table { time_s: zeros.clone(), speed_rpm: zeros }
            }
        };
    }
    Some(())
}

/// Writes or reads the rule, without the numbers of stops, feet and dampers.
fn walk_rule(walk: &mut NumberWalk<'_>, rule: &mut RowRule) -> Option<()> {
    let RowRule { end_s, window_s: [from_s, to_s], accuracy, limits, channels, measures } = rule;
    walk.walk_numbers([end_s, from_s, to_s, accuracy, &mut limits.upper])?;
    walk.walk_optional(&mut limits.lower)?;
    walk.walk_choices(channels, &Channel::ALL)?;
    walk.walk_choice(&mut measures.criterion, &Criterion::ALL)?;
    walk.walk_choices(&mut measures.metrics, &Metric::ALL)
}

/// Writes or reads the refinement levels, of which there are at least two.
fn walk_levels(walk: &mut NumberWalk<'_>, levels: &mut RefinementLevels) -> Option<()> {
    let mut methods = levels.levels.clone();
    walk.walk_length(&mut methods, &levels.levels[0])?;
    methods.iter_mut().try_for_each(|method| walk_method(walk, method))?;
    if methods.len() < 2 {
        return None;
    }
    *levels = RefinementLevels::checked(methods, None);
    Some(())
}

fn walk_method(walk: &mut NumberWalk<'_>, method: &mut Method) -> Option<()> {
    walk.walk_choice(&mut method.kind, &MethodKind::ALL)?;
    if walk.is_reading() {
        *method = Method::new(method.kind);
    }
    let Method { kind, step_s, caps, tolerance } = method;
    if kind.adapts_steps() {
        let Tolerance { relative, absolute, max_steps, longest_step_s } = tolerance;
        let mut max_step_count = *max_steps as f64;
        walk.walk_numbers([relative, absolute, &mut max_step_count])?;
        *max_steps = max_step_count as u64;
        walk.walk_optional(longest_step_s)?;
        return Some(());
    }
    walk.walk_numbers([step_s])?;
    if kind.is_capped() {
        walk.walk_numbers([&mut caps.bearings_rad_per_s])?;
        walk.walk_optional(&mut caps.hinge_rad_per_s)?;
    }
    Some(())
}
