//! An explanation as text.

use washer_model::{
    Attractor, AttractorStatus, Channel, LeftRangeError, MotionKind, StabilityKind, decimal,
};

use sweep_engine::commands::cells::format_number;

use super::{
    Cause, Closing, Explanation, MapResult, ModeResonance, Passage, SpeedScan, Tongue, TongueEnd,
};

/// Maximum width of a line, in characters. Basis: the width of common terminals. Doubling it makes
/// lines twice as long.
const LINE_WIDTH: usize = 96;

/// Width of the column of names before the text, in characters. Basis: the longest name. Doubling
/// it indents the text further.
const NAME_WIDTH: usize = 10;

/// Appends a paragraph with a name. Long paragraphs are wrapped, and aligned with their first word.
fn push_line(text: &mut String, name: &str, words: impl AsRef<str>) {
    let mut line = format!("{name:>NAME_WIDTH$} ");
    for word in words.as_ref().split_whitespace() {
        if line.chars().count() + 1 + word.chars().count() > LINE_WIDTH {
            *text += &(line + "\n");
            line = " ".repeat(NAME_WIDTH + 1);
        }
        line.push(' ');
        line.push_str(word);
    }
    *text += &(line + "\n");
}

/// Returns an explanation as text.
pub(crate) fn to_text(explanation: &Explanation) -> String {
    let mut text = String::new();
    let parameter_texts: Vec<String> = explanation
        .parameters
        .iter()
        .map(|(name, value)| format!("{name} {}", decimal(*value)))
        .collect();
    let point_text = match parameter_texts.is_empty() {
        true => String::new(),
        false => format!(" at {}", parameter_texts.join(", ")),
    };
    text += format!("{}{point_text}", explanation.name).trim_end();
    text.push('\n');
    push_verdict(&mut text, &explanation.map_result);
    for scan in &explanation.scans {
        push_scan(&mut text, explanation, scan);
    }
    for (tongue, passages) in &explanation.tongues {
        text.push('\n');
        push_tongue(&mut text, explanation, tongue, passages);
    }
    text.push('\n');
    push_conclusion(&mut text, explanation);
    push_limitations(&mut text, explanation);
    text
}

/// Appends the stability over the speeds of one direction of turning.
fn push_scan(text: &mut String, explanation: &Explanation, scan: &SpeedScan) {
    let direction = direction_prefix(scan.is_backward);
    push_line(text, "dwells", format!("{direction}{}", describe_stability(explanation, scan)));
    for rpm in &scan.jumps_rpm {
        let words = format!(
            "{direction}at {rpm:.2} rpm the response folds back: a machine that runs up jumps to \
             another there"
        );
        push_line(text, "jump", words);
    }
    if let Some(words) = describe_off_curve(&scan.off_curve_rpm) {
        push_line(text, "off curve", format!("{direction}{words}"));
    }
    if let (Some((from, limit)), Some((to, _))) =
        (scan.exceeded_limits.first(), scan.exceeded_limits.last())
    {
        let [from, to] = [from, to].map(|rpm| format_number(*rpm));
        let count = scan.exceeded_limits.len();
        let limit = limit.name().replace('_', " ");
        let words = format!(
            "{direction}at {count} of the speeds, from {from} to {to} rpm, the response exceeds \
             the machine's geometry ({limit}): its growth there has no meaning for a machine"
        );
        push_line(text, "beyond", words);
    }
}

/// Returns the prefix of sentences about a direction of turning.
const fn direction_prefix(is_backward: bool) -> &'static str {
    if is_backward { "backwards, " } else { "" }
}

