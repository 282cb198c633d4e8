//! Tests of the files that commands overwrite, and of files that have changed.

#![cfg(target_os = "linux")]

use std::fs;
use std::io::{Read as _, Seek as _, Write as _};
use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

use crate::test_folder::{TestFolder, all_output, grid_text};

/// The command lines that write a file, without the path of that file.
const WRITING_COMMANDS: [&[&str]; 7] = [
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
    static MAP_BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    let test_folder = TestFolder::new(&grid_text(5, 8));
    let map_bytes = MAP_BYTES.get_or_init(|| {
        let command_output = test_folder.run_sweep(&["run", "g.toml", "--out", "map.parquet"]);
        assert!(command_output.status.success(), "{}", all_output(&command_output));
        fs::remove_file(test_folder.path("map.run.json")).expect("there is a sidecar");
        fs::read(test_folder.path("map.parquet")).expect("there is a map")
    });
    fs::write(test_folder.path("map.parquet"), map_bytes).expect("the map is written");
    test_folder
}

/// Runs a standard program of Linux.
fn run_standard_program(program: &str, arguments: &[&Path]) {
    let status = Command::new(program).args(arguments).status().expect("the program starts");
    assert!(status.success(), "{program} {arguments:?}");
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
    for writer in WRITING_COMMANDS {
        let test_folder = fresh_folder();
        let extension = if writer[0] == "plot" { ".svg" } else { ".parquet" };
        let with_extension = |name: &str| format!("{name}{extension}");
        let [fifo, folder_name, other_link, dangling_link, grid_link, foreign_file] =
            ["fifo", "folder", "link", "dangling", "hard", "mine"].map(with_extension);
        run_standard_program("mkfifo", &[&test_folder.path(&fifo)]);
        fs::create_dir(test_folder.path(&folder_name)).expect("a folder is made");
        fs::write(test_folder.path("thesis.tex"), "mine").expect("a file is written");
        std::os::unix::fs::symlink("thesis.tex", test_folder.path(&other_link))
            .expect("a link is made");
        std::os::unix::fs::symlink("nowhere", test_folder.path(&dangling_link))
            .expect("a link is made");
        // The hard link has another name than the grid file, and another program wrote
        // `foreign_file`.
        fs::hard_link(test_folder.path("g.toml"), test_folder.path(&grid_link))
            .expect("a link is made");
        fs::write(test_folder.path(&foreign_file), "mine").expect("a file is written");
        let names_before = test_folder.sorted_file_names();
        for name in [&fifo, &folder_name, &other_link, &dangling_link, &grid_link, &foreign_file] {
            for path in [name.clone(), format!("./{name}")] {
                assert_not_written(
                    &test_folder.run_sweep(&[writer, &[&path]].concat()),
                    writer,
                    &path,
                );
            }
        }
        if extension == ".parquet" {
            for path in ["/dev/null", "/dev/stdout", "g.toml", "new/", "new/.", ".."] {
                assert_not_written(
                    &test_folder.run_sweep(&[writer, &[path]].concat()),
                    writer,
                    path,
                );
            }
        }
        assert_eq!(test_folder.sorted_file_names(), names_before, "{writer:?}");
        assert_eq!(
            fs::read_to_string(test_folder.path("g.toml")).expect("the grid"),
            grid_text(5, 8)
        );
        assert_eq!(fs::read_to_string(test_folder.path("thesis.tex")).expect("the thesis"), "mine");
        assert_eq!(fs::read_to_string(test_folder.path(&foreign_file)).expect("the file"), "mine");
    }
}

#[test]
fn a_result_has_no_name_of_another_format() {
    let test_folder = fresh_folder();
    for writer in WRITING_COMMANDS.iter().filter(|writer| writer[0] != "plot") {
        let messages = assert_not_written(
            &test_folder.run_sweep(&[*writer, &["x.CSV"]].concat()),
            writer,
            "x.CSV",
        );
        assert!(messages.contains("Parquet") && messages.contains("`sweep export`"), "{messages}");
    }
    assert_eq!(test_folder.sorted_file_names(), ["g.toml", "map.parquet"]);
}

