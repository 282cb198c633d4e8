//! Files that a command may write over, and its answers to files that have changed.

#![cfg(target_os = "linux")]

use std::fs;
use std::io::{Read as _, Seek as _, Write as _};
use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

use crate::home::{Home, grid, said};

/// Every command that writes a file of its user's choice, up to the path.
const WRITERS: [&[&str]; 7] = [
    &["run", "g.toml", "--out"],
    &["run", "g.toml", "--fresh", "--out"],
    &["merge", "g.toml", "--out"],
    &["trace", "g.toml", "--at", "unbalance_mass_kg=0.4", "--at", "damping_n_s_per_m=100", "--out"],
    &["modes", "g.toml", "--speed", "0:100:50", "--out"],
    &["boundary", "g.toml", "--lattice", "1", "--tolerance", "50", "--out"],
    &["plot", "map.parquet", "-o"],
];

/// A folder with the grid, its finished map `map.parquet`, and nothing else.
fn fresh_home() -> Home {
    static MAP: OnceLock<Vec<u8>> = OnceLock::new();
    let home = Home::new(&grid(5, 8));
    let map = MAP.get_or_init(|| {
        let done = home.sweep(&["run", "g.toml", "--out", "map.parquet"]);
        assert!(done.status.success(), "{}", said(&done));
        fs::remove_file(home.path("map.run.json")).expect("there is a sidecar");
        fs::read(home.path("map.parquet")).expect("there is a map")
    });
    fs::write(home.path("map.parquet"), map).expect("the map is written");
    home
}

/// Runs a program that is on every Linux.
fn run(program: &str, words: &[&Path]) {
    let status = Command::new(program).args(words).status().expect("the program starts");
    assert!(status.success(), "{program} {words:?}");
}

/// The refusal of an output: exit code 2, its name, why, what to do.
fn assert_refused(output: &Output, writer: &[&str], name: &str) -> String {
    let said = said(output);
    assert_eq!(output.status.code(), Some(2), "{writer:?} {name}: {said}");
    assert!(
        said.contains("cannot be an output") && said.contains("= help: "),
        "{writer:?} {name}: {said}"
    );
    said
}

#[test]
fn no_command_writes_over_what_is_not_its_own() {
    for writer in WRITERS {
        let home = fresh_home();
        let ending = if writer[0] == "plot" { ".svg" } else { ".parquet" };
        let named = |name: &str| format!("{name}{ending}");
        let [fifo, folder, link, dangling, hard, mine] =
            ["fifo", "folder", "link", "dangling", "hard", "mine"].map(named);
        run("mkfifo", &[&home.path(&fifo)]);
        fs::create_dir(home.path(&folder)).expect("a folder is made");
        fs::write(home.path("thesis.tex"), "mine").expect("a file is written");
        std::os::unix::fs::symlink("thesis.tex", home.path(&link)).expect("a link is made");
        std::os::unix::fs::symlink("nowhere", home.path(&dangling)).expect("a link is made");
        // The grid file under another name, and a file of somebody's.
        fs::hard_link(home.path("g.toml"), home.path(&hard)).expect("a link is made");
        fs::write(home.path(&mine), "mine").expect("a file is written");
        let before = home.names();
        for name in [&fifo, &folder, &link, &dangling, &hard, &mine] {
            for path in [name.clone(), format!("./{name}")] {
                assert_refused(&home.sweep(&[writer, &[&path]].concat()), writer, &path);
            }
        }
        if ending == ".parquet" {
            for path in ["/dev/null", "/dev/stdout", "g.toml", "new/", "new/.", ".."] {
                assert_refused(&home.sweep(&[writer, &[path]].concat()), writer, path);
            }
        }
        assert_eq!(home.names(), before, "{writer:?}");
        assert_eq!(fs::read_to_string(home.path("g.toml")).expect("the grid"), grid(5, 8));
        assert_eq!(fs::read_to_string(home.path("thesis.tex")).expect("the thesis"), "mine");
        assert_eq!(fs::read_to_string(home.path(&mine)).expect("the file"), "mine");
    }
}