/// Returns a sentence on the speeds at which the response is stable, unstable or not known.
fn describe_stability(explanation: &Explanation, scan: &SpeedScan) -> String {
    let [from, to] = [scan.speeds.from_rpm, scan.speeds.to_rpm].map(decimal);
    let count = scan.speeds.values().len();
    let without_response = scan.without_response;
    let unknown_text = format!(
        "at {without_response} of {count} speeds from {from} to {to} rpm no periodic response was \
         found; `sweep dwell` finds the motions there"
    );
    if without_response == count {
        return unknown_text;
    }
    let tongues =
        explanation.tongues.iter().filter(|(tongue, _)| tongue.is_backward == scan.is_backward);
    let tongue_ends: Vec<[TongueEnd; 2]> = tongues.map(|(tongue, _)| tongue.ends).collect();
    if !tongue_ends.is_empty() {
        let bands = describe_bands(tongue_ends.into_iter());
        let unstable_text =
            format!("the periodic response is unstable in {bands} from {from} to {to} rpm");
        return if without_response == 0 {
            format!("{unstable_text}:")
        } else {
            format!("{unstable_text}; {unknown_text}:")
        };
    }
    if without_response == 0 {
        return format!("the periodic response is stable at every speed from {from} to {to} rpm");
    }
    let with_response = count - without_response;
    format!(
        "the periodic response is stable at {with_response} of the speeds looked at; {unknown_text}"
    )
}

/// Returns a sentence on the speeds (rpm) at which the response is not on the curve of a run-up.
fn describe_off_curve(speeds_rpm: &[f64]) -> Option<String> {
    let [from, to] = [speeds_rpm.first()?, speeds_rpm.last()?].map(|rpm| format_number(*rpm));
    Some(format!(
        "at {} of the speeds, from {from} to {to} rpm, the response is off the curve: a machine \
         that runs up may be in another motion there (`sweep dwell`)",
        speeds_rpm.len()
    ))
}

/// Returns the numbers of unstable bands of speed and of the tongues in them. A tongue that ends
/// because the kind of instability changes does not end its band.
fn describe_bands(ends: impl ExactSizeIterator<Item = [TongueEnd; 2]>) -> String {
    let tongue_count = ends.len();
    let band_count = ends.filter(|[from, _]| *from != TongueEnd::OtherKind).count().max(1);
    match (band_count, tongue_count) {
        (1, 1) => "one band of speed (a \"tongue\")".to_owned(),
        (1, _) => format!("one band of speed, with {tongue_count} kinds of growth (\"tongues\"),"),
        _ if band_count == tongue_count => format!("{band_count} bands of speed (\"tongues\")"),
        _ => format!(
            "{band_count} bands of speed, with {tongue_count} kinds of growth (\"tongues\"),"
        ),
    }
}

fn format_thousandths(value: f64, channel: Channel) -> String {
    format!("{} m{}", format_significant(1e3 * value), channel.unit())
}

/// Returns a number with three significant digits.
fn format_significant(value: f64) -> String {
    let magnitude = if value == 0.0 { 0.0 } else { value.abs().log10().floor() };
    if !(-3.0..6.0).contains(&magnitude) {
        return format!("{value:.2e}");
    }
    format!("{value:.*}", (2.0 - magnitude).max(0.0) as usize)
}

fn push_verdict(text: &mut String, map_result: &MapResult) {
    let [from, to] = map_result.window_s.map(decimal);
    let Some((position, ratio)) = map_result.verdict.greatest else {
        let fail_time_text =
            map_result.fail_time_s.map_or(String::new(), |at| format!(" at {at:.3} s"));
        let failure_text = match map_result.status {
            "ok" => "every linear amplitude is zero".to_owned(),
            status => format!("the run ends as `{status}`{fail_time_text}"),
        };
        push_line(text, "swept", format!("no ratio is defined: {failure_text}"));
        return;
    };
    let channel = map_result.channels[position];
    let verdict_text =
        if map_result.verdict.reliable == Some(true) { "reliable" } else { "not reliable" };
    let amplitudes: Vec<String> = map_result
        .amplitudes
        .iter()
        .filter_map(|model| model.get(position).map(|value| format_thousandths(*value, channel)))
        .collect();
    let words = format!(
        "the linear model is {verdict_text}: the greatest ratio is that of {}, where the nonlinear \
         amplitude is {} times the linear one ({} from {from} to {to} s); {}",
        channel.name(),
        format_significant(ratio),
        amplitudes.join(" against "),
        match (decimal(map_result.limits.upper), map_result.limits.lower) {
            (most, None) => format!("the limit is {most}"),
            (most, Some(least)) => format!("the limits are {} and {most}", decimal(least)),
        }
    );
    push_line(text, "swept", words);
    if over_estimates(map_result) {
        let limit_text = format_number(map_result.limits.over_estimate_limit());
        let words = format!("the linear model over-estimates: a ratio is below {limit_text}");
        push_line(text, "too high", words);
    }
    let ratios = map_result.channels.iter().zip(&map_result.verdict.ratios);
    let other_ratios = ratios.filter(|(other, _)| **other != channel).map(|(other, ratio)| {
        let ratio = ratio.map_or("none".to_owned(), format_significant);
        format!("{} {ratio}", other.name())
    });
    let other_ratios: Vec<String> = other_ratios.collect();
    if !other_ratios.is_empty() {
        push_line(text, "ratios", other_ratios.join(", "));
    }
}

