//! An explanation as JSON.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use washer_model::{Attractor, Channel, LeftRangeError, ParticipatingMode};

use super::{Explanation, MapResult, Passage, SpeedScan, Tongue};

/// Returns an explanation as JSON. Units are part of the names.
pub(crate) fn to_json(explanation: &Explanation) -> Value {
    let tongues = explanation
        .tongues
        .iter()
        .map(|(tongue, passages)| tongue_json(tongue, passages, &explanation.map_result));
    let without_departures =
        explanation.without_departures.as_ref().map(|amplitudes| match amplitudes {
            Ok(amplitudes) => {
                let greatest = explanation.map_result.greatest_ratio(amplitudes);
                json!({
                    "amplitudes": channel_values_json(&explanation.map_result, amplitudes),
                    "ratio_max": greatest.map(|(ratio, _)| ratio),
                    "ratio_max_channel": greatest.map(|(_, channel)| channel.name()),
                })
            }
            Err(LeftRangeError { time_s }) => json!({ "left_range_at_s": time_s }),
        });
    let scan_json_of_direction = |is_backward: bool| {
        explanation.scans.iter().find(|scan| scan.is_backward == is_backward).map(scan_json)
    };
    json!({
        "name": explanation.name,
        "at": explanation.parameters.iter().cloned().collect::<BTreeMap<_, _>>(),
        "swept": map_result_json(&explanation.map_result),
        "speeds": scan_json_of_direction(false),
        "speeds_backwards": scan_json_of_direction(true),
        "profile_rpm": explanation.profile_rpm,
        "tongues": tongues.collect::<Value>(),
        "entered_on_responses": without_departures,
        "deviation": explanation.cause.map(|cause| json!({
            "time_s": cause.time_s,
            "speed_rpm": cause.speed_rpm,
            "e_folds_of_tongues": cause.e_folds,
            "ratio_without_tongues": cause.ratio_without,
            "tongues_are_the_cause": cause.is_sufficient,
        })),
    })
}

/// Returns the scan over the speeds of one direction of turning.
fn scan_json(scan: &SpeedScan) -> Value {
    let exceeded_limits = scan
        .exceeded_limits
        .iter()
        .map(|(rpm, limit)| json!({ "speed_rpm": rpm, "passes": limit.name() }));
    json!({
        "from_rpm": scan.speeds.from_rpm,
        "to_rpm": scan.speeds.to_rpm,
        "step_rpm": scan.speeds.step_rpm,
        "without_response": scan.without_response,
        "jumps_rpm": scan.jumps_rpm,
        "off_curve_rpm": scan.off_curve_rpm,
        "beyond": exceeded_limits.collect::<Value>(),
    })
}

fn channel_values_json(map_result: &MapResult, amplitudes: &[f64]) -> Value {
    let channel_key = |channel: &Channel| format!("{}_{}", channel.name(), channel.unit());
    map_result.channels.iter().map(channel_key).zip(amplitudes.iter().copied()).collect()
}

fn map_result_json(map_result: &MapResult) -> Value {
    let ratios = map_result.channels.iter().zip(&map_result.verdict.ratios);
    let greatest = map_result.verdict.greatest;
    json!({
        "status": map_result.status,
        "fail_time_s": map_result.fail_time_s,
        "reliable": map_result.verdict.reliable,
        "ratio_limit": map_result.limits.upper,
        "ratio_min": map_result.limits.lower,
        "ratio_max": greatest.map(|(_, ratio)| ratio),
        "ratio_max_channel": greatest.map(|(channel, _)| map_result.channels[channel].name()),
        "ratios": ratios
            .map(|(channel, ratio)| (channel.name().to_owned(), json!(ratio)))
            .collect::<Value>(),
        "nonlinear": channel_values_json(map_result, &map_result.amplitudes[0]),
        "linear": channel_values_json(map_result, &map_result.amplitudes[1]),
        "window_s": map_result.window_s,
    })
}

fn tongue_json(tongue: &Tongue, passages: &[Passage], map_result: &MapResult) -> Value {
    let response = &tongue.fastest_response;
    json!({
        "is_backward": tongue.is_backward,
        "from_rpm": tongue.range_rpm[0],
        "to_rpm": tongue.range_rpm[1],
        "ends": tongue.ends,
        "kind": response.kind().name(),
        "growth_per_s": response.growth_per_s(),
        "growth_at_rpm": response.speed_rpm,
        "frequency_cpm": response.frequency_cpm(),
        "other_frequency_cpm": response.speed_rpm - response.frequency_cpm(),
        "modes": response.participating_modes.iter().map(participant_json).collect::<Value>(),
        "resonance": tongue.resonance,
        "crossed": passages.iter().map(passage_json).collect::<Value>(),
        "ends_in": tongue.ending.as_ref().map(|motion| json!({
            "kind": Attractor::KIND_NAMES[motion.kind_index()],
            "amplitudes": channel_values_json(map_result, &map_result.plan_channels(&motion.peaks)),
            "followed_s": motion.time_s,
        })),
        "closed_by": tongue.closing,
    })
}

fn participant_json(mode: &ParticipatingMode) -> Value {
    json!({
        "mode": mode.mode,
        "name": mode.motion.to_string(),
        "frequency_cpm": mode.frequency_cpm,
        "share": mode.share,
    })
}

fn passage_json(passage: &Passage) -> Value {
    let effect = passage.effect.as_ref();
    json!({
        "from_s": passage.interval_s[0],
        "to_s": passage.interval_s[1],
        "is_cut_by_the_end": passage.ends_inside,
        "e_folds": passage.e_folds,
        "amplification": effect.ok().map(|effect| effect.amplification),
        "departure_j": effect.ok().map(|effect| effect.departure_j),
        "left_range_at_s": effect.err().map(|left| left.time_s),
    })
}