#[test]
fn a_result_has_no_name_of_another_format() {
    let home = fresh_home();
    for writer in WRITERS.iter().filter(|writer| writer[0] != "plot") {
        let said = assert_refused(&home.sweep(&[*writer, &["x.CSV"]].concat()), writer, "x.CSV");
        assert!(said.contains("Parquet") && said.contains("`sweep export`"), "{said}");
    }
    assert_eq!(home.names(), ["g.toml", "map.parquet"]);
}

#[test]
fn a_file_of_another_kind_is_said_to_be_one_and_nothing_else() {
    let home = fresh_home();
    assert!(home.sweep(&["init", "--machine", "m.toml"]).status.success());
    let study = "grid = \"g.toml\"\nseed = 1\n[[parameter]]\nname = \"friction_n\"\n";
    fs::write(home.path("s.toml"), study).expect("a study is written");
    for (file, text) in [("gm.toml", "m.toml"), ("gg.toml", "g.toml")] {
        let grid = grid(5, 8).replace("[spin]", &format!("machine = \"{text}\"\n[spin]"));
        fs::write(home.path(file), grid).expect("a grid is written");
    }
    for (words, kind, help) in [
        (["run", "m.toml"], "a machine file", "a grid file names it: machine = \"m.toml\""),
        (["optimise", "m.toml"], "a machine file", "machine = \"m.toml\""),
        (["check", "s.toml"], "a study file", "`sweep optimise` takes it"),
        (["optimise", "g.toml"], "a grid file", "a study file names it: grid = \"g.toml\""),
        (["check", "gg.toml"], "a grid file", "`sweep run` takes it"),
    ] {
        let run = home.sweep(&words);
        let said = said(&run);
        assert_eq!(run.status.code(), Some(2), "{words:?}: {said}");
        let one = said.contains("1 mistake,") && said.contains(&format!("this is {kind}"));
        assert!(one && said.contains(help), "{words:?}: {said}");
    }
    assert!(home.sweep(&["check", "gm.toml"]).status.success());
}

#[test]
fn help_is_of_what_the_command_has() {
    let home = fresh_home();
    for words in [["init", "nodir/x.toml"], ["init", "g.toml/x.toml"], ["plot", "no.parquet"]] {
        let said = said(&home.sweep(&words));
        let is_foreign = said.contains("--out") || said.contains("chunks");
        assert!(said.contains("= help: ") && !is_foreign, "{words:?}: {said}");
    }
}

#[test]
fn a_figure_does_not_overwrite_its_data_by_any_path() {
    let home = fresh_home();
    fs::rename(home.path("map.parquet"), home.path("map.svg")).expect("the map is renamed");
    let data = fs::read(home.path("map.svg")).expect("the map");
    std::os::unix::fs::symlink("map.svg", home.path("link.svg")).expect("a link is made");
    fs::hard_link(home.path("map.svg"), home.path("hard.svg")).expect("a link is made");
    let absolute = home.path("map.svg");
    let outputs =
        ["map.svg", "./map.svg", absolute.to_str().expect("UTF-8"), "link.svg", "hard.svg"];
    for output in outputs {
        assert_refused(&home.sweep(&["plot", "map.svg", "-o", output]), &["plot"], output);
        assert!(fs::read(home.path("map.svg")).expect("the map") == data, "{output}");
    }
    assert!(home.sweep(&["plot", "map.svg", "-o", "figure.svg"]).status.success());
}

