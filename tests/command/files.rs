//! Tests of the files that commands overwrite, and of files that have changed.

#![cfg(target_os = "linux")]

use std::fs;
use std::io::{Read as _, Seek as _, Write as _};
use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

use crate::test_folder::{TestFolder, all_output, grid};

/// The commands that write a file, without its path.
const WRITERS: [&[&str]; 7] = [
    &["run", "g.toml", "--out"],
    &["run", "g.toml", "--fresh", "--out"],
    &["merge", "g.toml", "--out"],
    &["trace", "g.toml", "--at", "unbalance_mass_kg=0.4", "--at", "damping_n_s_per_m=100", "--out"],
    &["modes", "g.toml", "--speed", "0:100:50", "--out"],
    &["boundary", "g.toml", "--lattice", "1", "--tolerance", "50", "--out"],
    &["plot", "map.parquet", "-o"],
];

/// Returns a folder with a grid and its finished map `map.parquet`.
fn fresh_folder() -> TestFolder {
    static MAP: OnceLock<Vec<u8>> = OnceLock::new();
    let test_folder = TestFolder::new(&grid(5, 8));
    let map = MAP.get_or_init(|| {
        let command_output = test_folder.sweep(&["run", "g.toml", "--out", "map.parquet"]);
        assert!(command_output.status.success(), "{}", all_output(&command_output));
        fs::remove_file(test_folder.path("map.run.json")).expect("there is a sidecar");
        fs::read(test_folder.path("map.parquet")).expect("there is a map")
    });
    fs::write(test_folder.path("map.parquet"), map).expect("the map is written");
    test_folder
}

/// Runs a standard program of Linux.
fn run_program(program: &str, words: &[&Path]) {
    let status = Command::new(program).args(words).status().expect("the program starts");
    assert!(status.success(), "{program} {words:?}");
}

/// Asserts that a command does not write an output: exit code 2, the name of the output, the reason
/// and advice. Returns the message.
fn assert_not_written(output: &Output, writer: &[&str], name: &str) -> String {
    let messages = all_output(output);
    assert_eq!(output.status.code(), Some(2), "{writer:?} {name}: {messages}");
    assert!(
        messages.contains("cannot be an output") && messages.contains("= help: "),
        "{writer:?} {name}: {messages}"
    );
    messages
}

#[test]
fn no_command_overwrites_files_of_other_kinds() {
    for writer in WRITERS {
        let test_folder = fresh_folder();
        let ending = if writer[0] == "plot" { ".svg" } else { ".parquet" };
        let with_ending = |name: &str| format!("{name}{ending}");
        let [fifo, folder, link, dangling, hard, mine] =
            ["fifo", "folder", "link", "dangling", "hard", "mine"].map(with_ending);
        run_program("mkfifo", &[&test_folder.path(&fifo)]);
        fs::create_dir(test_folder.path(&folder)).expect("a folder is made");
        fs::write(test_folder.path("thesis.tex"), "mine").expect("a file is written");
        std::os::unix::fs::symlink("thesis.tex", test_folder.path(&link)).expect("a link is made");
        std::os::unix::fs::symlink("nowhere", test_folder.path(&dangling)).expect("a link is made");
        // The link to the grid file has another name, and the other file is of another program.
        fs::hard_link(test_folder.path("g.toml"), test_folder.path(&hard)).expect("a link is made");
        fs::write(test_folder.path(&mine), "mine").expect("a file is written");
        let before = test_folder.names();
        for name in [&fifo, &folder, &link, &dangling, &hard, &mine] {
            for path in [name.clone(), format!("./{name}")] {
                assert_not_written(&test_folder.sweep(&[writer, &[&path]].concat()), writer, &path);
            }
        }
        if ending == ".parquet" {
            for path in ["/dev/null", "/dev/stdout", "g.toml", "new/", "new/.", ".."] {
                assert_not_written(&test_folder.sweep(&[writer, &[path]].concat()), writer, path);
            }
        }
        assert_eq!(test_folder.names(), before, "{writer:?}");
        assert_eq!(fs::read_to_string(test_folder.path("g.toml")).expect("the grid"), grid(5, 8));
        assert_eq!(fs::read_to_string(test_folder.path("thesis.tex")).expect("the thesis"), "mine");
        assert_eq!(fs::read_to_string(test_folder.path(&mine)).expect("the file"), "mine");
    }
}

#[test]
fn a_result_has_no_name_of_another_format() {
    let test_folder = fresh_folder();
    for writer in WRITERS.iter().filter(|writer| writer[0] != "plot") {
        let messages = assert_not_written(
            &test_folder.sweep(&[*writer, &["x.CSV"]].concat()),
            writer,
            "x.CSV",
        );
        assert!(messages.contains("Parquet") && messages.contains("`sweep export`"), "{messages}");
    }
    assert_eq!(test_folder.names(), ["g.toml", "map.parquet"]);
}

