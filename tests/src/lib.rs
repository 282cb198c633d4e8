//! The command as a user runs it: helpers shared by the tests of this crate.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The `sweep` binary of this build.
///
/// Cargo tells only a package's own tests where its binaries are, so it is built here, in the profile and target
/// folder of the tests; where it is up to date that takes no time. `SWEEP_BINARY` names another one, such as an
/// installed one.
///
/// # Panics
/// If it does not build.
#[must_use]
pub fn sweep_binary() -> &'static Path {
    static BINARY: OnceLock<PathBuf> = OnceLock::new();
    BINARY.get_or_init(|| {
        if let Some(binary) = std::env::var_os("SWEEP_BINARY") {
            return binary.into();
        }
        // The test itself is target/<profile>/deps/<name>.
        let test = std::env::current_exe().expect("a running test has a path");
        let profile_folder = test.ancestors().nth(2).expect("a test lives in target/<profile>/deps");
        let profile = match profile_folder.file_name().and_then(|name| name.to_str()) {
            Some("debug") | None => "dev",
            Some(profile) => profile,
        };
        let target_folder = profile_folder.parent().expect("a profile's folder lives in the target folder");
        let status = Command::new(env!("CARGO"))
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .args(["build", "--quiet", "--package", "sweep", "--bin", "sweep", "--profile", profile])
            .arg("--target-dir")
            .arg(target_folder)
            .status()
            .expect("cargo runs");
        assert!(status.success(), "the binary does not build");
        profile_folder.join(format!("sweep{}", std::env::consts::EXE_SUFFIX))
    })
}
