//! Times of day as data loggers write them: 12:34:56.789, with or without a date.

use chrono::{DateTime, NaiveDate};

/// The seconds of a day.
const DAY_S: f64 = 86_400.0;

/// Returns the seconds since midnight of a time of day, or since 1970 if it has a date.
pub(super) fn parse_clock_time(cell: &str) -> Option<f64> {
    let cell = cell.trim().trim_end_matches('Z');
    let (date, time) = match cell.rsplit_once([' ', 'T']) {
        Some((date, time)) => (Some(date.trim()), time),
        None => (None, cell),
    };
    let days = date.map_or(Some(0.0), days_since_1970)?;
    let mut time_fields = time.split(':');
    let hours = parse_whole(time_fields.next()?, 24)?;
    let minutes = parse_whole(time_fields.next()?, 59)?;
    let seconds = time_fields.next().unwrap_or("0").replace(',', ".");
    let begins_with_digit = seconds.starts_with(|letter: char| letter.is_ascii_digit());
    let seconds: f64 = seconds.parse().ok()?;
    let is_valid_time =
        begins_with_digit && (0.0..61.0).contains(&seconds) && time_fields.next().is_none();
    is_valid_time.then_some(days * DAY_S + hours * 3600.0 + minutes * 60.0 + seconds)
}

/// Returns the clock time of the seconds since 1970, with its date, or of the seconds since
/// midnight, to a millisecond. A time whose date has no year of the calendar is returned in
/// seconds.
pub(super) fn format_clock_time(seconds: f64) -> String {
    let milliseconds = (1e3 * seconds).round() as i64;
    let time_format = match milliseconds.div_euclid(86_400_000) {
        0 => "%H:%M:%S%.3f",
        _ => "%Y-%m-%d %H:%M:%S%.3f",
    };
    DateTime::from_timestamp_millis(milliseconds)
        .map_or_else(|| format!("{seconds} s"), |time| time.format(time_format).to_string())
}

/// Returns a whole number of at most four digits, if it is no greater than `max`.
fn parse_whole(text: &str, max: u32) -> Option<f64> {
    let has_digits_only =
        (1..=4).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit());
    let number: u32 = text.parse().ok().filter(|_| has_digits_only)?;
    (number <= max).then_some(f64::from(number))
}

/// Returns the days since 1970 of a date: year, month, day with `-` or `/`, or day, month, year
/// with points. A date that can be read in two ways gives `None`.
fn days_since_1970(date: &str) -> Option<f64> {
    let date_fields: Vec<&str> = date.split(['-', '/', '.']).collect();
    let [first_field, month, last_field] = date_fields.as_slice() else { return None };
    let (year, day) = match (first_field.len(), last_field.len(), date.contains('.')) {
        (4, _, false) => (first_field, last_field),
        (_, 4, true) => (last_field, first_field),
        _ => return None,
    };
    let [year, month, day] =
        [parse_whole(year, 9999)?, parse_whole(month, 12)?, parse_whole(day, 31)?];
    let date = NaiveDate::from_ymd_opt(year as i32, month as u32, day as u32)?;
    Some(f64::from(date.to_epoch_days()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_with_and_without_dates_are_read() {
        for (cell, expected) in [
            ("12:34:56.5", 45_296.5),
            ("00:00:01,250", 1.25),
            ("7:05", 25_500.0),
            ("1970-01-02 00:00:00", 86_400.0),
            ("2000-02-29T12:00:00Z", 951_825_600.0),
            ("01.03.2000 00:00:00", 951_868_800.0),
            ("2026/11/29 10:30:45.125", 1_795_948_245.125),
        ] {
            assert_eq!(parse_clock_time(cell), Some(expected), "{cell}");
        }
    }

    #[test]
    fn the_text_of_a_time_is_read_as_that_time() {
        for expected in [
            "12:34:56.500",
            "1970-01-02 00:00:00.000",
            "2000-02-29 12:00:00.001",
            "1999-12-31 23:59:59.999",
            "2100-03-01 07:05:00.250",
            "1969-12-31 23:00:00.000",
        ] {
            assert_eq!(
                parse_clock_time(expected).map(format_clock_time).as_deref(),
                Some(expected)
            );
        }
        for day in (-200_000..200_000).step_by(7).filter(|day| *day != 0) {
            let midnight_s = f64::from(day) * DAY_S;
            assert_eq!(
                parse_clock_time(&format_clock_time(midnight_s)),
                Some(midnight_s),
                "{}",
                format_clock_time(midnight_s)
            );
        }
    }

    #[test]
    fn invalid_times_are_rejected() {
        for cell in [
            "",
            "12",
            "25:00:00",
            "1:60",
            "1:2:-3",
            "1:2:3:4",
            "03/04/2026 1:00",
            "a 1:00",
            "1:+2",
            "2026-02-29 1:00",
        ] {
            assert_eq!(parse_clock_time(cell), None, "{cell}");
        }
    }
}