#[test]
fn errors_about_files_of_another_kind_name_the_kind() {
    let test_folder = fresh_folder();
    assert!(test_folder.sweep(&["init", "--machine", "m.toml"]).status.success());
    let study = "grid = \"g.toml\"\nseed = 1\n[[parameter]]\nname = \"friction_n\"\n";
    fs::write(test_folder.path("s.toml"), study).expect("a study is written");
    for (file, text) in [("gm.toml", "m.toml"), ("gg.toml", "g.toml")] {
        let grid = grid(5, 8).replace("[spin]", &format!("machine = \"{text}\"\n[spin]"));
        fs::write(test_folder.path(file), grid).expect("a grid is written");
    }
    for (words, kind, help) in [
        (["run", "m.toml"], "a machine file", "a grid file names it: machine = \"m.toml\""),
        (["optimise", "m.toml"], "a machine file", "machine = \"m.toml\""),
        (["check", "s.toml"], "a study file", "`sweep optimise` takes it"),
        (["optimise", "g.toml"], "a grid file", "a study file names it: grid = \"g.toml\""),
        (["check", "gg.toml"], "a grid file", "`sweep run` takes it"),
    ] {
        let run = test_folder.sweep(&words);
        let messages = all_output(&run);
        assert_eq!(run.status.code(), Some(2), "{words:?}: {messages}");
        let has_one_mistake =
            messages.contains("1 mistake,") && messages.contains(&format!("this is {kind}"));
        assert!(has_one_mistake && messages.contains(help), "{words:?}: {messages}");
    }
    assert!(test_folder.sweep(&["check", "gm.toml"]).status.success());
}

#[test]
fn errors_mention_only_options_of_the_command() {
    let test_folder = fresh_folder();
    for words in [["init", "nodir/x.toml"], ["init", "g.toml/x.toml"], ["plot", "no.parquet"]] {
        let messages = all_output(&test_folder.sweep(&words));
        let is_foreign = messages.contains("--out") || messages.contains("chunks");
        assert!(messages.contains("= help: ") && !is_foreign, "{words:?}: {messages}");
    }
}

#[test]
fn a_figure_does_not_overwrite_its_data_by_any_path() {
    let test_folder = fresh_folder();
    fs::rename(test_folder.path("map.parquet"), test_folder.path("map.svg"))
        .expect("the map is renamed");
    let data = fs::read(test_folder.path("map.svg")).expect("the map");
    std::os::unix::fs::symlink("map.svg", test_folder.path("link.svg")).expect("a link is made");
    fs::hard_link(test_folder.path("map.svg"), test_folder.path("hard.svg"))
        .expect("a link is made");
    let absolute = test_folder.path("map.svg");
    let outputs =
        ["map.svg", "./map.svg", absolute.to_str().expect("UTF-8"), "link.svg", "hard.svg"];
    for output in outputs {
        assert_not_written(
            &test_folder.sweep(&["plot", "map.svg", "-o", output]),
            &["plot"],
            output,
        );
        assert!(fs::read(test_folder.path("map.svg")).expect("the map") == data, "{output}");
    }
    assert!(test_folder.sweep(&["plot", "map.svg", "-o", "figure.svg"]).status.success());
}

#[test]
fn every_command_overwrites_its_own_files_and_removes_those_of_killed_processes() {
    for writer in WRITERS.iter().filter(|writer| writer[0] != "merge") {
        let test_folder = fresh_folder();
        let outputs: &[&str] = if writer[0] == "plot" {
            &["out.svg", "out.png", "out.html"]
        } else {
            &["out.parquet"]
        };
        for output in outputs {
            fs::create_dir_all(test_folder.path("new")).expect("a folder is made");
            let path = format!("new/{output}");
            let mut bytes = Vec::new();
            for round in 0..2 {
                // A process that is killed during a write leaves such a file.
                let leftover_path =
                    test_folder.path("new").join(sweep_files::atomic::temporary_name());
                fs::write(&leftover_path, "half").expect("a leftover is written");
                // A run has a folder for such files, which it deletes.
                let is_run = writer[0] == "run";
                if is_run {
                    fs::remove_file(&leftover_path).expect("the leftover goes");
                }
                let command_output = test_folder.sweep(&[*writer, &[&path]].concat());
                assert!(
                    command_output.status.success(),
                    "{writer:?} {output} round {round}: {}",
                    all_output(&command_output)
                );
                assert!(!leftover_path.exists(), "{writer:?} {output}");
                let written = fs::read(test_folder.path(&path)).expect("there is an output");
                assert!(round == 0 || written == bytes, "{writer:?} {output}: other bytes");
                bytes = written;
            }
        }
        let names: Vec<_> = fs::read_dir(test_folder.path("new")).expect("the folder").collect();
        let sidecars = usize::from(writer[0] == "run");
        assert_eq!(names.len(), outputs.len() + sidecars, "{writer:?}: {names:?}");
    }
}

