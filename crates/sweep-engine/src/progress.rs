//! The display of progress: a bar on a terminal, a line at intervals elsewhere, or nothing.

use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use crate::config::section::format_count;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use sweep_files::panics::lock;

/// A value of `--progress`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ProgressMode {
    /// A bar on a terminal; elsewhere a line a minute, which suits the log of a batch job.
    #[default]
    Auto,
    /// A line every five seconds.
    Plain,
    /// No display.
    None,
}

/// A display of progress on stderr, which any thread may update.
pub struct Progress {
    display: Mutex<ProgressDisplay>,
    total_count: u64,
    /// The plural noun for the units of the total.
    noun: &'static str,
    /// The number of points that were stored at the start. These points count as done, but not in
    /// the rate.
    stored_points: u64,
    start_time: Instant,
}

/// The form of the display.
enum ProgressDisplay {
    Bar(ProgressBar),
    Lines { interval: Duration, next_line_time: Instant },
    Nothing,
}

impl Progress {
    /// Creates the display of a run and shows it.
    pub fn new(mode: ProgressMode, total: u64, stored_points: u64) -> Self {
        let progress = Self::for_search(mode, total, "points", stored_points);
        progress.show(stored_points);
        progress
    }

    /// Creates the display of a search, whose number of points is not known in advance. It counts
    /// units up to a total; if the total is 0, it counts points only. `noun` is the plural noun for
    /// the units, `stored_points` the number of points that were stored at the start.
    pub fn for_search(
        mode: ProgressMode,
        total: u64,
        noun: &'static str,
        stored_points: u64,
    ) -> Self {
        let create_line_display = |interval_s| {
            let interval = Duration::from_secs(interval_s);
            ProgressDisplay::Lines { interval, next_line_time: Instant::now() + interval }
        };
        let display = match mode {
            ProgressMode::None => ProgressDisplay::Nothing,
            ProgressMode::Plain => create_line_display(5),
            ProgressMode::Auto if std::io::stderr().is_terminal() => {
                let target = ProgressDrawTarget::stderr_with_hz(8);
                let bar = ProgressBar::with_draw_target(Some(total), target);
                bar.enable_steady_tick(Duration::from_millis(125));
                ProgressDisplay::Bar(bar.with_style(create_style(if total == 0 {
                    SPINNER_TEMPLATE
                } else {
                    BAR_TEMPLATE
                })))
            }
            ProgressMode::Auto => create_line_display(60),
        };
        Self {
            display: Mutex::new(display),
            total_count: total,
            noun,
            stored_points,
            start_time: Instant::now(),
        }
    }

    /// Shows that `done` points are done.
    pub fn show(&self, done: u64) {
        self.update_display(done, || self.format_line(done));
    }

    /// Shows that `done` units of a search are done, with a number of points.
    pub fn show_search(&self, done: u64, points: u64) {
        self.update_display(done, || self.format_search_line(done, points));
    }

    fn format_search_line(&self, done: u64, points: u64) -> String {
        let rate = format_rate(self.points_per_s(points));
        let points = format!("{}, {rate}", format_count(points as usize, "point"));
        match (self.total_count, self.noun) {
            (0, _) => points,
            (total, noun) => format!("{done} of {total} {noun}, {points}"),
        }
    }

    /// Updates the bar, or writes a line if the last one is old enough.
    fn update_display(&self, position: u64, text: impl FnOnce() -> String) {
        // A thread does not wait while another one updates the display.
        let Ok(mut display) = self.display.try_lock() else { return };
        match &mut *display {
            ProgressDisplay::Bar(bar) => {
                bar.set_position(position);
                bar.set_message(text());
            }
            ProgressDisplay::Lines { interval, next_line_time }
                if Instant::now() >= *next_line_time =>
            {
                // A log that cannot be written must not end the run.
                let _ = writeln!(std::io::stderr(), "{}", text());
                *next_line_time = Instant::now() + *interval;
            }
            _ => {}
        }
    }

