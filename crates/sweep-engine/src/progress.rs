//! Progress of a run: a bar on a terminal, a line now and then elsewhere, or nothing.

use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use crate::config::section::counted;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use sweep_files::panics::lock;

/// What `--progress` said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ProgressMode {
    /// A bar on a terminal; elsewhere a line a minute, which suits the log of a batch job.
    #[default]
    Auto,
    /// A line every five seconds.
    Plain,
    /// Nothing.
    None,
}

/// Something that shows how far the run is, on stderr; any thread may have it do so.
pub struct Progress {
    shown: Mutex<Shown>,
    total: u64,
    /// What the total is of.
    parts: &'static str,
    /// Points that were there at the start: they count as done, but not towards the rate.
    start: u64,
    began: Instant,
}

enum Shown {
    Bar(ProgressBar),
    Lines { every: Duration, next: Instant },
    Nothing,
}

impl Progress {
    /// The progress of a run.
    pub fn new(mode: ProgressMode, total: u64, start: u64) -> Self {
        let progress = Self::of_search(mode, total, "points", start);
        progress.show(start);
        progress
    }

    /// The progress of a search, whose points nobody can count beforehand. It counts parts up to
    /// this total, which are called so, if there are any. `start` points were there at the start.
    pub fn of_search(mode: ProgressMode, total: u64, parts: &'static str, start: u64) -> Self {
        let lines = |seconds| {
            let every = Duration::from_secs(seconds);
            Shown::Lines { every, next: Instant::now() + every }
        };
        let shown = match mode {
            ProgressMode::None => Shown::Nothing,
            ProgressMode::Plain => lines(5),
            ProgressMode::Auto if std::io::stderr().is_terminal() => {
                let target = ProgressDrawTarget::stderr_with_hz(8);
                let bar = ProgressBar::with_draw_target(Some(total), target);
                bar.enable_steady_tick(Duration::from_millis(125));
                Shown::Bar(bar.with_style(style(if total == 0 { POINTS } else { BAR })))
            }
            ProgressMode::Auto => lines(60),
        };
        Self { shown: Mutex::new(shown), total, parts, start, began: Instant::now() }
    }

    /// Shows that `done` points of the total are there.
    pub fn show(&self, done: u64) {
        self.tell(done, || self.line(done));
    }

    /// Shows that so many parts of a search are done, with so many points.
    pub fn show_search(&self, done: u64, points: u64) {
        self.tell(done, || self.search_line(done, points));
    }

    fn search_line(&self, done: u64, points: u64) -> String {
        let rate = per_second(self.rate(points));
        let points = format!("{}, {rate}", counted(points as usize, "point"));
        match (self.total, self.parts) {
            (0, _) => points,
            (total, parts) => format!("{done} of {total} {parts}, {points}"),
        }
    }

    /// Says it beside the bar; or in a line, and then none for a while.
    fn tell(&self, position: u64, text: impl FnOnce() -> String) {
        // A thread that finds another saying it goes on.
        let Ok(mut shown) = self.shown.try_lock() else { return };
        match &mut *shown {
            Shown::Bar(bar) => {
                bar.set_position(position);
                bar.set_message(text());
            }
            Shown::Lines { every, next } if Instant::now() >= *next => {
                // A log that cannot be written to must not end the run.
                let _ = writeln!(std::io::stderr(), "{}", text());
                *next = Instant::now() + *every;
            }
            _ => {}
        }
    }

    /// Points a second of this process.
    fn rate(&self, done: u64) -> f64 {
        done.saturating_sub(self.start) as f64 / self.began.elapsed().as_secs_f64().max(1e-9)
    }

    /// Says that the chunks are being joined.
    pub fn joining(&self) {
        if let Shown::Bar(bar) = &*lock(&self.shown) {
            bar.set_style(style("{spinner} joining {human_len} points"));
            bar.tick();
        }
    }

    /// Clears the bar away.
    pub fn finish(&self) {
        if let Shown::Bar(bar) = &*lock(&self.shown) {
            bar.finish_and_clear();
        }
    }

    fn line(&self, done: u64) -> String {
        let rate = self.rate(done);
        let percent = 100.0 * done as f64 / self.total.max(1) as f64;
        let so_far = format!("{done} of {} points ({percent:.1} %)", self.total);
        // Before the first points are there, a rate of 0 and a time left would be no estimates.
        if rate == 0.0 {
            return so_far;
        }
        let left = duration(self.total.saturating_sub(done) as f64 / rate);
        format!("{so_far}, {}, {left} left", per_second(rate))
    }
}

/// The bar with its numbers.
const BAR: &str = "{wide_bar} {msg}";

/// The bar of a search of unknown length.
const POINTS: &str = "{spinner} {msg}";

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

/// A duration as people say it: `0.42 s`, `12 s`, `3 min 20 s`, `5 h 02 min`.
pub fn duration(seconds: f64) -> String {
    if seconds < 10.0 {
        return format!("{seconds:.2} s");
    }
    // Saturates; nobody waits for 1e19 s.
    let whole = seconds.round() as u64;
    match whole {
        0..60 => format!("{whole} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        3600..172_800 => format!("{} h {:02} min", whole / 3600, whole % 3600 / 60),
        _ => format!("{} days", whole / 86_400),
    }
}

/// A rate with three digits.
pub fn per_second(rate: f64) -> String {
    if rate >= 100.0 { format!("{rate:.0} points/s") } else { format!("{rate:.3} points/s") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_read_as_people_say_them() {
        let said: Vec<String> =
            [0.416, 12.2, 200.0, 18_120.0, 1e6, f64::INFINITY].into_iter().map(duration).collect();
        assert_eq!(said[..5], ["0.42 s", "12 s", "3 min 20 s", "5 h 02 min", "11 days"]);
        assert!(said[5].ends_with("days"));
    }

    #[test]
    fn a_resumed_run_counts_what_is_there_but_not_towards_the_rate() {
        let mut progress = Progress::new(ProgressMode::Plain, 1000, 900);
        progress.began = Instant::now() - Duration::from_secs(10);
        let line = progress.line(950);
        assert!(line.starts_with("950 of 1000 points (95.0 %), 5.0"), "{line}");
        assert!(
            line.ends_with("10 s left")
                || line.ends_with("9.99 s left")
                || line.ends_with("10.00 s left"),
            "{line}"
        );
        assert_eq!(progress.line(900), "900 of 1000 points (90.0 %)");
    }

    #[test]
    fn a_search_counts_its_rows_and_the_rate_of_its_new_points() {
        let mut progress = Progress::of_search(ProgressMode::Plain, 39, "speeds", 100);
        progress.began = Instant::now() - Duration::from_secs(10);
        let line = progress.search_line(7, 200);
        assert!(line.starts_with("7 of 39 speeds, 200 points, "), "{line}");
        assert!((9.0..=10.0).contains(&progress.rate(200)), "{line}");
    }
}