#[test]
fn errors_about_files_of_another_kind_name_the_kind() {
    let test_folder = fresh_folder();
    assert!(test_folder.run_sweep(&["init", "--machine", "m.toml"]).status.success());
    let study = "grid = \"g.toml\"\nseed = 1\n[[parameter]]\nname = \"friction_n\"\n";
    fs::write(test_folder.path("s.toml"), study).expect("a study is written");
    for (file, named_file) in [("gm.toml", "m.toml"), ("gg.toml", "g.toml")] {
        let grid =
            grid_text(5, 8).replace("[spin]", &format!("machine = \"{named_file}\"\n[spin]"));
        fs::write(test_folder.path(file), grid).expect("a grid is written");
    }
    for (words, kind, help_text) in [
        (["run", "m.toml"], "a machine file", "a grid file names it: machine = \"m.toml\""),
        (["optimise", "m.toml"], "a machine file", "machine = \"m.toml\""),
        (["check", "s.toml"], "a study file", "`sweep optimise` takes it"),
        (["optimise", "g.toml"], "a grid file", "a study file names it: grid = \"g.toml\""),
        (["check", "gg.toml"], "a grid file", "`sweep run` takes it"),
    ] {
        let run_output = test_folder.run_sweep(&words);
        let messages = all_output(&run_output);
        assert_eq!(run_output.status.code(), Some(2), "{words:?}: {messages}");
        let has_one_mistake =
            messages.contains("1 mistake,") && messages.contains(&format!("this is {kind}"));
        assert!(has_one_mistake && messages.contains(help_text), "{words:?}: {messages}");
    }
    assert!(test_folder.run_sweep(&["check", "gm.toml"]).status.success());
}

#[test]
fn errors_mention_only_options_of_the_command() {
    let test_folder = fresh_folder();
    for words in [["init", "nodir/x.toml"], ["init", "g.toml/x.toml"], ["plot", "no.parquet"]] {
        let messages = all_output(&test_folder.run_sweep(&words));
        let has_foreign_option = messages.contains("--out") || messages.contains("chunks");
        assert!(messages.contains("= help: ") && !has_foreign_option, "{words:?}: {messages}");
    }
}

#[test]
fn a_figure_does_not_overwrite_its_data_by_any_path() {
    let test_folder = fresh_folder();
    fs::rename(test_folder.path("map.parquet"), test_folder.path("map.svg"))
        .expect("the map is renamed");
    let data_bytes = fs::read(test_folder.path("map.svg")).expect("the map");
    std::os::unix::fs::symlink("map.svg", test_folder.path("link.svg")).expect("a link is made");
    fs::hard_link(test_folder.path("map.svg"), test_folder.path("hard.svg"))
        .expect("a link is made");
    let absolute_path = test_folder.path("map.svg");
    let output_paths =
        ["map.svg", "./map.svg", absolute_path.to_str().expect("UTF-8"), "link.svg", "hard.svg"];
    for output_path in output_paths {
        assert_not_written(
            &test_folder.run_sweep(&["plot", "map.svg", "-o", output_path]),
            &["plot"],
            output_path,
        );
        assert!(
            fs::read(test_folder.path("map.svg")).expect("the map") == data_bytes,
            "{output_path}"
        );
    }
    assert!(test_folder.run_sweep(&["plot", "map.svg", "-o", "figure.svg"]).status.success());
}

#[test]
fn every_command_overwrites_its_own_files_and_removes_those_of_killed_processes() {
    for writer in WRITING_COMMANDS.iter().filter(|writer| writer[0] != "merge") {
        let test_folder = fresh_folder();
        let output_names: &[&str] = if writer[0] == "plot" {
            &["out.svg", "out.png", "out.html"]
        } else {
            &["out.parquet"]
        };
        for output_name in output_names {
            fs::create_dir_all(test_folder.path("new")).expect("a folder is made");
            let path = format!("new/{output_name}");
            let mut previous_bytes = Vec::new();
            for round in 0..2 {
                // A process that is killed during a write leaves such a file.
                let leftover_path =
                    test_folder.path("new").join(sweep_files::atomic::temporary_name());
                fs::write(&leftover_path, "half").expect("a leftover is written");
                // A run writes its temporary files to a folder of its own, and so does not delete
                // this one.
                let command_is_run = writer[0] == "run";
                if command_is_run {
                    fs::remove_file(&leftover_path).expect("the leftover goes");
                }
                let command_output = test_folder.run_sweep(&[*writer, &[&path]].concat());
                assert!(
                    command_output.status.success(),
                    "{writer:?} {output_name} round {round}: {}",
                    all_output(&command_output)
                );
                assert!(!leftover_path.exists(), "{writer:?} {output_name}");
                let written_bytes = fs::read(test_folder.path(&path)).expect("there is an output");
                assert!(
                    round == 0 || written_bytes == previous_bytes,
                    "{writer:?} {output_name}: other bytes"
                );
                previous_bytes = written_bytes;
            }
        }
        let entries: Vec<_> = fs::read_dir(test_folder.path("new")).expect("the folder").collect();
        let sidecar_count = usize::from(writer[0] == "run");
        assert_eq!(entries.len(), output_names.len() + sidecar_count, "{writer:?}: {entries:?}");
    }
}

