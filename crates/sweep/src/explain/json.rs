//! An explanation as JSON.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use washer_model::{Attractor, Channel, LeftRangeError, ParticipatingMode};

use super::{Explanation, Passage, SpeedScan, SweptResult, Tongue};

/// Returns an explanation as JSON. Units are part of the names.
pub(crate) fn to_json(explanation: &Explanation) -> Value {
    let tongues = explanation
        .tongues
        .iter()
        .map(|(tongue, passages)| tongue_json(tongue, passages, &explanation.swept));
    let without_departures = explanation.without_departures.as_ref().map(|entered| match entered {
        Ok(amplitudes) => {
            let greatest = explanation.swept.greatest_ratio(amplitudes);
            json!({
                "amplitudes": by_channel(&explanation.swept, amplitudes),
                "ratio_max": greatest.map(|(ratio, _)| ratio),
                "ratio_max_channel": greatest.map(|(_, channel)| channel.name()),
            })
        }
        Err(LeftRangeError { time_s }) => json!({ "left_range_at_s": time_s }),
    });
    let scan = |is_backward: bool| {
        explanation.scans.iter().find(|scan| scan.is_backward == is_backward).map(scan_json)
    };
    json!({
        "name": explanation.name,
        "at": explanation.parameters.iter().cloned().collect::<BTreeMap<_, _>>(),
        "swept": swept_json(&explanation.swept),
        "speeds": scan(false),
        "speeds_backwards": scan(true),
        "profile_rpm": explanation.profile_rpm,
        "tongues": tongues.collect::<Value>(),
        "entered_on_responses": without_departures,
        "deviation": explanation.cause.map(|cause| json!({
            "time_s": cause.time_s,
            "speed_rpm": cause.speed_rpm,
            "e_folds_of_tongues": cause.e_folds,
            "ratio_without_tongues": cause.ratio_without,
            "tongues_are_the_cause": cause.is_enough,
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
        "from_rpm": scan.speeds.from,
        "to_rpm": scan.speeds.to,
        "step_rpm": scan.speeds.step,
        "without_response": scan.without_response,
        "jumps_rpm": scan.jumps_rpm,
        "off_curve_rpm": scan.off_curve_rpm,
        "beyond": exceeded_limits.collect::<Value>(),
    })
}

fn by_channel(swept: &SweptResult, amplitudes: &[f64]) -> Value {
    let name = |channel: &Channel| format!("{}_{}", channel.name(), channel.unit());
    swept.channels.iter().map(name).zip(amplitudes.iter().copied()).collect()
}

fn swept_json(swept: &SweptResult) -> Value {
    let ratios = swept.channels.iter().zip(&swept.verdict.ratios);
    let greatest = swept.verdict.greatest;
    json!({
        "status": swept.status,
        "fail_time_s": swept.fail_time_s,
        "reliable": swept.verdict.reliable,
        "ratio_limit": swept.limits.upper,
        "ratio_min": swept.limits.lower,
        "ratio_max": greatest.map(|(_, ratio)| ratio),
        "ratio_max_channel": greatest.map(|(channel, _)| swept.channels[channel].name()),
        "ratios": ratios
            .map(|(channel, ratio)| (channel.name().to_owned(), json!(ratio)))
            .collect::<Value>(),
        "nonlinear": by_channel(swept, &swept.amplitudes[0]),
        "linear": by_channel(swept, &swept.amplitudes[1]),
        "window_s": swept.window_s,
    })
}

fn tongue_json(tongue: &Tongue, passages: &[Passage], swept: &SweptResult) -> Value {
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
            "kind": Attractor::KIND_NAMES[motion.kind()],
            "amplitudes": by_channel(swept, &swept.plan_channels(&motion.peaks)),
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

fn passage_json(passage_json: &Passage) -> Value {
    let effect = passage_json.effect.as_ref();
    json!({
        "from_s": passage_json.interval_s[0],
        "to_s": passage_json.interval_s[1],
        "is_cut_by_the_end": passage_json.ends_inside,
        "e_folds": passage_json.e_folds,
        "amplification": effect.ok().map(|effect| effect.amplification),
        "departure_j": effect.ok().map(|effect| effect.departure_j),
        "left_range_at_s": effect.err().map(|left| left.time_s),
    })
}