/// Returns whether the linear model over-estimates a channel, by the limit that summaries of runs
/// use.
fn over_estimates(map_result: &MapResult) -> bool {
    map_result
        .verdict
        .least
        .is_some_and(|(_, least)| least < map_result.limits.over_estimate_limit())
}

fn push_tongue(
    text: &mut String,
    explanation: &Explanation,
    tongue: &Tongue,
    passages: &[Passage],
) {
    let response = &tongue.fastest_response;
    let kind_text = match response.kind() {
        StabilityKind::PeriodDoubling => "its period doubles",
        StabilityKind::QuasiPeriodic => {
            "a second frequency appears that is no multiple of the speed"
        }
        StabilityKind::Fold => "it jumps to another motion",
        StabilityKind::Stable => "it is stable",
    };
    let [from, to] = tongue.range_rpm;
    let growth_text = format!(
        "{kind_text}, growing at up to {:.4} /s at {:.2} rpm",
        response.growth_per_s(),
        response.speed_rpm
    );
    let direction = direction_prefix(tongue.is_backward);
    let words =
        format!("{direction}{from:.2} to {to:.2} rpm: {growth_text}{}", describe_ends(tongue));
    push_line(text, "tongue", words);
    let low_frequency_cpm = response.frequency_cpm();
    let high_frequency_cpm = response.speed_rpm - response.frequency_cpm();
    let lines_text = match response.kind() {
        StabilityKind::PeriodDoubling => {
            format!("at half the speed, {low_frequency_cpm:.2} per minute")
        }
        StabilityKind::Fold => "none beside those of the turn".to_owned(),
        StabilityKind::QuasiPeriodic | StabilityKind::Stable => {
            format!(
                "at {low_frequency_cpm:.2} and {high_frequency_cpm:.2} per minute, which add up \
                 to the speed"
            )
        }
    };
    push_line(text, "lines", lines_text);
    for mode in &response.participating_modes {
        let number = mode.mode;
        let motion = mode.motion;
        let cpm = mode.frequency_cpm;
        let percent = 100.0 * mode.share;
        let frequency_text = format!("{number}, {motion}: {cpm:.2} per minute at this speed");
        push_line(text, "mode", format!("{frequency_text}; {percent:.0} % of the energy"));
    }
    let words = match &tongue.resonance {
        Some(resonance) => describe_resonance(resonance, response.speed_rpm),
        None => "no sum or difference of these modes' frequencies is within 5 % of a multiple of \
                 the speed: the source of the growth is not explained"
            .to_owned(),
    };
    push_line(text, "resonance", words);
    if let Some(ending) = &tongue.ending {
        push_line(text, "ends in", describe_ending(ending));
    }
    if passages.is_empty() {
        let [least, most] = explanation.profile_rpm.map(decimal);
        let words = format!("never: the profile stays between {least} and {most} rpm in this run");
        push_line(text, "crossed", words);
    }
    for passage in passages {
        push_passage(text, passage);
    }
    push_remedy(text, tongue);
}