#[test]
fn every_command_writes_over_its_own_and_clears_up_after_killed_processes() {
    for writer in WRITERS.iter().filter(|writer| writer[0] != "merge") {
        let home = fresh_home();
        let outputs: &[&str] = if writer[0] == "plot" {
            &["out.svg", "out.png", "out.html"]
        } else {
            &["out.parquet"]
        };
        for output in outputs {
            fs::create_dir_all(home.path("new")).expect("a folder is made");
            let path = format!("new/{output}");
            let mut bytes = Vec::new();
            for round in 0..2 {
                // A process that is killed while it writes leaves such a file.
                let left = home.path("new").join(sweep_files::atomic::temporary_name());
                fs::write(&left, "half").expect("a leftover is written");
                // A run has a folder of its own for such files, and clears that.
                let is_run = writer[0] == "run";
                if is_run {
                    fs::remove_file(&left).expect("the leftover goes");
                }
                let done = home.sweep(&[*writer, &[&path]].concat());
                assert!(
                    done.status.success(),
                    "{writer:?} {output} round {round}: {}",
                    said(&done)
                );
                assert!(!left.exists(), "{writer:?} {output}");
                let written = fs::read(home.path(&path)).expect("there is an output");
                assert!(round == 0 || written == bytes, "{writer:?} {output}: other bytes");
                bytes = written;
            }
        }
        let names: Vec<_> = fs::read_dir(home.path("new")).expect("the folder").collect();
        let sidecars = usize::from(writer[0] == "run");
        assert_eq!(names.len(), outputs.len() + sidecars, "{writer:?}: {names:?}");
    }
}

#[test]
fn a_file_size_limit_leaves_the_old_file() {
    for (writer, output) in
        [(WRITERS[3], "x.parquet"), (WRITERS[4], "x.parquet"), (WRITERS[6], "x.svg")]
    {
        let home = fresh_home();
        let limited = |output: &str| {
            let limit = ["sh", "-c", "ulimit -f 1; exec \"$@\"", "sh"];
            home.under(&limit).args(writer).arg(output).output().expect("sh starts")
        };
        let run = limited(output);
        assert_eq!(run.status.code(), Some(1), "{writer:?}: {}", said(&run));
        assert!(said(&run).contains("a file-size limit was hit"), "{writer:?}: {}", said(&run));
        assert_eq!(home.names(), ["g.toml", "map.parquet"], "{writer:?}");

        let whole = home.sweep(&[writer, &[output]].concat());
        assert!(whole.status.success(), "{}", said(&whole));
        let before = fs::read(home.path(output)).expect("there is an output");
        assert_eq!(limited(output).status.code(), Some(1));
        assert!(fs::read(home.path(output)).expect("there is an output") == before, "{writer:?}");
    }
}

#[test]
fn traces_beside_a_result_are_named_as_it_is() {
    let home = fresh_home();
    for (output, traces) in
        [("v1.0", "v1.0.traces"), ("v1.5", "v1.5.traces"), ("x.parquet", "x.traces")]
    {
        let run = home.sweep(&["run", "g.toml", "--keep-traces", "--out", output]);
        assert!(run.status.success(), "{}", said(&run));
        assert_eq!(
            fs::read_dir(home.path(traces)).expect("there are traces").count(),
            40,
            "{output}"
        );
    }
}

