//! Which job `status` and `merge` mean.

use std::path::{Path, PathBuf};

use super::dwell::SearchArgs;
use crate::dwell::motions;
use crate::plan::Plan;
use crate::speeds::SpeedList;
use crate::stability::dwells;
use sweep_engine::store::Job;

/// Which job `status` and `merge` mean, if it is not a run.
#[derive(Debug, clap::Args)]
pub(super) struct HeldArgs {
    /// Constant spin speeds in rpm of `sweep stability`, or of `sweep dwell`: as there
    #[arg(long, value_name = "SPEEDS", allow_hyphen_values = true)]
    speed: Option<SpeedList>,
    /// The run is of `sweep dwell`, not of `sweep stability`
    #[arg(long, requires = "speed")]
    dwell: bool,
    /// How it looks for motions.
    #[command(flatten)]
    search: SearchArgs,
}

impl HeldArgs {
    /// The job on a plan and its output, the command that goes on with it and what stands behind
    /// its arguments; none if it is a run.
    pub(super) fn job<'a>(
        &self,
        plan: &'a Plan,
        out: Option<&Path>,
    ) -> Option<(Job<'a>, PathBuf, [String; 2])> {
        let speed = self.speed.as_ref()?;
        if self.dwell {
            let search = self.search.search();
            let (job, output) = motions(plan, speed.values(), &search, out);
            let options = format!(" --speed {speed}{}", self.search);
            return Some((job, output, ["dwell".to_owned(), options]));
        }
        let (job, output) = dwells(plan, speed, out);
        Some((job, output, ["stability".to_owned(), format!(" --speed {speed}")]))
    }
}