#[test]
fn a_file_size_limit_does_not_damage_the_old_file() {
    for (writer, output) in
        [(WRITERS[3], "x.parquet"), (WRITERS[4], "x.parquet"), (WRITERS[6], "x.svg")]
    {
        let test_folder = fresh_folder();
        let run_limited = |output: &str| {
            let limit = ["sh", "-c", "ulimit -f 1; exec \"$@\"", "sh"];
            test_folder.under(&limit).args(writer).arg(output).output().expect("sh starts")
        };
        let run = run_limited(output);
        assert_eq!(run.status.code(), Some(1), "{writer:?}: {}", all_output(&run));
        assert!(
            all_output(&run).contains("a file-size limit was hit"),
            "{writer:?}: {}",
            all_output(&run)
        );
        assert_eq!(test_folder.names(), ["g.toml", "map.parquet"], "{writer:?}");

        let whole_output = test_folder.sweep(&[writer, &[output]].concat());
        assert!(whole_output.status.success(), "{}", all_output(&whole_output));
        let before = fs::read(test_folder.path(output)).expect("there is an output");
        assert_eq!(run_limited(output).status.code(), Some(1));
        assert!(
            fs::read(test_folder.path(output)).expect("there is an output") == before,
            "{writer:?}"
        );
    }
}

#[test]
fn traces_beside_a_result_have_its_name() {
    let test_folder = fresh_folder();
    for (output, traces) in
        [("v1.0", "v1.0.traces"), ("v1.5", "v1.5.traces"), ("x.parquet", "x.traces")]
    {
        let run = test_folder.sweep(&["run", "g.toml", "--keep-traces", "--out", output]);
        assert!(run.status.success(), "{}", all_output(&run));
        assert_eq!(
            fs::read_dir(test_folder.path(traces)).expect("there are traces").count(),
            40,
            "{output}"
        );
    }
}

