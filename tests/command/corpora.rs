//! Tests of the commands with the files of the fuzzer's corpora, some of which were findings.

#![cfg(target_os = "linux")]

use std::fs;
use std::path::{Path, PathBuf};

use crate::test_folder::{TestFolder, all_output};

#[path = "../../fuzz/src/targets/folder.rs"]
mod folder;

/// The files whose footers the Parquet library cannot read safely, and the error of each.
const INVALID_FILES: [(&str, &str); 2] = [
    ("footer_booleans.parquet", "its footer makes no sense"),
    ("footer_deep.parquet", "its columns are nested more than 100 deep"),
];

fn corpus_paths(name: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz").join(name);
    let entries = fs::read_dir(folder).expect("there is a corpus");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths
}

/// Returns the files of a corpus of Parquet files.
fn parquet_corpus(name: &str) -> Vec<PathBuf> {
    let paths = corpus_paths(name);
    for (file, _) in INVALID_FILES {
        assert!(paths.iter().any(|path| path.ends_with(file)), "{name} has no {file}");
    }
    paths
}

/// Asserts that a command on `path` succeeds or ends with an error message.
fn assert_ends(test_folder: &TestFolder, words: &[&str], path: &Path) {
    let output = test_folder.sweep(words);
    let messages = all_output(&output);
    let exit_code = output.status.code();
    assert!(
        matches!(exit_code, Some(0..=2)),
        "{words:?} {}: {exit_code:?} {messages}",
        path.display()
    );
    assert!(!messages.contains("panicked"), "{words:?} {}: {messages}", path.display());
    for (_, expected) in INVALID_FILES.iter().filter(|(file, _)| path.ends_with(file)) {
        assert!(messages.contains(expected), "{words:?} {}: {messages}", path.display());
    }
}

#[test]
fn results_of_the_corpus_are_shown_or_give_an_error() {
    let test_folder = TestFolder::new("");
    for path in parquet_corpus("corpus-result") {
        fs::copy(&path, test_folder.path("x.parquet")).expect("the file is there");
        assert_ends(&test_folder, &["show", "x.parquet"], &path);
        assert_ends(&test_folder, &["plot", "x.parquet", "-o", "x.svg"], &path);
    }
}

#[test]
fn lists_of_the_corpus_load_or_give_an_error() {
    let test_folder = TestFolder::new(
        "spin = { profile = \"ramp\", peak_rpm = 300, ramp_s = 1 }\n\
         time = { end_s = 1 }\n\
         design = { method = \"list\", file = \"list\" }\n",
    );
    for path in parquet_corpus("corpus-list") {
        fs::copy(&path, test_folder.path("list")).expect("the file is there");
        assert_ends(&test_folder, &["check", "g.toml"], &path);
    }
}

#[test]
fn run_folders_of_the_corpus_do_not_change_results() {
    for path in corpus_paths("corpus-folder") {
        println!("{}", path.display());
        folder::run(&fs::read(&path).expect("the file is there"));
    }
}