#[test]
fn a_file_size_limit_does_not_damage_the_old_file() {
    for (writer, output_name) in [
        (WRITING_COMMANDS[3], "x.parquet"),
        (WRITING_COMMANDS[4], "x.parquet"),
        (WRITING_COMMANDS[6], "x.svg"),
    ] {
        let test_folder = fresh_folder();
        let run_limited = |output_name: &str| {
            let limit = ["sh", "-c", "ulimit -f 1; exec \"$@\"", "sh"];
            test_folder
                .command_under(&limit)
                .args(writer)
                .arg(output_name)
                .output()
                .expect("sh starts")
        };
        let run_output = run_limited(output_name);
        assert_eq!(run_output.status.code(), Some(1), "{writer:?}: {}", all_output(&run_output));
        assert!(
            all_output(&run_output).contains("a file-size limit was hit"),
            "{writer:?}: {}",
            all_output(&run_output)
        );
        assert_eq!(test_folder.sorted_file_names(), ["g.toml", "map.parquet"], "{writer:?}");

        let whole_output = test_folder.run_sweep(&[writer, &[output_name]].concat());
        assert!(whole_output.status.success(), "{}", all_output(&whole_output));
        let bytes_before = fs::read(test_folder.path(output_name)).expect("there is an output");
        assert_eq!(run_limited(output_name).status.code(), Some(1));
        assert!(
            fs::read(test_folder.path(output_name)).expect("there is an output") == bytes_before,
            "{writer:?}"
        );
    }
}

#[test]
fn traces_beside_a_result_have_its_name() {
    let test_folder = fresh_folder();
    for (output_name, traces_folder) in
        [("v1.0", "v1.0.traces"), ("v1.5", "v1.5.traces"), ("x.parquet", "x.traces")]
    {
        let run_output =
            test_folder.run_sweep(&["run", "g.toml", "--keep-traces", "--out", output_name]);
        assert!(run_output.status.success(), "{}", all_output(&run_output));
        assert_eq!(
            fs::read_dir(test_folder.path(traces_folder)).expect("there are traces").count(),
            40,
            "{output_name}"
        );
    }
}