#[test]
fn kept_traces_are_the_trajectories_of_their_rows() {
    let test_folder = fresh_folder();
    let fast = "[spin]\nprofile = \"ramp\"\npeak_rpm = 300\nramp_s = 2\n[time]\nend_s = 2\n\
                [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.2, 0.3]\n";
    fs::write(test_folder.path("fast.toml"), fast).expect("the grid is written");
    let run = test_folder.sweep(&["run", "fast.toml", "--keep-traces", "--out", "x.parquet"]);
    assert!(run.status.success(), "{}", all_output(&run));
    assert!(all_output(&run).contains("rows by method: 3 capped_1"), "{}", all_output(&run));
    for point in 0..3 {
        let bytes = fs::read(test_folder.path(&format!("x.traces/point-{point}.parquet")));
        let bytes = bytes.expect("the point has a trace");
        assert!(String::from_utf8_lossy(&bytes).contains(r#""row":"capped_1""#), "point {point}");
    }
}

/// Calls a function while a bit of a file is flipped.
fn with_flipped_bit<T>(path: &Path, byte_offset: u64, bit: u8, read: impl FnOnce() -> T) -> T {
    let flip = || {
        let mut file =
            fs::OpenOptions::new().read(true).write(true).open(path).expect("the file opens");
        let mut byte = [0];
        file.seek(std::io::SeekFrom::Start(byte_offset)).expect("a place in the file");
        file.read_exact(&mut byte).expect("a byte is read");
        file.seek(std::io::SeekFrom::Start(byte_offset)).expect("a place in the file");
        file.write_all(&[byte[0] ^ (1 << bit)]).expect("a byte is written");
    };
    flip();
    let result = read();
    flip();
    result
}

#[test]
fn every_command_detects_a_flipped_bit_in_its_input() {
    let test_folder = fresh_folder();
    let map = test_folder.path("map.parquet");
    let map_bytes = fs::read(&map).expect("the map");
    for writer in [WRITERS[3], WRITERS[4], WRITERS[5]] {
        let command_output =
            test_folder.sweep(&[writer, &[&format!("{}.parquet", writer[0])]].concat());
        assert!(command_output.status.success(), "{}", all_output(&command_output));
    }
    let readers: [&[&str]; 9] = [
        &["run", "g.toml", "--out", "map.parquet"],
        &["merge", "g.toml", "--out", "map.parquet"],
        &["status", "g.toml", "--out", "map.parquet"],
        &["show", "map.parquet"],
        &["plot", "map.parquet", "-o", "map.svg"],
        &["show", "trace.parquet"],
        &["plot", "trace.parquet", "-o", "trace.html"],
        &["plot", "modes.parquet", "-o", "modes.png"],
        &["show", "boundary.parquet"],
    ];
    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    for reader in readers {
        let path = reader.iter().find(|word| word.ends_with(".parquet")).expect("a file to read");
        let path = test_folder.path(path);
        let length = fs::metadata(&path).expect("the file is there").len();
        for _ in 0..12 {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            let byte_offset = random % length;
            let bit = (random >> 40) as u8 % 8;
            let result = with_flipped_bit(&path, byte_offset, bit, || test_folder.sweep(reader));
            let text = all_output(&result);
            assert!(
                matches!(result.status.code(), Some(1 | 2)),
                "{reader:?}, bit {bit} of {byte_offset}: {text}"
            );
            assert!(text.contains("parquet") && !text.contains("panicked"), "{reader:?}: {text}");
        }
    }
    assert!(fs::read(&map).expect("the map") == map_bytes);
    for picture in ["map.svg", "trace.html", "modes.png"] {
        assert!(!test_folder.path(picture).exists(), "{picture}");
    }
}

#[test]
fn status_reports_a_file_that_is_no_result() {
    let test_folder = fresh_folder();
    fs::write(test_folder.path("junk.parquet"), "junk").expect("a file is written");
    let status = test_folder.sweep(&["status", "g.toml", "--out", "junk.parquet"]);
    assert_not_written(&status, &["status"], "junk.parquet");
    let status = test_folder.sweep(&["status", "g.toml", "--out", "nothing.parquet"]);
    assert!(
        status.status.success() && all_output(&status).contains("not started"),
        "{}",
        all_output(&status)
    );
    let status =
        test_folder.sweep(&["status", "g.toml", "--set", "tub_mass_kg=20", "--out", "map.parquet"]);
    assert_eq!(status.status.code(), Some(2), "{}", all_output(&status));
    assert!(all_output(&status).contains("tub"), "{}", all_output(&status));
}

#[test]
fn special_files_are_not_read() {
    let test_folder = fresh_folder();
    run_program("mkfifo", &[&test_folder.path("fifo.parquet")]);
    for words in
        [&["show", "fifo.parquet"] as &[&str], &["plot", "fifo.parquet"], &["show", "/dev/zero"]]
    {
        let run = test_folder.sweep(words);
        assert_eq!(run.status.code(), Some(2), "{}", all_output(&run));
        assert!(all_output(&run).contains("not a regular file"), "{words:?}: {}", all_output(&run));
    }
}

#[test]
fn escape_sequences_in_files_do_not_reach_the_terminal() {
    let test_folder = fresh_folder();
    let hostile = "evil\u{1b}]0;title\u{7}\u{9b}2J\u{202e}";
    let evil = grid(5, 8).replace("\"short\"", &format!("{hostile:?}")).replace("tub_yaw", hostile);
    fs::write(test_folder.path("evil.toml"), evil).expect("a grid is written");
    let raw = grid(5, 8).replace("name = ", &format!("# {hostile}\n{hostile} = "));
    fs::write(test_folder.path("raw.toml"), raw).expect("a grid is written");
    let partial = test_folder.path("x.parquet.partial");
    fs::create_dir(&partial).expect("a folder is made");
    let plan = format!(
        r#"{{ "format": 2, "version": {version}, "numerics": 1, "plan_hash": "", "points": 1,
              "chunk_points": 8, "plan": {{}} }}"#,
        version = serde_json::to_string(hostile).expect("a string")
    );
    fs::write(partial.join("plan.json"), plan.replace("\"format\": 2", "\"format\": 7"))
        .expect("a plan");
    for words in [
        &["check", "evil.toml"] as &[&str],
        &["check", "raw.toml"],
        &["check", "raw.toml", "--set", hostile],
        &["status", "g.toml", "--out", "x.parquet"],
        &["run", "g.toml", "--out", "x.parquet"],
        &["show", hostile],
        &["run", "g.toml", "--out", &format!("{hostile}/x.parquet/")],
    ] {
        let run = test_folder.sweep(words);
        assert_ne!(run.status.code(), Some(0), "{words:?}");
        let text = all_output(&run) + &String::from_utf8_lossy(&run.stdout);
        assert!(text.contains("evil"), "{words:?}: {text}");
        let is_bad = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
        assert!(!text.contains(is_bad), "{words:?}: {text:?}");
    }
}
