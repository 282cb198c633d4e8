//! What a page computes with.

use lane_ode::Tolerance;
use sweep_parameter::RatioLimits;
use washer_model::{
    BumpStop, Bushing, Cabinet, Caps, Channel, Foot, Gear, Geared, Machine, Method, Parameter,
    Spin, Unbalance,
};
use washer_row::{Convergence, Criterion, Ladder, Level, Measures, Metric, Rule, Rung};

use crate::numbers::{Reader, Writer};

/// Most elements of a kind, and most rungs: what a page was written with has fewer.
const MOST: usize = 100_000;

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
    /// Rungs of the nonlinear and of the linear model while only axes move. What holds the quick
    /// ones back, in words, does not go with the numbers.
    pub ladders: [Ladder; 2],
    /// The same while any slider may be anywhere in its range.
    pub wide_ladders: [Ladder; 2],
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
        let mut out = Writer::default();
        let machine = &self.machine;
        let counts = [
            machine.springs.len(),
            machine.dampers.len(),
            machine.stops.len(),
            machine.bushings.len(),
            machine.further_unbalances.len(),
            machine.feet.len(),
            usize::from(machine.cabinet.is_some()),
        ];
        counts.into_iter().for_each(|count| out.count(count));
        match &self.spin {
            Spin::Cycloidal { .. } => out.count(0),
            Spin::Triangular { .. } => out.count(1),
            Spin::Ramp { .. } => out.count(2),
            Spin::Table { time_s, .. } => out.count(3 + time_s.len()),
        }
        let parameters = Parameter::all(machine, &self.spin);
        for parameter in &parameters {
            out.optional(parameter.get(machine, &self.spin));
        }
        // A spring's length without force may follow from where its ends are.
        machine.springs.iter().for_each(|spring| out.optional(spring.free_length_m));
        out.number(f64::from(self.checkpoints));
        write_rule(&mut out, &self.rule);
        let place = |slider: &Parameter| {
            let at = parameters.iter().position(|parameter| parameter == slider);
            at.map_or(f64::NAN, |at| at as f64)
        };
        let sliders: Vec<f64> = self.sliders.parameters.iter().map(place).collect();
        out.counted(&sliders);
        out.count(self.sliders.axes);
        for ladder in self.ladders.iter().chain(&self.wide_ladders) {
            out.count(ladder.rungs.len());
            out.count(ladder.reference().unwrap_or(0));
            ladder.rungs.iter().for_each(|rung| write_rung(&mut out, rung));
        }
        out.0
    }

    /// From [`Self::to_numbers`]; `None` from anything else.
    pub fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let mut from = Reader(numbers);
        let mut machine = Machine::paper();
        let mut count = || from.count(MOST);
        let (spring, damper) = (machine.springs[0], machine.dampers[0]);
        machine.springs = vec![spring; count()?];
        machine.dampers = vec![damper; count()?];
        machine.stops = vec![BumpStop::default(); count()?];
        machine.bushings = vec![Bushing::default(); count()?];
        machine.further_unbalances = vec![Unbalance::default(); count()?];
        machine.feet = vec![Foot::default(); count()?];
        machine.cabinet = (count()? > 0).then(Cabinet::default);
        let (peak_rpm, ramp_s) = (0.0, 0.0);
        let mut spin = match count()? {
            0 => Spin::Cycloidal { peak_rpm, ramp_s },
            1 => Spin::Triangular { peak_rpm, ramp_s },
            2 => Spin::Ramp { peak_rpm, ramp_s },
            more => Spin::Table { time_s: vec![0.0; more - 3], speed_rpm: vec![0.0; more - 3] },
        };
        let parameters = Parameter::all(&machine, &spin);
        // Numbers of single elements stand after those of all.
        for parameter in &parameters {
            if let Some(value) = from.optional()? {
                parameter.set(&mut machine, &mut spin, value);
            }
        }
        for spring in &mut machine.springs {
            spring.free_length_m = from.optional()?;
        }
        let checkpoints = u32::try_from(from.count(MOST)?).ok()?;
        let rule = read_rule(&mut from, &machine)?;
        let slider = |of: &f64| parameters.get(*of as usize).cloned();
        let sliders = from.counted()?.iter().map(slider).collect::<Option<_>>()?;
        let sliders = Sliders { parameters: sliders, axes: from.count(MOST)? };
        let mut ladder = || -> Option<Ladder> {
            let count = from.count(MOST).filter(|count| *count > 1)?;
            let reference = from.count(MOST).filter(|at| (1..count).contains(at))?;
            let mut rungs: Vec<Rung> =
                (0..count).map(|_| read_rung(&mut from)).collect::<Option<_>>()?;
            let finer = rungs.split_off(reference + 1);
            Some(Ladder::checked(rungs, None).with_finer(finer))
        };
        let ladders = [ladder()?, ladder()?];
        let wide_ladders = [ladder()?, ladder()?];
        Some(Self { machine, spin, checkpoints, rule, sliders, ladders, wide_ladders })
    }
}