#[test]
fn kept_traces_are_the_trajectories_of_their_rows() {
    let test_folder = fresh_folder();
    let fast_grid = "[spin]\nprofile = \"ramp\"\npeak_rpm = 300\nramp_s = 2\n[time]\nend_s = 2\n\
                [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.2, 0.3]\n";
    fs::write(test_folder.path("fast.toml"), fast_grid).expect("the grid is written");
    let run_output =
        test_folder.run_sweep(&["run", "fast.toml", "--keep-traces", "--out", "x.parquet"]);
    assert!(run_output.status.success(), "{}", all_output(&run_output));
    assert!(
        all_output(&run_output).contains("rows by method: 3 capped_1"),
        "{}",
        all_output(&run_output)
    );
    for point in 0..3 {
        let trace_file_bytes =
            fs::read(test_folder.path(&format!("x.traces/point-{point}.parquet")));
        let trace_file_bytes = trace_file_bytes.expect("the point has a trace");
        assert!(
            String::from_utf8_lossy(&trace_file_bytes).contains(r#""row":"capped_1""#),
            "point {point}"
        );
    }
}

/// Calls a function while a bit of a file is flipped.
fn with_flipped_bit<T>(path: &Path, byte_offset: u64, bit: u8, read_file: impl FnOnce() -> T) -> T {
    let flip_bit = || {
        let mut file =
            fs::OpenOptions::new().read(true).write(true).open(path).expect("the file opens");
        let mut byte = [0];
        file.seek(std::io::SeekFrom::Start(byte_offset)).expect("a place in the file");
        file.read_exact(&mut byte).expect("a byte is read");
        file.seek(std::io::SeekFrom::Start(byte_offset)).expect("a place in the file");
        file.write_all(&[byte[0] ^ (1 << bit)]).expect("a byte is written");
    };
    flip_bit();
    let result = read_file();
    flip_bit();
    result
}

#[test]
fn every_command_detects_a_flipped_bit_in_its_input() {
    let test_folder = fresh_folder();
    let map_path = test_folder.path("map.parquet");
    let map_bytes = fs::read(&map_path).expect("the map");
    for writer in [WRITING_COMMANDS[3], WRITING_COMMANDS[4], WRITING_COMMANDS[5]] {
        let command_output =
            test_folder.run_sweep(&[writer, &[&format!("{}.parquet", writer[0])]].concat());
        assert!(command_output.status.success(), "{}", all_output(&command_output));
    }
    let reading_commands: [&[&str]; 9] = [
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
    let mut random_bits = 0x2545_f491_4f6c_dd1d_u64;
    for reading_command in reading_commands {
        let file_name =
            reading_command.iter().find(|word| word.ends_with(".parquet")).expect("a file to read");
        let path = test_folder.path(file_name);
        let byte_count = fs::metadata(&path).expect("the file is there").len();
        for _ in 0..12 {
            random_bits ^= random_bits << 13;
            random_bits ^= random_bits >> 7;
            random_bits ^= random_bits << 17;
            let byte_offset = random_bits % byte_count;
            let bit = (random_bits >> 40) as u8 % 8;
            let command_output = with_flipped_bit(&path, byte_offset, bit, || {
                test_folder.run_sweep(reading_command)
            });
            let messages = all_output(&command_output);
            assert!(
                matches!(command_output.status.code(), Some(1 | 2)),
                "{reading_command:?}, bit {bit} of {byte_offset}: {messages}"
            );
            assert!(
                messages.contains("parquet") && !messages.contains("panicked"),
                "{reading_command:?}: {messages}"
            );
        }
    }
    assert!(fs::read(&map_path).expect("the map") == map_bytes);
    for figure in ["map.svg", "trace.html", "modes.png"] {
        assert!(!test_folder.path(figure).exists(), "{figure}");
    }
}

#[test]
fn status_reports_a_file_that_is_no_result() {
    let test_folder = fresh_folder();
    fs::write(test_folder.path("junk.parquet"), "junk").expect("a file is written");
    let status_output = test_folder.run_sweep(&["status", "g.toml", "--out", "junk.parquet"]);
    assert_not_written(&status_output, &["status"], "junk.parquet");
    let status_output = test_folder.run_sweep(&["status", "g.toml", "--out", "nothing.parquet"]);
    assert!(
        status_output.status.success() && all_output(&status_output).contains("not started"),
        "{}",
        all_output(&status_output)
    );
    let status_output = test_folder.run_sweep(&[
        "status",
        "g.toml",
        "--set",
        "tub_mass_kg=20",
        "--out",
        "map.parquet",
    ]);
    assert_eq!(status_output.status.code(), Some(2), "{}", all_output(&status_output));
    assert!(all_output(&status_output).contains("tub"), "{}", all_output(&status_output));
}

#[test]
fn special_files_are_not_read() {
    let test_folder = fresh_folder();
    run_standard_program("mkfifo", &[&test_folder.path("fifo.parquet")]);
    for words in
        [&["show", "fifo.parquet"] as &[&str], &["plot", "fifo.parquet"], &["show", "/dev/zero"]]
    {
        let run_output = test_folder.run_sweep(words);
        assert_eq!(run_output.status.code(), Some(2), "{}", all_output(&run_output));
        assert!(
            all_output(&run_output).contains("not a regular file"),
            "{words:?}: {}",
            all_output(&run_output)
        );
    }
}

#[test]
fn escape_sequences_in_files_do_not_reach_the_terminal() {
    let test_folder = fresh_folder();
    let hostile_text = "evil\u{1b}]0;title\u{7}\u{9b}2J\u{202e}";
    let hostile_grid = grid_text(5, 8)
        .replace("\"short\"", &format!("{hostile_text:?}"))
        .replace("tub_yaw", hostile_text);
    fs::write(test_folder.path("evil.toml"), hostile_grid).expect("a grid is written");
    let malformed_grid =
        grid_text(5, 8).replace("name = ", &format!("# {hostile_text}\n{hostile_text} = "));
    fs::write(test_folder.path("raw.toml"), malformed_grid).expect("a grid is written");
    let partial_folder = test_folder.path("x.parquet.partial");
    fs::create_dir(&partial_folder).expect("a folder is made");
    let plan_text = format!(
        r#"{{ "format": 2, "version": {version}, "numerics": 1, "plan_hash": "", "points": 1,
              "chunk_points": 8, "plan": {{}} }}"#,
        version = serde_json::to_string(hostile_text).expect("a string")
    );
    fs::write(
        partial_folder.join("plan.json"),
        plan_text.replace("\"format\": 2", "\"format\": 7"),
    )
    .expect("a plan");
    for words in [
        &["check", "evil.toml"] as &[&str],
        &["check", "raw.toml"],
        &["check", "raw.toml", "--set", hostile_text],
        &["status", "g.toml", "--out", "x.parquet"],
        &["run", "g.toml", "--out", "x.parquet"],
        &["show", hostile_text],
        &["run", "g.toml", "--out", &format!("{hostile_text}/x.parquet/")],
    ] {
        let run_output = test_folder.run_sweep(words);
        assert_ne!(run_output.status.code(), Some(0), "{words:?}");
        let messages = all_output(&run_output) + &String::from_utf8_lossy(&run_output.stdout);
        assert!(messages.contains("evil"), "{words:?}: {messages}");
        let is_unsafe = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
        assert!(!messages.contains(is_unsafe), "{words:?}: {messages:?}");
    }
}
