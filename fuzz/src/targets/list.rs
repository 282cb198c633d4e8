//! Any bytes in place of a list of points, CSV or Parquet: a plan whose points are there, or an
//! explanation.

use std::fs;
use std::path::PathBuf;
use std::sync::OnceLock;

use tempfile::TempDir;

/// Mistakes are shown up to a number, each in a few lines.
const LONGEST_EXPLANATION: usize = 200_000;

/// Tries one input; a panic is a finding.
pub(crate) fn run(bytes: &[u8]) {
    let home = home();
    fs::write(&home.list, bytes).expect("the input is written");
    match sweep::load(&home.grid, &[]) {
        Ok(plan) => {
            assert!(plan.points() >= 1);
            for corner in [0, plan.corners() - 1] {
                let scenario = plan.scenario_at(&plan.corner(corner));
                assert_eq!(scenario.model.machine.violations(), []);
                assert_eq!(scenario.model.spin.violations(), []);
            }
        }
        Err(mistakes) => {
            let text = mistakes.to_string();
            assert!(text.contains("nothing was done"), "{text}");
            assert!(text.len() < LONGEST_EXPLANATION, "an explanation of {} bytes", text.len());
        }
    }
}

struct Home {
    _folder: TempDir,
    list: PathBuf,
    grid: PathBuf,
}

fn home() -> &'static Home {
    static HOME: OnceLock<Home> = OnceLock::new();
    HOME.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |name: &str| folder.path().join(name);
        let grid = "spin = { profile = \"ramp\", peak_rpm = 300, ramp_s = 1 }\n\
            time = { end_s = 1 }\n\
            integrator = { method = \"additive\" }\n\
            design = { method = \"list\", file = \"list\" }\n";
        fs::write(path("g.toml"), grid).expect("the grid is written");
        Home { list: path("list"), grid: path("g.toml"), _folder: folder }
    })
}
