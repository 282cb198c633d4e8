//! Against motions that a program independent of this one found.

use super::*;
use crate::tests::elements::machine;
use crate::tests::reference::reference;
use crate::{Channel, Spin, Timing, prepare};
use serde_json::{Value, json};

const CHANNEL: [(Channel, &str); 4] = [
    (Channel::TubFrontY, "tub_front_y_m"),
    (Channel::TubFrontZ, "tub_front_z_m"),
    (Channel::TubYaw, "tub_yaw_rad"),
    (Channel::TubPitch, "tub_pitch_rad"),
];

fn point_of(case: &Value) -> crate::Point {
    let mut keys = case["elements"].clone();
    for name in ["unbalance_mass_kg", "damping_n_s_per_m"] {
        keys[name] = case[name].clone();
    }
    let spin = Spin::Table { time_s: vec![0.0], speed_rpm: vec![100.0] };
    let timing = Timing { end_s: 1.0, window_s: [0.0, 1.0], checkpoints: 0 };
    prepare(Simd::best(), &[(machine(&keys), spin)], &timing).remove(0).unwrap()
}

/// The greatest difference of a motion from one of the reference, as a share.
fn off(motion: &Ending, end: &Value) -> f64 {
    let of = |(channel, name): &(Channel, &str)| {
        (motion.peaks[channel.index()] / end[*name].as_f64().unwrap() - 1.0).abs()
    };
    CHANNEL.iter().map(of).fold(0.0, f64::max)
}

/// All points of the reference that `takes` takes by machine and speed.
fn held(takes: impl Fn(&str, f64) -> bool) {
    for case in reference("dwells.json").as_array().unwrap() {
        let name = case["name"].as_str().unwrap();
        let point = point_of(case);
        let at: Vec<&Value> = case["points"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|at| takes(name, at["speed_rpm"].as_f64().unwrap()))
            .collect();
        let dwells: Vec<Dwell<'_>> = at
            .iter()
            .map(|at| Dwell { point: &point, speed_rpm: at["speed_rpm"].as_f64().unwrap() })
            .collect();
        let begin = std::time::Instant::now();
        let found = endings(Simd::best(), &dwells, &[], &Starts::default(), &|| false);
        println!("{name}: {} speeds in {:.1} s", at.len(), begin.elapsed().as_secs_f64());
        for (at, found) in at.iter().zip(found) {
            let found = found.unwrap();
            let speed_rpm = at["speed_rpm"].as_f64().unwrap();
            let growth = found.responses[0].growth_per_s();
            println!("{name} {speed_rpm}: growth {growth:.4}");
            for motion in &found.motions {
                let ends = at["ends"].as_array().unwrap();
                let nearest = ends.iter().map(|end| off(motion, end)).fold(f64::INFINITY, f64::min);
                let peaks = CHANNEL.map(|(channel, _)| 1e3 * motion.peaks[channel.index()]);
                println!(
                    "  {:?} {:?} {} of {} after {:.0} s {peaks:.2?} {:?} off {nearest:.1e}",
                    motion.state,
                    motion.settled,
                    motion.starts,
                    found.starts,
                    motion.time_s,
                    motion.exponent,
                );
            }
            check(name, speed_rpm, at, &found);
        }
    }
}

fn check(name: &str, speed_rpm: f64, at: &Value, found: &Endings) {
    let ends = at["ends"].as_array().unwrap();
    for end in ends {
        let period = end["period_turns"].as_u64().unwrap();
        let what = json!([name, speed_rpm, end]);
        // A start that has not left the periodic response says nothing.
        let growth = at["growth_per_s"].as_f64().unwrap();
        if growth.abs() < 0.1 && end["start"] == "disturbed" {
            continue;
        }
        if name == "paper_140" && speed_rpm == 305.0 {
            let chaos: Vec<&Ending> = found
                .motions
                .iter()
                .filter(|motion| motion.settled == Some(Settled::Chaotic))
                .collect();
            assert!(!chaos.is_empty(), "{what}");
            for (channel, name) in CHANNEL {
                let theirs = end[name].as_f64().unwrap();
                assert!(chaos[0].peaks[channel.index()] > 0.5 * theirs, "{what}");
            }
            continue;
        }
        let nearest = |a: &&Ending, b: &&Ending| off(a, end).total_cmp(&off(b, end));
        let motion = found.motions.iter().min_by(nearest).unwrap();
        assert!(off(motion, end) < 5e-3, "{what}: {}", off(motion, end));
        let same = match motion.settled {
            // The reference looks for no period beyond four turns.
            Some(Settled::Periodic { turns: turns @ 5.. }) => period == 0 && turns < 17,
            Some(Settled::Periodic { turns }) => u64::from(turns) == period,
            Some(Settled::QuasiPeriodic { .. }) => period == 0,
            _ => false,
        };
        assert!(same, "{what}: {:?}", motion.settled);
    }
}

#[test]
fn val_motions_of_held_speeds_match_an_independent_program() {
    held(|name, speed| name == "paper_140" && [250.0, 295.0, 305.0, 312.5].contains(&speed));
}

#[test]
#[ignore = "friction takes short steps: a minute"]
fn val_more_motions_of_held_speeds_match_an_independent_program() {
    held(|name, speed| name.starts_with("paper") || (name == "friction_heavy" && speed < 265.0));
}
