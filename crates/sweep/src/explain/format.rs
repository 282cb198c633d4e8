//! An explanation in words.

use washer_model::{Channel, Ending, Kind, LeftRange, Settled, State, decimal};

use sweep_engine::commands::cells::short;

use super::{Cause, Closing, End, Explanation, Passage, Resonance, Seen, Swept, Tongue};

/// Where a line ends.
const WIDTH: usize = 96;

/// Width of the names before the text.
const MARGIN: usize = 10;

/// Adds a line with a name; what follows in a paragraph is put beneath its start.
fn line(text: &mut String, name: &str, words: impl AsRef<str>) {
    let mut line = format!("{name:>MARGIN$} ");
    for word in words.as_ref().split_whitespace() {
        if line.chars().count() + 1 + word.chars().count() > WIDTH {
            *text += &(line + "\n");
            line = " ".repeat(MARGIN + 1);
        }
        line.push(' ');
        line.push_str(word);
    }
    *text += &(line + "\n");
}

/// All of it.
pub(crate) fn of(found: &Explanation) -> String {
    let mut text = String::new();
    let at: Vec<String> =
        found.at.iter().map(|(name, value)| format!("{name} {}", decimal(*value))).collect();
    let place = if at.is_empty() { String::new() } else { format!(" at {}", at.join(", ")) };
    text += format!("{}{place}", found.name).trim_end();
    text.push('\n');
    verdict(&mut text, &found.swept);
    for seen in &found.seen {
        beside_tongues(&mut text, found, seen);
    }
    for (tongue, passages) in &found.tongues {
        text.push('\n');
        of_tongue(&mut text, found, tongue, passages);
    }
    text.push('\n');
    judgement(&mut text, found);
    limits(&mut text, found);
    text
}

/// Adds what is seen over the speeds of one way of turning beside tongues.
fn beside_tongues(text: &mut String, found: &Explanation, seen: &Seen) {
    let way = way(seen.is_backward);
    line(text, "dwells", format!("{way}{}", stable_speeds(found, seen)));
    for rpm in &seen.jumps_rpm {
        let words = format!(
            "{way}at {rpm:.2} rpm the response folds back: a machine that runs up jumps to another \
             there"
        );
        line(text, "jump", words);
    }
    if let Some(words) = off_curve(&seen.off_curve_rpm) {
        line(text, "off curve", format!("{way}{words}"));
    }
    if let (Some((from, what)), Some((to, _))) = (seen.beyond.first(), seen.beyond.last()) {
        let [from, to] = [from, to].map(|rpm| short(*rpm));
        let (count, what) = (seen.beyond.len(), what.name().replace('_', " "));
        let words = format!(
            "{way}at {count} of the speeds, from {from} to {to} rpm, the response passes what no \
             machine can ({what}): there growth says nothing of a machine"
        );
        line(text, "beyond", words);
    }
}

/// Returns the beginning of what is said of a way of turning.
const fn way(is_backward: bool) -> &'static str {
    if is_backward { "backwards, " } else { "" }
}

/// Returns at which of the speeds that were looked at the response is stable. Speeds without a
/// response are no evidence.
fn stable_speeds(found: &Explanation, seen: &Seen) -> String {
    let [from, to] = [seen.looked.from, seen.looked.to].map(decimal);
    let (count, missing) = (seen.looked.values().len(), seen.without_response);
    let unknown = format!(
        "at {missing} of {count} speeds from {from} to {to} rpm no periodic response was found, \
         and whether it is stable is not known (`sweep dwell`)"
    );
    if missing == count {
        return unknown;
    }
    let tongues = found.tongues.iter().filter(|(it, _)| it.is_backward == seen.is_backward);
    let ends: Vec<[End; 2]> = tongues.map(|(tongue, _)| tongue.ends).collect();
    if !ends.is_empty() {
        let unstable = bands(ends.into_iter());
        let unstable =
            format!("the periodic response is unstable in {unstable} from {from} to {to} rpm");
        return if missing == 0 {
            format!("{unstable}:")
        } else {
            format!("{unstable}; {unknown}:")
        };
    }
    if missing == 0 {
        return format!("the periodic response is stable at every speed from {from} to {to} rpm");
    }
    let known = count - missing;
    format!("the periodic response is stable at {known} of the speeds looked at; {unknown}")
}

