//! What a page computes with.

use lane_ode::Tolerance;
use sweep_parameter::RatioLimits;
use washer_model::{
    Channel, ElementList, Machine, Method, MethodNumbers, Parameter, Profile, Spin,
};
use washer_row::{Criterion, Level, Measures, Metric, RefinementLevel, RefinementLevels, Rule};

use crate::numbers::Walk;

/// The machine, its spin, what a point can change, and how points are integrated.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The machine, but for what a point changes.
    pub machine: Machine,
    /// The spin, but for what a point changes.
    pub spin: Spin,
    /// Into how many parts a run is cut, at whose ends two runs of it are compared.
    pub checkpoints: u32,
    /// What is measured, and what checked numbers must be good for.
    pub rule: Rule,
    /// What a point gives values.
    pub sliders: Sliders,
    /// The refinement levels of the nonlinear and of the linear model while only axes move. Their
    /// notes do not go with the numbers.
    pub levels: [RefinementLevels; 2],
    /// The same while any slider may be anywhere in its range.
    pub wide_levels: [RefinementLevels; 2],
}

/// The parameters that a point gives values.
#[derive(Clone, Debug, PartialEq)]
pub struct Sliders {
    /// Axes of the map first.
    pub parameters: Vec<Parameter>,
    /// How many are axes.
    pub axes: usize,
}

impl Setup {
    /// As numbers.
    pub fn to_numbers(&self) -> Vec<f64> {
        let mut walk = Walk::Write(Vec::new());
        // Only reading can fail.
        let _ = self.clone().walk(&mut walk);
        let Walk::Write(numbers) = walk else { return Vec::new() };
        numbers
    }

    /// From [`Self::to_numbers`]; `None` from anything else.
    pub fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let direct = || RefinementLevels::direct(Level::Rk4, Method::of(Level::Rk4));
        let levels = [0, 1].map(|_| direct());
        let mut setup = Self {
            machine: Machine::paper(),
            spin: Spin::Table { time_s: Vec::new(), speed_rpm: Vec::new() },
            checkpoints: 0,
            rule: Rule {
                end_s: 0.0,
                window_s: [0.0; 2],
                accuracy: 0.0,
                limits: RatioLimits { most: 0.0, least: None },
                channels: Vec::new(),
                measures: Measures::default(),
            },
            sliders: Sliders { parameters: Vec::new(), axes: 0 },
            wide_levels: levels.clone(),
            levels,
        };
        setup.walk(&mut Walk::Read(numbers))?;
        Some(setup)
    }

    fn walk(&mut self, walk: &mut Walk<'_>) -> Option<()> {
        let Self { machine, spin, .. } = self;
        for list in ElementList::all() {
            let count = walk.count((list.count)(machine))?;
            if walk.is_reading() {
                (list.fill)(machine, count);
            }
        }
        let cabinets = walk.count(usize::from(machine.cabinet.is_some()))?;
        machine.cabinet = (cabinets > 0).then(|| machine.cabinet.unwrap_or_default());
        walk_profile(walk, spin)?;
        let parameters = Parameter::all(machine, spin);
        // Numbers of single elements stand after those of all.
        for parameter in &parameters {
            let mut value = parameter.get(machine, spin);
            walk.optional(&mut value)?;
            if let Some(value) = value.filter(|_| walk.is_reading()) {
                parameter.set(machine, spin, value);
            }
        }
        // A spring's length without force may follow from where its ends are.
        for spring in &mut machine.springs {
            walk.optional(&mut spring.free_length_m)?;
        }
        self.checkpoints = u32::try_from(walk.count(self.checkpoints as usize)?).ok()?;
        walk_rule(walk, &mut self.rule)?;
        let Rule { measures, .. } = &mut self.rule;
        (measures.stops, measures.feet) = (machine.stops.len(), machine.feet.len());
        measures.dampers = machine.dampers.len();
        walk.choices(&mut self.sliders.parameters, &parameters)?;
        self.sliders.axes = walk.count(self.sliders.axes)?;
        let mut all = self.levels.iter_mut().chain(&mut self.wide_levels);
        all.try_for_each(|levels| walk_levels(walk, levels))
    }
}

/// Which profile it is; its numbers are parameters.
fn walk_profile(walk: &mut Walk<'_>, spin: &mut Spin) -> Option<()> {
    let code = walk.count(match spin {
        Spin::Ramped { profile, .. } => *profile as usize,
        Spin::Table { time_s, .. } => Profile::ALL.len() + time_s.len(),
    })?;
    if walk.is_reading() {
        *spin = match Profile::ALL.get(code) {
            Some(&profile) => Spin::Ramped { profile, peak_rpm: 0.0, ramp_s: 0.0 },
            None => {
                let none = vec![0.0; code - Profile::ALL.len()];
                Spin::Table { time_s: none.clone(), speed_rpm: none }
            }
        };
    }
    Some(())
}

/// But for how many elements the machine has.
fn walk_rule(walk: &mut Walk<'_>, rule: &mut Rule) -> Option<()> {
    let Rule { end_s, window_s: [from_s, to_s], accuracy, limits, channels, measures } = rule;
    walk.numbers([end_s, from_s, to_s, accuracy, &mut limits.most])?;
    walk.optional(&mut limits.least)?;
    walk.choices(channels, &Channel::ALL)?;
    walk.choice(&mut measures.criterion, &Criterion::ALL)?;
    walk.choices(&mut measures.metrics, &Metric::ALL)
}

/// Reads or writes at least two levels.
fn walk_levels(walk: &mut Walk<'_>, levels: &mut RefinementLevels) -> Option<()> {
    let mut list = levels.levels.clone();
    walk.sized(&mut list, &levels.levels[0])?;
    list.iter_mut().try_for_each(|level| walk_level(walk, level))?;
    if list.len() < 2 {
        return None;
    }
    *levels = RefinementLevels::checked(list, None);
    Some(())
}

fn walk_level(walk: &mut Walk<'_>, level: &mut RefinementLevel) -> Option<()> {
    walk.choice(&mut level.level, &Level::ALL)?;
    if walk.is_reading() {
        level.method = Method::of(level.level);
    }
    match level.method.numbers() {
        MethodNumbers::Step(step_s) => walk.numbers([step_s]),
        MethodNumbers::Capped(step_s, caps) => {
            walk.numbers([step_s, &mut caps.bearings_rad_per_s])?;
            walk.optional(&mut caps.hinge_rad_per_s)
        }
        MethodNumbers::Tolerance(Tolerance { relative, absolute, max_steps }) => {
            let mut steps = *max_steps as f64;
            walk.numbers([relative, absolute, &mut steps])?;
            *max_steps = steps as u64;
            Some(())
        }
    }
}
