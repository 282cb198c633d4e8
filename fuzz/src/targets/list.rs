//! Fuzz target of lists of points, as CSV or Parquet. An input gives a valid plan or a list of
//! mistakes.

use std::fs;
use std::path::PathBuf;
use std::sync::OnceLock;

use tempfile::TempDir;

/// The greatest length of a list of mistakes (bytes). Basis: a list shows a limited number of
/// mistakes, each in a few lines. Doubling it finds fewer lists that are too long.
const MAX_LIST_LEN: usize = 200_000;

/// Runs the target with an input; a panic is a finding.
pub(crate) fn run(bytes: &[u8]) {
    let files = list_files();
    fs::write(&files.list, bytes).expect("the input is written");
    match sweep::load(&files.grid, &[]) {
        Ok(plan) => {
            assert!(plan.points() >= 1);
            for corner in [0, plan.corner_count() - 1] {
                let input = sweep::point_input(&plan, &plan.corner_values(corner));
                assert_eq!(input.machine.violations(), []);
                assert_eq!(input.spin.violations(), []);
            }
        }
        Err(mistakes) => {
            let text = mistakes.to_string();
            assert!(text.contains("nothing was done"), "{text}");
            assert!(text.len() < MAX_LIST_LEN, "a list of mistakes of {} bytes", text.len());
        }
    }
}

/// A grid file and the list of points that it names.
struct ListFiles {
    _folder: TempDir,
    list: PathBuf,
    grid: PathBuf,
}

fn list_files() -> &'static ListFiles {
    /// The files that all inputs share.
    static FILES: OnceLock<ListFiles> = OnceLock::new();
    FILES.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |name: &str| folder.path().join(name);
        let grid = "spin = { profile = \"ramp\", peak_rpm = 300, ramp_s = 1 }\n\
            time = { end_s = 1 }\n\
            integrator = { method = \"additive\" }\n\
            design = { method = \"list\", file = \"list\" }\n";
        fs::write(path("g.toml"), grid).expect("the grid is written");
        ListFiles { list: path("list"), grid: path("g.toml"), _folder: folder }
    })
}
