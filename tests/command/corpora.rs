//! The fuzzer's files, findings among them, through what reads them.

#![cfg(target_os = "linux")]

use std::fs;
use std::path::{Path, PathBuf};

use crate::home::{Home, said};

#[path = "../../fuzz/src/targets/folder.rs"]
mod folder;

/// Files whose footers the Parquet library must not see, and what is said of each.
const HOSTILE: [(&str, &str); 2] = [
    ("footer_booleans.parquet", "its footer makes no sense"),
    ("footer_deep.parquet", "its columns are nested more than 100 deep"),
];

fn corpus(name: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz").join(name);
    let entries = fs::read_dir(folder).expect("there is a corpus");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths
}

/// The files of a corpus that stands for readers of Parquet.
fn parquet_corpus(name: &str) -> Vec<PathBuf> {
    let paths = corpus(name);
    for (file, _) in HOSTILE {
        assert!(paths.iter().any(|path| path.ends_with(file)), "{name} has no {file}");
    }
    paths
}

/// Runs a command on `path`: it ends by itself, with what it does or with what is wrong.
fn assert_ends(home: &Home, words: &[&str], path: &Path) {
    let output = home.sweep(words);
    let said = said(&output);
    let ended = output.status.code();
    assert!(matches!(ended, Some(0..=2)), "{words:?} {}: {ended:?} {said}", path.display());
    assert!(!said.contains("panicked"), "{words:?} {}: {said}", path.display());
    for (_, expected) in HOSTILE.iter().filter(|(file, _)| path.ends_with(file)) {
        assert!(said.contains(expected), "{words:?} {}: {said}", path.display());
    }
}

#[test]
fn results_of_the_fuzzers_corpus_are_shown_or_explained() {
    let home = Home::new("");
    for path in parquet_corpus("corpus-result") {
        fs::copy(&path, home.path("x.parquet")).expect("the file is there");
        assert_ends(&home, &["show", "x.parquet"], &path);
        assert_ends(&home, &["plot", "x.parquet", "-o", "x.svg"], &path);
    }
}

#[test]
fn lists_of_the_fuzzers_corpus_load_or_are_explained() {
    let home = Home::new(
        "spin = { profile = \"ramp\", peak_rpm = 300, ramp_s = 1 }\n\
         time = { end_s = 1 }\n\
         design = { method = \"list\", file = \"list\" }\n",
    );
    for path in parquet_corpus("corpus-list") {
        fs::copy(&path, home.path("list")).expect("the file is there");
        assert_ends(&home, &["check", "g.toml"], &path);
    }
}

#[test]
fn run_folders_of_the_fuzzers_corpus_change_no_result() {
    for path in corpus("corpus-folder") {
        println!("{}", path.display());
        folder::run(&fs::read(&path).expect("the file is there"));
    }
}