/// Returns a description of the motion in which a machine ends.
fn describe_ending(motion: &Attractor) -> String {
    let amplitudes = [Channel::TubYaw, Channel::TubPitch].map(|channel| {
        let name = channel.name().replace('_', " ");
        format!("{name} {}", format_thousandths(motion.peaks[channel.index()], channel))
    });
    let time_text = format!("after {:.0} s", motion.time_s);
    let kind_text = match (motion.motion_kind, motion.status) {
        (Some(MotionKind::Periodic { turns: 1 }), _) => "repeating every turn".to_owned(),
        (Some(MotionKind::Periodic { turns }), _) => format!("repeating every {turns} turns"),
        (Some(MotionKind::QuasiPeriodic { .. }), _) => "with two frequencies".to_owned(),
        (Some(MotionKind::Chaotic), _) => "chaotic".to_owned(),
        (None, AttractorStatus::LeftRange { .. }) => {
            return format!("beyond the model's range, {time_text}");
        }
        (None, AttractorStatus::Transient { life_s }) => {
            format!("a transient that lasts {life_s:.0} s on average and then ends elsewhere")
        }
        (None, AttractorStatus::Ok | AttractorStatus::NotSettled) => {
            format!("not settled {time_text}")
        }
    };
    format!("{}, {kind_text}, if the drum is held there (`sweep dwell`)", amplitudes.join(", "))
}

fn describe_ends(tongue: &Tongue) -> String {
    let mut words = String::new();
    for (rpm, end) in tongue.range_rpm.iter().zip(tongue.ends) {
        let reason = match end {
            TongueEnd::Edge => continue,
            TongueEnd::OtherKind => "the kind of growth changes",
            TongueEnd::Range => "the speeds looked at end, but the growth does not",
            TongueEnd::NoResponse => "no response is found beyond",
        };
        words += &format!("; at {rpm:.2} rpm {reason}");
    }
    words
}

/// Returns the sum or difference of a resonance, such as `f1 + f2`, `2 f2` or `f3 - f1`.
fn format_sum(resonance: &ModeResonance) -> String {
    let [a, b] = resonance.modes;
    match (a == b, resonance.sign > 0.0) {
        (true, _) => format!("2 f{a}"),
        (false, true) => format!("f{a} + f{b}"),
        (false, false) => format!("f{a} - f{b}"),
    }
}

fn describe_resonance(resonance: &ModeResonance, speed_rpm: f64) -> String {
    let target_text = match resonance.order {
        1 => "the speed".to_owned(),
        order => format!("{order} times the speed"),
    };
    let multiple_cpm = f64::from(resonance.order) * speed_rpm;
    let deviation_percent = 100.0 * (resonance.sum_cpm / multiple_cpm - 1.0);
    let sum_text = format_sum(resonance);
    let sum_cpm = resonance.sum_cpm;
    format!(
        "{sum_text} = {sum_cpm:.2} per minute, against {target_text}, {multiple_cpm:.2} \
         ({deviation_percent:+.2} %)"
    )
}

fn push_passage(text: &mut String, passage: &Passage) {
    let [from, to] = passage.interval_s;
    let end_note = if passage.ends_inside { ", where the run ends" } else { "" };
    let e_folds = passage.e_folds;
    let factor_text = format_significant(passage.e_folds.exp());
    let mut words = format!(
        "from {from:.3} to {to:.3} s{end_note}: {e_folds:.2} e-folds, a factor of {factor_text}"
    );
    match &passage.effect {
        Err(LeftRangeError { time_s }) => {
            words += &format!("; the run leaves the model's range at {time_s:.3} s");
        }
        Ok(effect) => {
            let amplification_text = format_significant(effect.amplification);
            words += &format!(
                "; a small disturbance of the actual run grows at most {amplification_text}-fold"
            );
            if let [Some(before), Some(after)] = effect.departure_j {
                let numbers = [1e3 * before, 1e3 * after, (after / before).sqrt()];
                let [before, after, factor_text] = numbers.map(format_significant);
                words += &format!(
                    "; the run's own departure from the periodic response changes from {before} \
                     to {after} mJ, a factor of {factor_text} in amplitude"
                );
            }
        }
    }
    push_line(text, "crossed", words);
}