/// At which speeds (rpm) another response was found than that of a machine that runs up.
fn off_curve(speeds_rpm: &[f64]) -> Option<String> {
    let [from, to] = [speeds_rpm.first()?, speeds_rpm.last()?].map(|rpm| short(*rpm));
    Some(format!(
        "at {} of the speeds, from {from} to {to} rpm, the response is off the curve: a machine \
         that runs up may be in another motion there (`sweep dwell`)",
        speeds_rpm.len()
    ))
}

/// How many bands of speed there are, and tongues in them. Where a tongue ends because the motion
/// grows in another way, its band goes on.
fn bands(ends: impl ExactSizeIterator<Item = [End; 2]>) -> String {
    let tongues = ends.len();
    let bands = ends.filter(|[from, _]| *from != End::OtherKind).count().max(1);
    match (bands, tongues) {
        (1, 1) => "one band of speed (a \"tongue\")".to_owned(),
        (1, _) => format!("one band of speed, with {tongues} ways to grow (\"tongues\"),"),
        _ if bands == tongues => format!("{bands} bands of speed (\"tongues\")"),
        _ => format!("{bands} bands of speed, with {tongues} ways to grow (\"tongues\"),"),
    }
}

fn milli(value: f64, channel: Channel) -> String {
    format!("{} m{}", significant(1e3 * value), channel.unit())
}

/// Three digits that count.
fn significant(value: f64) -> String {
    let magnitude = if value == 0.0 { 0.0 } else { value.abs().log10().floor() };
    if !(-3.0..6.0).contains(&magnitude) {
        return format!("{value:.2e}");
    }
    format!("{value:.*}", (2.0 - magnitude).max(0.0) as usize)
}

fn verdict(text: &mut String, swept: &Swept) {
    let [from, to] = swept.window_s.map(decimal);
    let Some((place, ratio)) = swept.verdict.greatest else {
        let when = swept.fail_time_s.map_or(String::new(), |at| format!(" at {at:.3} s"));
        let why = match swept.status {
            "ok" => "every linear amplitude is zero".to_owned(),
            status => format!("the run ends as `{status}`{when}"),
        };
        line(text, "swept", format!("no ratio is defined: {why}"));
        return;
    };
    let channel = swept.channels[place];
    let word = if swept.verdict.reliable == Some(true) { "reliable" } else { "not reliable" };
    let amplitudes: Vec<String> = swept
        .amplitudes
        .iter()
        .filter_map(|of| of.get(place).map(|value| milli(*value, channel)))
        .collect();
    let words = format!(
        "the linear model is {word}: most in {}, where the nonlinear motion is {} times the \
         linear one ({} from {from} to {to} s); {}",
        channel.name(),
        significant(ratio),
        amplitudes.join(" against "),
        match (decimal(swept.limits.most), swept.limits.least) {
            (most, None) => format!("the limit is {most}"),
            (most, Some(least)) => format!("the limits are {} and {most}", decimal(least)),
        }
    );
    line(text, "swept", words);
    if over_estimates(swept) {
        let below = short(swept.limits.over_estimate());
        let words = format!("the linear model over-estimates, a ratio is below {below}");
        line(text, "too high", words);
    }
    let ratios = swept.channels.iter().zip(&swept.verdict.ratios);
    let others = ratios.filter(|(of, _)| **of != channel).map(|(of, ratio)| {
        let ratio = ratio.map_or("none".to_owned(), significant);
        format!("{} {ratio}", of.name())
    });
    let others: Vec<String> = others.collect();
    if !others.is_empty() {
        line(text, "ratios", others.join(", "));
    }
}

/// Whether the linear model gives a channel too much, as summaries of runs count it.
fn over_estimates(swept: &Swept) -> bool {
    swept.verdict.least.is_some_and(|(_, least)| least < swept.limits.over_estimate())
}