#[test]
fn kept_traces_are_the_trajectories_of_their_rows() {
    let home = fresh_home();
    let fast = "[spin]\nprofile = \"ramp\"\npeak_rpm = 300\nramp_s = 2\n[time]\nend_s = 2\n\
                [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.2, 0.3]\n";
    fs::write(home.path("fast.toml"), fast).expect("the grid is written");
    let run = home.sweep(&["run", "fast.toml", "--keep-traces", "--out", "x.parquet"]);
    assert!(run.status.success(), "{}", said(&run));
    assert!(said(&run).contains("rows by method: 3 capped_1"), "{}", said(&run));
    for point in 0..3 {
        let bytes = fs::read(home.path(&format!("x.traces/point-{point}.parquet")));
        let bytes = bytes.expect("the point has a trace");
        assert!(String::from_utf8_lossy(&bytes).contains(r#""row":"capped_1""#), "point {point}");
    }
}

/// A bit of this file is flipped, read by `look`, and flipped back.
fn with_flipped_bit<T>(path: &Path, at: u64, bit: u8, look: impl FnOnce() -> T) -> T {
    let flip = || {
        let mut file =
            fs::OpenOptions::new().read(true).write(true).open(path).expect("the file opens");
        let mut byte = [0];
        file.seek(std::io::SeekFrom::Start(at)).expect("a place in the file");
        file.read_exact(&mut byte).expect("a byte is read");
        file.seek(std::io::SeekFrom::Start(at)).expect("a place in the file");
        file.write_all(&[byte[0] ^ (1 << bit)]).expect("a byte is written");
    };
    flip();
    let seen = look();
    flip();
    seen
}

#[test]
fn every_command_that_reads_a_file_sees_a_flipped_bit() {
    let home = fresh_home();
    let map = home.path("map.parquet");
    let whole = fs::read(&map).expect("the map");
    for writer in [WRITERS[3], WRITERS[4], WRITERS[5]] {
        let done = home.sweep(&[writer, &[&format!("{}.parquet", writer[0])]].concat());
        assert!(done.status.success(), "{}", said(&done));
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
        let path = home.path(path);
        let length = fs::metadata(&path).expect("the file is there").len();
        for _ in 0..12 {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            let at = random % length;
            let bit = (random >> 40) as u8 % 8;
            let seen = with_flipped_bit(&path, at, bit, || home.sweep(reader));
            let text = said(&seen);
            assert!(
                matches!(seen.status.code(), Some(1 | 2)),
                "{reader:?}, bit {bit} of {at}: {text}"
            );
            assert!(text.contains("parquet") && !text.contains("panicked"), "{reader:?}: {text}");
        }
    }
    assert!(fs::read(&map).expect("the map") == whole);
    for picture in ["map.svg", "trace.html", "modes.png"] {
        assert!(!home.path(picture).exists(), "{picture}");
    }
}

#[test]
fn junk_at_an_output_is_not_a_run_that_has_not_started() {
    let home = fresh_home();
    fs::write(home.path("junk.parquet"), "junk").expect("a file is written");
    let status = home.sweep(&["status", "g.toml", "--out", "junk.parquet"]);
    assert_refused(&status, &["status"], "junk.parquet");
    let status = home.sweep(&["status", "g.toml", "--out", "nothing.parquet"]);
    assert!(status.status.success() && said(&status).contains("not started"), "{}", said(&status));
    let status =
        home.sweep(&["status", "g.toml", "--set", "tub_mass_kg=20", "--out", "map.parquet"]);
    assert_eq!(status.status.code(), Some(2), "{}", said(&status));
    assert!(said(&status).contains("tub"), "{}", said(&status));
}

#[test]
fn files_that_are_not_regular_are_not_read() {
    let home = fresh_home();
    run("mkfifo", &[&home.path("fifo.parquet")]);
    for words in
        [&["show", "fifo.parquet"] as &[&str], &["plot", "fifo.parquet"], &["show", "/dev/zero"]]
    {
        let run = home.sweep(words);
        assert_eq!(run.status.code(), Some(2), "{}", said(&run));
        assert!(said(&run).contains("not a regular file"), "{words:?}: {}", said(&run));
    }
}

#[test]
fn nothing_a_file_says_reaches_the_terminal_as_an_escape() {
    let home = fresh_home();
    let hostile = "evil\u{1b}]0;title\u{7}\u{9b}2J\u{202e}";
    let evil = grid(5, 8).replace("\"short\"", &format!("{hostile:?}")).replace("tub_yaw", hostile);
    fs::write(home.path("evil.toml"), evil).expect("a grid is written");
    let raw = grid(5, 8).replace("name = ", &format!("# {hostile}\n{hostile} = "));
    fs::write(home.path("raw.toml"), raw).expect("a grid is written");
    let partial = home.path("x.parquet.partial");
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
        let run = home.sweep(words);
        assert_ne!(run.status.code(), Some(0), "{words:?}");
        let text = said(&run) + &String::from_utf8_lossy(&run.stdout);
        assert!(text.contains("evil"), "{words:?}: {text}");
        let is_bad = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
        assert!(!text.contains(is_bad), "{words:?}: {text:?}");
    }
}