fn push_remedy(text: &mut String, tongue: &Tongue) {
    let words = match tongue.closing {
        Some(Closing::Factor { factor, damping_n_s_per_m, stable_rpm: [from, to] }) => {
            let dampers_text = match damping_n_s_per_m {
                Some(damping) => format!("{damping:.1} N s/m in every damper ({factor:.2} times)"),
                None => format!("every damper {factor:.2} times as strong"),
            };
            format!("with {dampers_text} nothing grows from {from:.1} to {to:.1} rpm")
        }
        Some(Closing::NotUpTo { factor }) => {
            format!("dampers up to {factor} times as strong do not close it")
        }
        Some(Closing::NoDampers) | None => "the machine has no damping to raise".to_owned(),
    };
    push_line(text, "remedy", words);
}

/// Appends whether tongues cause the verdict of the run over the spin profile.
fn push_conclusion(text: &mut String, explanation: &Explanation) {
    let map_result = &explanation.map_result;
    let Some((_, greatest)) = map_result.verdict.greatest else {
        push_line(text, "so", "there is no verdict to explain");
        return;
    };
    let is_within = greatest < map_result.limits.upper;
    let words = match &explanation.without_departures {
        None if is_within && !over_estimates(map_result) => {
            "no tongue is crossed before the window ends, and the models agree".to_owned()
        }
        None => "no tongue is crossed before the window ends: no unstable response explains the \
             difference of the models"
            .to_owned(),
        Some(Err(LeftRangeError { time_s })) => format!(
            "put on the periodic response as it enters each tongue, the run leaves the model's \
             range at {time_s:.3} s: the failure is not due to motion left over from earlier \
             resonances"
        ),
        Some(Ok(amplitudes)) => match map_result.greatest_ratio(amplitudes) {
            None => "put on the periodic response as it enters each tongue, the run has no ratio"
                .to_owned(),
            Some((ratio, channel)) => {
                let verdict_text = format!(
                    "the same run, put on the periodic response as it enters each tongue, has a \
                     ratio of {} in {}",
                    format_significant(ratio),
                    channel.name()
                );
                let growth_text = describe_growth(explanation.cause.as_ref());
                let is_cause = explanation.cause.is_some_and(|cause| cause.is_sufficient);
                match (is_within, ratio < map_result.limits.upper) {
                    (false, true) if is_cause => format!(
                        "{verdict_text}, within the limit: the verdict is due to motion left over \
                         from before the tongue, and would change with the ramp; {growth_text}"
                    ),
                    (false, true) => format!(
                        "{verdict_text}, within the limit: the verdict is due to motion left over \
                         from before the tongue, but the tongues are not what made it large: \
                              {growth_text}"
                    ),
                    (false, false) if is_cause => format!(
                        "{verdict_text}, still beyond the limit: the tongues alone cause the \
                         verdict, without motion left over from earlier resonances; {growth_text}"
                    ),
                    (false, false) => format!(
                        "{verdict_text}, still beyond the limit, but the tongues are not its \
                         cause: {growth_text}; the linear model fails on the nonlinear \
                         motion itself"
                    ),
                    (true, true) => format!(
                        "{verdict_text}: the motion keeps the limit because the ramp leaves the \
                         tongue before a disturbance has grown; at a speed held inside a tongue \
                         it would not"
                    ),
                    (true, false) => format!(
                        "{verdict_text}, beyond the limit: motion left over from earlier \
                         resonances happens to reduce the deviation"
                    ),
                }
            }
        },
    };
    push_line(text, "so", words);
}