fn of_tongue(text: &mut String, found: &Explanation, tongue: &Tongue, passages: &[Passage]) {
    let at = &tongue.at;
    let kind = match at.kind() {
        Kind::PeriodDoubling => "its period doubles",
        Kind::QuasiPeriodic => "two frequencies grow that no turn locks",
        Kind::Fold => "it jumps to another motion",
        Kind::Stable => "it is stable",
    };
    let [from, to] = tongue.from_to_rpm;
    let grows = format!("{kind}, at up to {:.4} /s at {:.2} rpm", at.growth_per_s(), at.speed_rpm);
    let way = way(tongue.is_backward);
    let words = format!("{way}{from:.2} to {to:.2} rpm: {grows}{}", ends(tongue));
    line(text, "tongue", words);
    let (low, high) = (at.frequency_cpm(), at.speed_rpm - at.frequency_cpm());
    let lines = match at.kind() {
        Kind::PeriodDoubling => format!("at half the speed, {low:.2} per minute"),
        Kind::Fold => "none beside those of the turn".to_owned(),
        Kind::QuasiPeriodic | Kind::Stable => {
            format!("at {low:.2} and {high:.2} per minute, which add up to the speed")
        }
    };
    line(text, "lines", lines);
    for mode in &at.participants {
        let (number, motion) = (mode.mode, mode.motion);
        let (cpm, percent) = (mode.frequency_cpm, 100.0 * mode.share);
        let place = format!("{number}, {motion}: {cpm:.2} per minute at this speed");
        line(text, "mode", format!("{place}; {percent:.0} % of the energy"));
    }
    let words = match &tongue.resonance {
        Some(resonance) => meeting(resonance, at.speed_rpm),
        None => "no sum or difference of these modes' frequencies is within 5 % of a multiple of \
                 the speed: what feeds this is not explained"
            .to_owned(),
    };
    line(text, "meeting", words);
    if let Some(ends_in) = &tongue.ends_in {
        line(text, "ends in", end(ends_in));
    }
    if passages.is_empty() {
        let [least, most] = found.profile_rpm.map(decimal);
        let words = format!("never: the profile stays between {least} and {most} rpm in this run");
        line(text, "crossed", words);
    }
    for passage in passages {
        crossed(text, passage);
    }
    closes(text, tongue);
}

/// What a held speed ends in.
fn end(motion: &Ending) -> String {
    let far = [Channel::TubYaw, Channel::TubPitch].map(|channel| {
        let name = channel.name().replace('_', " ");
        format!("{name} {}", milli(motion.peaks[channel.index()], channel))
    });
    let after = format!("after {:.0} s", motion.time_s);
    let what = match (motion.settled, motion.state) {
        (Some(Settled::Periodic { turns: 1 }), _) => "repeating every turn".to_owned(),
        (Some(Settled::Periodic { turns }), _) => format!("repeating every {turns} turns"),
        (Some(Settled::QuasiPeriodic { .. }), _) => "with two frequencies".to_owned(),
        (Some(Settled::Chaotic), _) => "chaotic".to_owned(),
        (None, State::LeftRange { .. }) => {
            return format!("farther than the model is good for, {after}");
        }
        (None, State::Transient { life_s }) => {
            format!("a transient that wanders for {life_s:.0} s on average, then ends elsewhere")
        }
        (None, State::Ok | State::NotSettled) => format!("not settled {after}"),
    };
    format!("{}, {what}, if the drum is held there (`sweep dwell`)", far.join(", "))
}

fn ends(tongue: &Tongue) -> String {
    let mut words = String::new();
    for (rpm, end) in tongue.from_to_rpm.iter().zip(tongue.ends) {
        let why = match end {
            End::Edge => continue,
            End::OtherKind => "the motion grows on, in another way",
            End::Range => "the speeds looked at end, and not the growth",
            End::NoResponse => "no response is found beyond",
        };
        words += &format!("; at {rpm:.2} rpm {why}");
    }
    words
}

/// `f1 + f2`, `2 f2` or `f3 - f1`.
fn sum_words(resonance: &Resonance) -> String {
    let [a, b] = resonance.modes;
    match (a == b, resonance.sign > 0.0) {
        (true, _) => format!("2 f{a}"),
        (false, true) => format!("f{a} + f{b}"),
        (false, false) => format!("f{a} - f{b}"),
    }
}

