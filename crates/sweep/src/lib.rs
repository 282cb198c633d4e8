//! The sweep: from a grid file to a result file. The command `sweep` is all of this with arguments; here it is for programs.
//!
//! * [`config`] reads a grid file into a [`plan::Plan`], or says every mistake in it. [`design`] places points that are no grid.
//! * [`engine`] takes points of a plan through both models of `washer_model`, and returns an [`outcome::Outcome`] each; [`verdict`]
//!   makes ratios and a verdict of it. [`estimate`] says beforehand what a run will take.
//! * [`run`] does a plan's points on all cores and keeps them as they come; [`store`] is what
//!   stands on disk meanwhile, and the result file, written and read; [`files`] is the rule by
//!   which any file is written or read. [`identity`] says which builds write the same bytes.
//! * [`boundary`] traces the curve where the ratio is at its limit, [`trace`] writes one point's time histories, [`plot`] draws any file
//!   of the others.
//! * [`cli`] and [`commands`] are the command line, with [`progress`], [`interrupt`] and [`exit`] for its manners.
//!
//! # Example
//!
//! One point of the grid of the paper's Fig. 12, in its first two seconds.
//!
//! ```
//! use std::path::Path;
//! use sweep::{config, engine::ModelEngine, verdict::Verdict};
//!
//! let grid = Path::new("../../sweeps/fig12_reference.toml");
//! let plan = config::load(grid, &[])?;
//! assert_eq!((plan.axes.len(), plan.points()), (2, 39 * 33));
//!
//! let plan = sweep::plan::Plan { end_s: 2.0, window_s: [1.0, 2.0], ..plan };
//! let outcome = &ModelEngine::new(&plan)?.evaluate_at(&[vec![0.4, 100.0]])[0];
//! let verdict = Verdict::new(outcome, plan.reliability.channels.len(), plan.reliability.ratio_limit);
//! assert_eq!(verdict.reliable, Some(true));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod boundary;
mod cells;
pub mod cli;
pub mod commands;
pub mod config;
pub mod design;
pub mod engine;
pub mod estimate;
pub mod exit;
pub mod files;
pub mod identity;
pub mod interrupt;
pub mod measures;
mod nearest;
pub mod outcome;
mod panics;
pub mod plan;
pub mod plot;
pub mod progress;
pub mod run;
pub mod store;
mod table;
pub mod threads;
pub mod trace;
pub mod verdict;
