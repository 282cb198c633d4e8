//! Tests of the commands with the files of the fuzzer's corpora, some of which were findings.

#![cfg(target_os = "linux")]

use std::fs;
use std::path::{Path, PathBuf};

use crate::test_folder::{TestFolder, all_output};

#[path = "../../fuzz/src/targets/folder.rs"]
mod folder;

/// The names of the files whose footers the Parquet library cannot read safely, each with the
/// error message of the command.
const UNREADABLE_FILES_WITH_ERRORS: [(&str, &str); 2] = [
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

/// Returns the paths of a corpus of Parquet files. Asserts that it has the unreadable files.
fn parquet_corpus_paths(name: &str) -> Vec<PathBuf> {
    let paths = corpus_paths(name);
    for (file, _) in UNREADABLE_FILES_WITH_ERRORS {
        assert!(paths.iter().any(|path| path.ends_with(file)), "{name} has no {file}");
    }
    paths
}

/// Asserts that a command on `path` succeeds or ends with an error message.
fn assert_no_panic(test_folder: &TestFolder, words: &[&str], path: &Path) {
    let command_output = test_folder.run_sweep(words);
    let messages = all_output(&command_output);
    let exit_code = command_output.status.code();
    assert!(
        matches!(exit_code, Some(0..=2)),
        "{words:?} {}: {exit_code:?} {messages}",
        path.display()
    );
    assert!(!messages.contains("panicked"), "{words:?} {}: {messages}", path.display());
    for (_, expected) in
        UNREADABLE_FILES_WITH_ERRORS.iter().filter(|(file, _)| path.ends_with(file))
    {
        assert!(messages.contains(expected), "{words:?} {}: {messages}", path.display());
    }
}

#[test]
fn results_of_the_corpus_are_shown_or_give_an_error() {
    let test_folder = TestFolder::new("");
    for path in parquet_corpus_paths("corpus-result") {
        fs::copy(&path, test_folder.path("x.parquet")).expect("the file is there");
        assert_no_panic(&test_folder, &["show", "x.parquet"], &path);
        assert_no_panic(&test_folder, &["plot", "x.parquet", "-o", "x.svg"], &path);
    }
}

#[test]
fn lists_of_the_corpus_load_or_give_an_error() {
    let test_folder = TestFolder::new(
        "spin = { profile = \"ramp\", peak_rpm = 300, ramp_s = 1 }\n\
         time = { end_s = 1 }\n\
         design = { method = \"list\", file = \"list\" }\n",
    );
    for path in parquet_corpus_paths("corpus-list") {
        fs::copy(&path, test_folder.path("list")).expect("the file is there");
        assert_no_panic(&test_folder, &["check", "g.toml"], &path);
    }
}

#[test]
fn run_folders_of_the_corpus_do_not_change_results() {
    for path in corpus_paths("corpus-folder") {
        println!("{}", path.display());
        folder::run(&fs::read(&path).expect("the file is there"));
    }
}