    /// Returns the points per second of this process.
    fn points_per_s(&self, done: u64) -> f64 {
        done.saturating_sub(self.stored_points) as f64
            / self.start_time.elapsed().as_secs_f64().max(1e-9)
    }

    /// Shows in the bar that the chunks are being joined.
    pub fn show_joining(&self) {
        if let ProgressDisplay::Bar(bar) = &*lock(&self.display) {
            bar.set_style(create_style("{spinner} joining {human_len} points"));
            bar.tick();
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        if let ProgressDisplay::Bar(bar) = &*lock(&self.display) {
            bar.finish_and_clear();
        }
    }

    fn format_line(&self, done: u64) -> String {
        let rate = self.points_per_s(done);
        let percent = 100.0 * done as f64 / self.total_count.max(1) as f64;
        let done_text = format!("{done} of {} points ({percent:.1} %)", self.total_count);
        // Before the first point, neither the rate nor the time left can be estimated.
        if rate == 0.0 {
            return done_text;
        }
        let remaining_time = format_duration(self.total_count.saturating_sub(done) as f64 / rate);
        format!("{done_text}, {}, {remaining_time} left", format_rate(rate))
    }
}

/// The template of a bar with its numbers.
const BAR_TEMPLATE: &str = "{wide_bar} {msg}";

/// The template of a search without a total.
const SPINNER_TEMPLATE: &str = "{spinner} {msg}";

fn create_style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

/// Formats a duration: `0.42 s`, `12 s`, `3 min 20 s`, `5 h 02 min`.
pub fn format_duration(seconds: f64) -> String {
    if seconds < 10.0 {
        return format!("{seconds:.2} s");
    }
    // The cast saturates above 1e19 s.
    let whole_seconds = seconds.round() as u64;
    match whole_seconds {
        0..60 => format!("{whole_seconds} s"),
        60..3600 => format!("{} min {:02} s", whole_seconds / 60, whole_seconds % 60),
        3600..172_800 => format!("{} h {:02} min", whole_seconds / 3600, whole_seconds % 3600 / 60),
        _ => format!("{} days", whole_seconds / 86_400),
    }
}

/// Formats a rate with three digits.
pub fn format_rate(rate: f64) -> String {
    if rate >= 100.0 { format!("{rate:.0} points/s") } else { format!("{rate:.3} points/s") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_readable_units() {
        let formatted_durations: Vec<String> = [0.416, 12.2, 200.0, 18_120.0, 1e6, f64::INFINITY]
            .into_iter()
            .map(format_duration)
            .collect();
        assert_eq!(
            formatted_durations[..5],
            ["0.42 s", "12 s", "3 min 20 s", "5 h 02 min", "11 days"]
        );
        assert!(formatted_durations[5].ends_with("days"));
    }

    #[test]
    fn stored_points_count_as_done_but_not_in_the_rate() {
        let mut progress = Progress::new(ProgressMode::Plain, 1000, 900);
        progress.start_time = Instant::now() - Duration::from_secs(10);
        let line = progress.format_line(950);
        assert!(line.starts_with("950 of 1000 points (95.0 %), 5.0"), "{line}");
        assert!(
            line.ends_with("10 s left")
                || line.ends_with("9.99 s left")
                || line.ends_with("10.00 s left"),
            "{line}"
        );
        assert_eq!(progress.format_line(900), "900 of 1000 points (90.0 %)");
    }

    #[test]
    fn a_search_counts_units_and_the_rate_of_new_points() {
        let mut progress = Progress::for_search(ProgressMode::Plain, 39, "speeds", 100);
        progress.start_time = Instant::now() - Duration::from_secs(10);
        let line = progress.format_search_line(7, 200);
        assert!(line.starts_with("7 of 39 speeds, 200 points, "), "{line}");
        assert!((9.0..=10.0).contains(&progress.points_per_s(200)), "{line}");
    }
}