/// Describes when the models begin to differ, and the growth in tongues before that time.
fn describe_growth(cause: Option<&Cause>) -> String {
    let Some(cause) = cause else { return "the deviation's time is not known".to_owned() };
    format!(
        "the motion deviates from {:.2} s and {:.0} rpm on; until the greatest deviation the \
         growth in tongues is {:.2} e-folds, and without it the ratio is {}",
        cause.time_s,
        cause.speed_rpm,
        cause.e_folds,
        format_significant(cause.ratio_without)
    )
}

fn push_limitations(text: &mut String, explanation: &Explanation) {
    let mut words = format!(
        "a tongue narrower than {} rpm may be missed. E-folds take the growth at each instant as \
         that at its speed, held constant; equal e-folds do not mean equal ratios, and a map's \
         boundary is not the edge of a tongue",
        explanation.scans.first().map_or_else(String::new, |scan| decimal(scan.speeds.step_rpm))
    );
    let without_response: usize = explanation.scans.iter().map(|scan| scan.without_response).sum();
    if without_response > 0 {
        words += &format!(
            ". No response was found at {without_response} of the speeds, which are left out"
        );
    }
    push_line(text, "limits", words);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_significant_digits() {
        let formatted =
            [0.0, 1.0, 12.345, 123.45, 0.01234, 1234.5, 1e-5, 1e7].map(format_significant);
        assert_eq!(
            formatted,
            ["0.00", "1.00", "12.3", "123", "0.0123", "1234", "1.00e-5", "1.00e7"]
        );
    }

    #[test]
    fn long_paragraphs_are_wrapped_and_aligned() {
        let mut text = String::new();
        push_line(&mut text, "name", "word ".repeat(40));
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines.len() > 1 && lines.iter().all(|line| line.chars().count() <= LINE_WIDTH));
        assert!(lines[0].starts_with("      name  word"), "{}", lines[0]);
        assert!(lines[1].starts_with("            word"), "{}", lines[1]);
    }

    #[test]
    fn responses_off_the_curve_are_reported() {
        assert_eq!(describe_off_curve(&[]), None);
        let words = describe_off_curve(&[255.0, 256.0, 270.0]).unwrap();
        assert!(words.starts_with("at 3 of the speeds, from 255 to 270 rpm, the response is off"));
        assert!(words.ends_with("(`sweep dwell`)"));
    }

    #[test]
    fn a_band_continues_where_the_kind_of_growth_changes() {
        let bands_text = |ends: &[[TongueEnd; 2]]| describe_bands(ends.iter().copied());
        let unstable_edge = TongueEnd::Edge;
        let other_kind = TongueEnd::OtherKind;
        assert_eq!(
            bands_text(&[[unstable_edge, unstable_edge]]),
            "one band of speed (a \"tongue\")"
        );
        assert_eq!(
            bands_text(&[[unstable_edge, unstable_edge], [unstable_edge, unstable_edge]]),
            "2 bands of speed (\"tongues\")"
        );
        assert_eq!(
            bands_text(&[
                [unstable_edge, unstable_edge],
                [unstable_edge, other_kind],
                [other_kind, unstable_edge]
            ]),
            "2 bands of speed, with 3 kinds of growth (\"tongues\"),"
        );
    }

    #[test]
    fn a_resonance_is_named_by_its_modes() {
        let resonance_of_modes = |modes, sign, order| {
            let frequencies_cpm = [150.0, 100.0];
            ModeResonance { modes, frequencies_cpm, sign, sum_cpm: 150.0 + sign * 100.0, order }
        };
        assert_eq!(format_sum(&resonance_of_modes([2, 2], 1.0, 1)), "2 f2");
        assert_eq!(format_sum(&resonance_of_modes([1, 2], 1.0, 1)), "f1 + f2");
        assert_eq!(format_sum(&resonance_of_modes([2, 1], -1.0, 1)), "f2 - f1");
        let words = describe_resonance(&resonance_of_modes([1, 2], 1.0, 2), 125.0);
        assert_eq!(
            words,
            "f1 + f2 = 250.00 per minute, against 2 times the speed, 250.00 (+0.00 %)"
        );
    }
}