fn meeting(resonance: &Resonance, speed_rpm: f64) -> String {
    let target = match resonance.order {
        1 => "the speed".to_owned(),
        order => format!("{order} times the speed"),
    };
    let multiple = f64::from(resonance.order) * speed_rpm;
    let miss = 100.0 * (resonance.sum_cpm / multiple - 1.0);
    let (sum, cpm) = (sum_words(resonance), resonance.sum_cpm);
    format!("{sum} = {cpm:.2} per minute, against {target}, {multiple:.2} ({miss:+.2} %)")
}

fn crossed(text: &mut String, passage: &Passage) {
    let [from, to] = passage.from_to_s;
    let cut = if passage.is_cut { ", where the run ends" } else { "" };
    let (folds, factor) = (passage.e_folds, significant(passage.e_folds.exp()));
    let mut words =
        format!("from {from:.3} to {to:.3} s{cut}: {folds:.2} e-folds, a factor of {factor}");
    match &passage.crossed {
        Err(LeftRange { time_s }) => {
            words += &format!("; the run leaves the model's range at {time_s:.3} s");
        }
        Ok(crossed) => {
            let most = significant(crossed.amplification);
            words +=
                &format!("; in truth a small disturbance of the run grows at most {most}-fold");
            if let [Some(before), Some(after)] = crossed.departure_j {
                let numbers = [1e3 * before, 1e3 * after, (after / before).sqrt()];
                let [before, after, factor] = numbers.map(significant);
                words += &format!(
                    "; the run's own departure from the periodic response goes from {before} to \
                     {after} mJ, a factor of {factor} in amplitude"
                );
            }
        }
    }
    line(text, "crossed", words);
}

fn closes(text: &mut String, tongue: &Tongue) {
    let words = match tongue.closing {
        Some(Closing::Factor { factor, damping_n_s_per_m, looked_rpm: [from, to] }) => {
            let dampers = match damping_n_s_per_m {
                Some(damping) => format!("{damping:.1} N s/m in every damper ({factor:.2} times)"),
                None => format!("every damper {factor:.2} times as strong"),
            };
            format!("with {dampers} nothing grows from {from:.1} to {to:.1} rpm")
        }
        Some(Closing::NotUpTo { factor }) => {
            format!("dampers up to {factor} times as strong do not close it")
        }
        Some(Closing::NoDampers) | None => "the machine has no damping to raise".to_owned(),
    };
    line(text, "remedy", words);
}

/// What the tongues have to do with the swept verdict.
fn judgement(text: &mut String, found: &Explanation) {
    let swept = &found.swept;
    let Some((_, greatest)) = swept.verdict.greatest else {
        line(text, "so", "there is no verdict to explain");
        return;
    };
    let is_within = greatest < swept.limits.most;
    let words = match &found.without_departures {
        None if is_within && !over_estimates(swept) => {
            "no tongue is crossed before the window ends, and the models agree".to_owned()
        }
        None => {
            "no tongue is crossed before the window ends: what the linear model misses here is \
                 not explained by an unstable response"
                .to_owned()
        }
        Some(Err(LeftRange { time_s })) => format!(
            "entered on its periodic responses, the run leaves the model's range at {time_s:.3} s: \
             the failure does not rest on what earlier resonances left"
        ),
        Some(Ok(amplitudes)) => match swept.greatest_of(amplitudes) {
            None => "entered on its periodic responses, the run has no ratio".to_owned(),
            Some((ratio, channel)) => {
                let same = format!(
                    "the same run, put on the periodic response as it enters each tongue, has a \
                     ratio of {} in {}",
                    significant(ratio),
                    channel.name()
                );
                let grows = growth_until(found.cause.as_ref());
                let is_cause = found.cause.is_some_and(|cause| cause.is_enough);
                match (is_within, ratio < swept.limits.most) {
                    (false, true) if is_cause => format!(
                        "{same}, within the limit: the verdict rests on motion left over from \
                         before the tongue, and would change with the ramp; {grows}"
                    ),
                    (false, true) => format!(
                        "{same}, within the limit: the verdict rests on motion left over from \
                         before the tongue, which the tongues do not make large: {grows}"
                    ),
                    (false, false) if is_cause => format!(
                        "{same}, still beyond the limit: the tongues alone make the verdict, \
                         without what earlier resonances left; {grows}"
                    ),
                    (false, false) => format!(
                        "{same}, still beyond the limit, but the tongues are not its cause: \
                         {grows}; what the linear model misses is the nonlinear motion itself"
                    ),
                    (true, true) => format!(
                        "{same}: the motion keeps the limit because the ramp is through before \
                         a disturbance has grown; a dwell inside a tongue would not"
                    ),
                    (true, false) => format!(
                        "{same}, beyond the limit: here what earlier resonances left keeps the \
                         motion down by chance"
                    ),
                }
            }
        },
    };
    line(text, "so", words);
}