/// Stops and feet are counted with the machine.
fn write_rule(out: &mut Writer, rule: &Rule) {
    let Rule { end_s, window_s: [from_s, to_s], accuracy, limits, channels, measures } = rule;
    for number in [end_s, from_s, to_s, accuracy, &limits.most] {
        out.number(*number);
    }
    out.optional(limits.least);
    let channels: Vec<f64> = channels.iter().map(|of| of.index() as f64).collect();
    out.counted(&channels);
    out.count(measures.criterion as usize);
    let metrics: Vec<f64> = measures.metrics.iter().map(|of| f64::from(*of as u8)).collect();
    out.counted(&metrics);
}

fn read_rule(from: &mut Reader<'_>, machine: &Machine) -> Option<Rule> {
    let (end_s, window_s) = (from.number()?, [from.number()?, from.number()?]);
    let accuracy = from.number()?;
    let limits = RatioLimits { most: from.number()?, least: from.optional()? };
    let channel = |of: &f64| Channel::ALL.get(*of as usize).copied();
    let channels = from.counted()?.iter().map(channel).collect::<Option<_>>()?;
    let criterion = *Criterion::ALL.get(from.count(MOST)?)?;
    let metric = |of: &f64| Metric::ALL.get(*of as usize).copied();
    let metrics = from.counted()?.iter().map(metric).collect::<Option<_>>()?;
    let (stops, feet) = (machine.stops.len(), machine.feet.len());
    let dampers = machine.dampers.len();
    let measures = Measures { criterion, metrics, stops, feet, dampers };
    Some(Rule { end_s, window_s, accuracy, limits, channels, measures })
}

fn write_rung(out: &mut Writer, rung: &Rung) {
    out.number(f64::from(rung.level as u8));
    let Convergence { contraction, of_caps, believed_to, own_error, expected } = rung.convergence;
    for number in [contraction, of_caps, believed_to, own_error, expected] {
        out.number(number);
    }
    out.count(usize::from(rung.follows_bearings));
    match rung.method {
        Method::Geared(Geared { gears }) => {
            out.count(1);
            for Gear { up_to_rad_per_s, step_s, caps } in gears {
                out.number(up_to_rad_per_s);
                out.number(step_s);
                out.number(caps.bearings_rad_per_s);
                out.optional(caps.hinge_rad_per_s);
            }
        }
        Method::Rk4 { step_s } => {
            out.count(0);
            out.number(step_s);
        }
        Method::Additive(Tolerance { relative, absolute, max_steps }) => {
            out.count(2);
            out.number(relative);
            out.number(absolute);
            out.number(max_steps as f64);
        }
        // Nothing that reads this knows them.
        Method::Dopri5(_) | Method::Rodas5p(_) => out.number(f64::NAN),
    }
}

fn read_rung(from: &mut Reader<'_>) -> Option<Rung> {
    let level = *Level::ALL.get(from.count(MOST)?)?;
    let convergence = Convergence {
        contraction: from.number()?,
        of_caps: from.number()?,
        believed_to: from.number()?,
        own_error: from.number()?,
        expected: from.number()?,
    };
    let follows_bearings = from.count(2)? > 0;
    let method = match from.count(3)? {
        0 => Method::Rk4 { step_s: from.number()? },
        2 => {
            let (relative, absolute) = (from.number()?, from.number()?);
            let max_steps = from.number()? as u64;
            Method::Additive(Tolerance { relative, absolute, max_steps })
        }
        _ => {
            let mut gear = || -> Option<Gear> {
                let (up_to_rad_per_s, step_s) = (from.number()?, from.number()?);
                let bearings_rad_per_s = from.number()?;
                let hinge_rad_per_s = from.optional()?;
                let caps = Caps { bearings_rad_per_s, hinge_rad_per_s };
                Some(Gear { up_to_rad_per_s, step_s, caps })
            };
            Method::Geared(Geared { gears: [gear()?, gear()?, gear()?] })
        }
    };
    Some(Rung { level, method, convergence, follows_bearings })
}
