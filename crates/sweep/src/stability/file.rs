//! The columns of a stability file.

use parquet::errors::ParquetError;
use serde_json::json;
use washer_model::{Channel, Participant, Response};

use super::Answer;
use crate::plan::Plan;
use crate::table::Table;
use sweep_files::key;

/// The file's bytes: a row for every point and speed, speeds varying fastest.
///
/// # Errors
/// What the Parquet library refuses: a defect of this program.
pub(crate) fn bytes(
    plan: &Plan,
    speeds_rpm: &[f64],
    answers: &[Answer],
) -> Result<Vec<u8>, ParquetError> {
    let rows = 0..answers.len();
    let point = |row: usize| (row / speeds_rpm.len()) as u64;
    let mut table = Table::default();
    table.counts("point", "index in grid order", rows.clone().map(point));
    for (k, axis) in plan.axes.iter().enumerate() {
        let parameter = &axis.parameter;
        let values = rows.clone().map(|row| Some(plan.axis_values(point(row))[k]));
        table.numbers(parameter.name(), parameter.unit(), parameter.description(), values);
    }
    table.numbers(
        "speed_rpm",
        "rpm",
        "constant spin of the shaft",
        rows.map(|row| Some(speeds_rpm[row % speeds_rpm.len()])),
    );
    let responses = || answers.iter().map(|answer| answer.as_deref().ok());
    growth(&mut table, &responses);
    for (number, place) in [("1", 0), ("2", 1)] {
        modes(&mut table, number, &|| {
            responses().map(move |response| response?.participants.get(place))
        });
    }
    amplitudes(&mut table, plan, &responses);
    table.words(
        "status",
        "ok, or why there is no response",
        answers.iter().map(|answer| match answer {
            Ok(_) => "ok",
            Err(missing) => missing.name(),
        }),
    );
    table.metadata(key::PLAN, &plan.to_json());
    table.metadata(key::STABILITY, &json!({ "speeds_rpm": speeds_rpm }));
    table.into_bytes()
}

type Responses<'a, I> = &'a dyn Fn() -> I;

fn growth<'a, I: Iterator<Item = Option<&'a Response>>>(
    table: &mut Table,
    responses: Responses<'_, I>,
) {
    let columns: [(&str, &str, &str, fn(&Response) -> f64); 5] = [
        (
            "growth_per_s",
            "1/s",
            "how fast the fastest growing disturbance of the nonlinear response grows; negative \
             where all decay",
            Response::growth_per_s,
        ),
        (
            "frequency_cpm",
            "1/min",
            "its frequency in cycles per minute, known up to whole multiples of the speed and \
             sign: the one from 0 to half the speed",
            Response::frequency_cpm,
        ),
        ("other_frequency_cpm", "1/min", "the speed less frequency_cpm", |response| {
            response.speed_rpm - response.frequency_cpm()
        }),
        (
            "multiplier_re",
            "1",
            "the suspension's largest Floquet multiplier, real part",
            |response| response.multiplier[0],
        ),
        ("multiplier_im", "1", "its imaginary part, not negative", |response| {
            response.multiplier[1].abs()
        }),
    ];
    for (name, unit, description, of) in columns {
        table.numbers(name, unit, description, responses().map(|response| response.map(of)));
    }
    table.words_if_known(
        "kind",
        "what a disturbance turns the response into: stable, period_doubling, quasi_periodic, fold",
        responses().map(|response| response.map(|response| response.kind().name())),
    );
    table.flags(
        "stable",
        "true where every disturbance decays",
        responses().map(|response| Some(response?.growth_per_s() <= 0.0)),
    );
}

/// One of the modes that take part in what grows.
fn modes<'a, I: Iterator<Item = Option<&'a Participant>>>(
    table: &mut Table,
    number: &str,
    participants: Responses<'_, I>,
) {
    let which = if number == "1" { "that takes most part in" } else { "next to that in" };
    table.counts_if_known(
        &format!("mode_{number}"),
        &format!(
            "number, by frequency at this speed, of the linear model's mode {which} what grows; \
             null where nothing grows, or no such mode is needed"
        ),
        participants().map(|participant| Some(participant?.mode as u64)),
    );
    let names: Vec<Option<String>> =
        participants().map(|participant| Some(participant?.motion.to_string())).collect();
    table.words_if_known(
        &format!("mode_{number}_name"),
        "what moves in it",
        names.iter().map(Option::as_deref),
    );
    table.numbers(
        &format!("mode_{number}_cpm"),
        "1/min",
        "its damped natural frequency at this speed in cycles per minute",
        participants().map(|participant| Some(participant?.frequency_cpm)),
    );
}

fn amplitudes<'a, I: Iterator<Item = Option<&'a Response>>>(
    table: &mut Table,
    plan: &Plan,
    responses: Responses<'_, I>,
) {
    let channels = &plan.reliability.channels;
    let models: [(&str, fn(&Response, usize) -> f64); 2] = [
        ("nonlinear", |response, channel| response.nonlinear[channel]),
        ("linear", |response, channel| response.linear[channel]),
    ];
    for (model, of) in models {
        for channel in channels {
            table.numbers(
                &format!("{model}_{}", channel.name()),
                channel.unit(),
                &format!(
                    "largest deviation of {} from equilibrium over a turn, {model} model",
                    channel.description()
                ),
                responses().map(|response| Some(of(response?, channel.index()))),
            );
        }
    }
    for channel in channels {
        table.numbers(
            &format!("ratio_{}", channel.name()),
            "1",
            "nonlinear over linear amplitude; null where the linear one is zero",
            responses().map(|response| ratio(response?, *channel)),
        );
    }
    table.numbers(
        "ratio_max",
        "1",
        "greatest of the defined ratios; null if none is",
        responses().map(|response| Some(greatest(response?, channels)?.0)),
    );
    table.words_if_known(
        "ratio_max_channel",
        "channel of ratio_max; the first of the plan's channels wins a tie",
        responses().map(|response| Some(greatest(response?, channels)?.1.name())),
    );
}

fn ratio(response: &Response, channel: Channel) -> Option<f64> {
    let (nonlinear, linear) =
        (response.nonlinear[channel.index()], response.linear[channel.index()]);
    (linear != 0.0).then(|| nonlinear / linear)
}

fn greatest(response: &Response, channels: &[Channel]) -> Option<(f64, Channel)> {
    let ratios = channels.iter().filter_map(|&channel| Some((ratio(response, channel)?, channel)));
    ratios.reduce(|most, next| if next.0 > most.0 { next } else { most })
}