/// Returns when the motion deviates, and what the tongues before that have to do with it.
fn growth_until(cause: Option<&Cause>) -> String {
    let Some(cause) = cause else { return "the deviation's time is not known".to_owned() };
    format!(
        "the motion deviates from {:.2} s and {:.0} rpm on; until it is greatest the tongues make \
         {:.2} e-folds, and without what they add the ratio is {}",
        cause.time_s,
        cause.speed_rpm,
        cause.e_folds,
        significant(cause.ratio_without)
    )
}

fn limits(text: &mut String, found: &Explanation) {
    let mut words = format!(
        "a tongue narrower than {} rpm may be missed. E-folds hold the speed still at each \
         instant; equal e-folds do not mean equal ratios, and a map's boundary is not the edge of \
         a tongue",
        found.seen.first().map_or_else(String::new, |seen| decimal(seen.looked.step))
    );
    let without: usize = found.seen.iter().map(|seen| seen.without_response).sum();
    if without > 0 {
        words += &format!(". No response was found at {without} of the speeds, which are left out");
    }
    line(text, "limits", words);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_count() {
        let shown = [0.0, 1.0, 12.345, 123.45, 0.01234, 1234.5, 1e-5, 1e7].map(significant);
        assert_eq!(shown, ["0.00", "1.00", "12.3", "123", "0.0123", "1234", "1.00e-5", "1.00e7"]);
    }

    #[test]
    fn long_lines_are_folded_beneath_their_start() {
        let mut text = String::new();
        line(&mut text, "name", "word ".repeat(40));
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines.len() > 1 && lines.iter().all(|line| line.chars().count() <= WIDTH));
        assert!(lines[0].starts_with("      name  word"), "{}", lines[0]);
        assert!(lines[1].starts_with("            word"), "{}", lines[1]);
    }

    #[test]
    fn responses_off_the_curve_are_not_taken_for_those_of_a_run_up() {
        assert_eq!(off_curve(&[]), None);
        let words = off_curve(&[255.0, 256.0, 270.0]).unwrap();
        assert!(words.starts_with("at 3 of the speeds, from 255 to 270 rpm, the response is off"));
        assert!(words.ends_with("(`sweep dwell`)"));
    }

    #[test]
    fn a_band_goes_on_where_the_motion_grows_in_another_way() {
        let of = |ends: &[[End; 2]]| bands(ends.iter().copied());
        let (edge, other) = (End::Edge, End::OtherKind);
        assert_eq!(of(&[[edge, edge]]), "one band of speed (a \"tongue\")");
        assert_eq!(of(&[[edge, edge], [edge, edge]]), "2 bands of speed (\"tongues\")");
        let words = of(&[[edge, edge], [edge, other], [other, edge]]);
        assert_eq!(words, "2 bands of speed, with 3 ways to grow (\"tongues\"),");
    }

    #[test]
    fn a_resonance_is_named_by_its_modes() {
        let of = |modes, sign, order| {
            let frequencies_cpm = [150.0, 100.0];
            Resonance { modes, frequencies_cpm, sign, sum_cpm: 150.0 + sign * 100.0, order }
        };
        assert_eq!(sum_words(&of([2, 2], 1.0, 1)), "2 f2");
        assert_eq!(sum_words(&of([1, 2], 1.0, 1)), "f1 + f2");
        assert_eq!(sum_words(&of([2, 1], -1.0, 1)), "f2 - f1");
        let words = meeting(&of([1, 2], 1.0, 2), 125.0);
        assert_eq!(
            words,
            "f1 + f2 = 250.00 per minute, against 2 times the speed, 250.00 (+0.00 %)"
        );
    }
}
