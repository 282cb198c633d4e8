//! From one map to a decision: `require`, `compare`, `export`, rows of `show`, `trace --point`,
//! `--set` of the grid file's scalars.

use std::fs::{self, File};
use std::process::Output;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch};
use serde_json::{Value, json};
use sweep_files::Writer;

use crate::home::{Home, grid, said};

/// A folder with a finished map of six points, `results/short.parquet`.
fn mapped() -> Home {
    let home = Home::new(&grid(3, 2));
    let done = home.sweep(&["run", "g.toml", "--progress", "none"]);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    home
}

const MAP: &str = "results/short.parquet";

fn code(output: &Output) -> Option<i32> {
    output.status.code()
}

fn printed(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn parsed(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
        panic!("{error} in {}\n{}", printed(output), said(output));
    })
}

#[test]
fn a_report_leaves_the_page_of_a_plot_and_asks_for_an_option_per_expression() {
    let home = mapped();
    let page = "results/short.html";
    assert_eq!(code(&home.sweep(&["plot", MAP, "-o", page])), Some(0));
    let before = fs::read(home.path(page)).unwrap();
    let written = home.sweep(&["report", MAP]);
    assert_eq!(code(&written), Some(0), "{}", said(&written));
    assert!(fs::read(home.path(page)).unwrap() == before);
    assert!(home.path("results/short.report.html").exists());
    let refused = home.sweep(&["report", MAP, "--require", "point >= 0", "point < 9"]);
    assert_eq!(code(&refused), Some(2));
    assert!(said(&refused).contains("a `--require` of its own"), "{}", said(&refused));
}

#[test]
fn a_gate_opens_or_names_the_rows_and_exits_with_4() {
    let home = mapped();
    let opened = home.sweep(&["require", MAP, "ratio_max < 1e6", "count(status == 'ok') == 6"]);
    assert_eq!(code(&opened), Some(0), "{}", said(&opened));
    assert!(said(&opened).contains("holds  ratio_max < 1e6: 6 rows"), "{}", said(&opened));

    let closed = home.sweep(&["require", MAP, "unbalance_mass_kg < 0.9", "share(reliable) >= 0"]);
    assert_eq!(code(&closed), Some(4));
    let text = said(&closed);
    assert!(text.contains("FAILS  unbalance_mass_kg < 0.9: 2 of 6 rows false"), "{text}");
    assert!(text.contains("holds  share(reliable) >= 0"), "{text}");

    let gate = parsed(&home.sweep(&["require", MAP, "point < 2", "--json"]));
    assert_eq!(gate["holds"], false);
    assert_eq!(gate["expressions"][0]["failing"], 4);
    assert_eq!(gate["expressions"][0]["offenders"][0]["row"], 2);

    let none = home.sweep(&["require", MAP, "reliable", "--where", "false"]);
    assert_eq!(code(&none), Some(4));
    assert!(said(&none).contains("no row"), "{}", said(&none));
}

#[test]
fn an_answer_goes_to_standard_output_and_nothing_else_does() {
    let home = mapped();
    for words in [
        &["check", "g.toml"][..],
        &["status", "g.toml"],
        &["show", MAP],
        &["require", MAP, "point < 2"],
        &["compare", MAP, MAP],
        &["modes", "--speed", "0:300:100"],
    ] {
        let done = home.sweep(words);
        assert!(done.stdout.len() > 40 && done.stderr.is_empty(), "{words:?}: {}", said(&done));
    }
    for words in [&["run", "g.toml"][..], &["plot", MAP]] {
        let done = home.sweep(words);
        assert!(done.stdout.is_empty() && !done.stderr.is_empty(), "{words:?}: {}", said(&done));
    }
}

/// Writes a file of these ratios and gaps over as many masses.
fn write_ratios(home: &Home, name: &str, ratio: impl Fn(u32) -> Option<f64>) {
    let numbers = |of: &dyn Fn(u32) -> Option<f64>| -> ArrayRef {
        Arc::new((0..400).map(of).collect::<Float64Array>())
    };
    let columns = [
        ("unbalance_mass_kg", numbers(&|row| Some(0.01 * f64::from(row)))),
        ("nonlinear_tub_yaw", numbers(&ratio)),
        ("ratio_max", numbers(&ratio)),
        ("min_gap_nonlinear_m", numbers(&|row| Some(0.01 * ratio(row)?))),
        ("status", numbers(&|_| None)),
    ];
    let rows = RecordBatch::try_from_iter(columns).expect("columns of one length");
    let file = File::create(home.path(name)).expect("the file can be made");
    let mut writer = Writer::new(file, &rows.schema(), Default::default()).expect("a writer");
    writer.write(&rows).expect("rows are written");
    writer.end().and_then(|file| file.close()).expect("the file is written");
}

#[test]
fn no_gate_stands_open_where_points_failed() {
    let home = Home::new(&grid(1, 1));
    write_ratios(&home, "whole.parquet", |_| Some(1.5));
    write_ratios(&home, "half.parquet", |row| (row % 2 == 0).then_some(1.5));
    write_ratios(&home, "nan.parquet", |_| Some(f64::NAN));
    for (file, over) in [("half.parquet", 200), ("nan.parquet", 0)] {
        for gate in
            ["max(ratio_max)<2", "mean(ratio_max)<2", "min(ratio_max)>1", "count(ratio_max>=2)==0"]
        {
            let shut = home.sweep(&["require", file, gate]);
            assert_eq!(code(&shut), Some(4), "{file}: {gate}");
            let told = format!("over {over} of 400 rows");
            assert!(said(&shut).contains(&told), "{}", said(&shut));
        }
        for gate in ["ratio=0.05", "gap=0.001"] {
            let shut = home.sweep(&["compare", "whole.parquet", file, "--fail-on", gate]);
            assert_eq!(code(&shut), Some(4), "{file}: {gate}\n{}", printed(&shut));
            let same = home.sweep(&["compare", file, file, "--fail-on", gate]);
            assert_eq!(code(&same), Some(0), "{file}: {gate}\n{}", printed(&same));
        }
    }
    let known = home.sweep(&["require", "half.parquet", "max(ratio_max)<2", "--allow-null"]);
    assert_eq!(code(&known), Some(0), "{}", said(&known));
    let lacks = ["compare", "half.parquet", "half.parquet", "--fail-on", "flips"];
    let lacks = home.sweep(&lacks);
    assert_eq!(code(&lacks), Some(2), "{}", said(&lacks));
    assert!(said(&lacks).contains("two files with verdicts"), "{}", said(&lacks));
}

#[test]
fn mistakes_in_a_gate_are_pointed_at_all_of_them() {
    let home = mapped();
    let refused = home.sweep(&["require", MAP, "ratio_mx < 2", "reliable = true"]);
    assert_eq!(code(&refused), Some(2));
    let text = said(&refused);
    assert!(text.contains("did you mean `ratio_max`?") && text.contains("expected `==`"), "{text}");
    let folded = home.sweep(&["require", MAP, "reliable", "--where", "max(ratio_max) > 2"]);
    assert_eq!(code(&folded), Some(2), "{}", said(&folded));
    let absent = home.sweep(&["require", "no.parquet", "reliable"]);
    assert_eq!(code(&absent), Some(2), "{}", said(&absent));
    for wrong in ["short.parquet", "resluts/short.parquet", "results/short"] {
        let absent = home.sweep(&["show", wrong]);
        assert!(said(&absent).contains("results/short.parquet is there"), "{}", said(&absent));
    }
    let no_grid = home.sweep(&["check", MAP]);
    assert!(said(&no_grid).contains("it is a Parquet file, not text"), "{}", said(&no_grid));
}

#[test]
fn show_sorts_filters_and_speaks_json() {
    let home = mapped();
    let top = parsed(&home.sweep(&["show", MAP, "--top", "2", "--by", "ratio_tub_yaw", "--json"]));
    let rows = top.as_array().expect("rows");
    let ratios: Vec<f64> = rows.iter().filter_map(|row| row["ratio_tub_yaw"].as_f64()).collect();
    assert!(ratios.len() == 2 && ratios[0] >= ratios[1], "{top}");
    // Every column, and counts as they are.
    assert!(rows[0]["point"].is_u64() && rows[0]["nonlinear_tub_yaw"].is_f64(), "{top}");
    let whole = parsed(&home.sweep(&["show", MAP, "--json"]));
    assert_eq!(whole["summary"]["points"], 6);
    assert_eq!(whole["plan"]["name"], "short");
    let filtered = home.sweep(&["show", MAP, "--where", "damping_n_s_per_m > 200"]);
    assert_eq!(printed(&filtered).lines().count(), 4, "{}", printed(&filtered));
    let wrong = home.sweep(&["show", MAP, "--by", "ratio_tub_yw"]);
    assert_eq!(code(&wrong), Some(2));
    assert!(said(&wrong).contains("`ratio_tub_yaw`"), "{}", said(&wrong));
}

#[test]
fn a_map_differs_from_another_by_what_was_set_and_not_from_itself() {
    let home = mapped();
    let same = home.sweep(&["compare", MAP, MAP, "--fail-on", "any"]);
    assert_eq!(code(&same), Some(0), "{}", printed(&same));
    assert!(printed(&same).contains("not at all"), "{}", printed(&same));

    let light = ["run", "g.toml", "--set", "tub_mass_kg=20", "--name", "light"];
    let done = home.sweep(&[&light[..], &["--progress", "none"]].concat());
    assert_eq!(code(&done), Some(0), "{}", said(&done));
    let shown = printed(&home.sweep(&["show", "results/light.parquet"]));
    assert!(shown.contains("--set  tub_mass_kg = 20"), "{shown}");

    let arguments = ["compare", MAP, "results/light.parquet"];
    let differs = home.sweep(&[&arguments[..], &["--fail-on", "ratio=0", "--json"]].concat());
    assert_eq!(code(&differs), Some(4), "{}", said(&differs));
    let found = parsed(&differs);
    let paths: Vec<&str> = found["plan"]
        .as_array()
        .expect("changes")
        .iter()
        .filter_map(|change| change["path"].as_str())
        .collect();
    assert!(paths.contains(&"machine.tub.mass_kg") && paths.contains(&"set"), "{paths:?}");
    assert_eq!(found["rows"]["in_both"], 6);

    let markdown = printed(&home.sweep(&[&arguments[..], &["--markdown"]].concat()));
    assert!(markdown.starts_with("### `results/light.parquet` compared with"), "{markdown}");
    let written = home.sweep(&[&arguments[..], &["--out", "d.parquet"]].concat());
    assert_eq!(code(&written), Some(0), "{}", said(&written));
    for (quantity, title) in [
        (None, "Greatest ratio of B over that of A"),
        (Some("gap_change_m"), "Least gap of the nonlinear model in B less that in A"),
        (Some("ratio_max_b"), "Greatest ratio of B"),
    ] {
        let option = quantity.map(|column| ["--quantity", column]);
        let asked = option.as_ref().map_or(&[][..], |option| option);
        let drawn = home.sweep(&[&["plot", "d.parquet", "-o", "d.svg"], asked].concat());
        assert_eq!(code(&drawn), Some(0), "{}", said(&drawn));
        let picture = fs::read_to_string(home.path("d.svg")).expect("it was drawn");
        assert!(picture.contains(&format!(">{title}<")), "{quantity:?}");
        // Neither file's limit is known.
        assert!(!picture.contains("boundary: "), "{quantity:?}");
    }
    let shown = parsed(&home.sweep(&["show", "d.parquet", "--json"]));
    let columns = shown["columns"].as_array().expect("a list").iter();
    let worse: Vec<_> = columns.filter_map(|column| column["worse"].as_str()).collect();
    assert_eq!(worse, ["greater", "less"], "of the ratio's change and of the gap's");
    let refused = home.sweep(&["compare", MAP, "d.parquet"]);
    assert_eq!(code(&refused), Some(2), "{}", said(&refused));
}

#[test]
fn any_column_can_be_a_gate_between_two_maps() {
    let home = mapped();
    let light = ["run", "g.toml", "--set", "tub_mass_kg=20", "--out", "light.parquet"];
    let done = home.sweep(&light);
    assert_eq!(code(&done), Some(0), "{}", said(&done));
    let compared = |gate: &str| home.sweep(&["compare", MAP, "light.parquet", "--fail-on", gate]);
    assert_eq!(code(&compared("nonlinear_tub_yaw=1e9")), Some(0));
    let failed = compared("nonlinear_tub_yaw=0");
    assert_eq!(code(&failed), Some(4), "{}", said(&failed));
    let text = printed(&failed);
    assert!(text.contains("--fail-on: nonlinear_tub_yaw changed by up to "), "{text}");
    assert!(text.contains("greatest changes of nonlinear_tub_yaw, rad"), "{text}");
    for unfit in ["nonlinear_tub_yow=1", "unbalance_mass_kg=1", "status=1"] {
        let refused = compared(unfit);
        assert_eq!(code(&refused), Some(2), "{unfit}");
        assert!(said(&refused).contains("a column of numbers in both files"), "{unfit}");
    }
}

#[test]
fn a_verdict_that_flipped_shows_both_of_its_ratios() {
    let home = Home::new(&grid(3, 2));
    for (name, least, mass) in [("a", "ratio_min=0.5", "20"), ("b", "ratio_min=1", "22")] {
        let mass = format!("tub_mass_kg={mass}");
        let run = ["run", "g.toml", "--name", name, "--set", least, "--set", &mass];
        let done = home.sweep(&[&run[..], &["--progress", "none"]].concat());
        assert_eq!(code(&done), Some(0), "{}", said(&done));
    }
    let told = printed(&home.sweep(&["compare", "results/a.parquet", "results/b.parquet"]));
    let flips = told.split("verdicts that flipped").nth(1).expect("some");
    let row = flips.lines().nth(2).expect("a row");
    assert_eq!(row.matches(" to ").count(), 2, "{told}");
    assert!(row.contains(" reliable") && row.ends_with(" not"), "{told}");
}

#[test]
fn a_trace_says_which_limit_its_point_breaks() {
    let home = Home::new(&grid(3, 2));
    let told = |sets: &[&str]| {
        let trace = ["trace", "g.toml", "--point", "1", "--out", "t.parquet"];
        said(&home.sweep(&[&trace[..], sets].concat()))
    };
    let high = told(&[]);
    assert!(high.contains("the greatest ratio is ") && high.contains("the limit 2"), "{high}");
    // So short a run has ratios next to 1, and one of this point is below.
    let low = told(&["--set", "ratio_min=1"]);
    let expected = "not reliable: the least ratio is 1 (tub_yaw), the limit 1";
    assert!(low.contains(expected), "{low}");
}

#[test]
fn a_report_names_quantities_in_words_and_both_limits() {
    let grid = grid(3, 2).replace("ratio_limit = 2.0", "ratio_limit = 2.0\nratio_min = 0.999");
    let home = Home::new(&format!("metrics = [\"damper_speed\", \"static_sag\"]\n{grid}"));
    let sets = ["--set", "spin_ramp_s=0.05", "--set", "damper_1_friction_n=3"];
    let done = home.sweep(&[&["run", "g.toml", "--progress", "none"], &sets[..]].concat());
    assert_eq!(code(&done), Some(0), "{}", said(&done));
    let written = home.sweep(&["report", MAP, "-o", "r.html"]);
    assert_eq!(code(&written), Some(0), "{}", said(&written));
    let page = fs::read_to_string(home.path("r.html")).expect("it was written");
    for text in [
        "is between 0.999 and 2",
        ">Tub front, vertical<",
        ">Least ratio<",
        ">Damper speed<",
        ">Static sag<",
        ">Ratio tub yaw<",
        "Resonances at Unbalance mass 0.525",
        "Unbalance mass ",
        // The only damper that has friction.
        "with friction of 0 to 3 N",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert_eq!(page.matches(">Tub front, vertical<").count(), 1, "of the nonlinear model alone");
    // The file does not say who wrote a number: not even this one, which --set did.
    assert!(!page.contains("assumed") && page.contains("sweep parameters"), "where from");
    // Each damper's are among those of all, and numbers stay with their units.
    assert!(!page.contains("Damper 1 speed"), "numbered");
    assert!(page.contains("\u{a0}N\u{a0}s/m") && page.contains("\u{a0}m/s"), "units");
}

#[test]
fn exports_open_with_their_kind_and_nothing_else_is_overwritten() {
    let home = mapped();
    for (name, begins) in [("m.csv", &b"# exported by sweep "[..]), ("m.xlsx", b"PK\x03\x04")] {
        for _ in 0..2 {
            let done = home.sweep(&["export", MAP, name]);
            assert_eq!(code(&done), Some(0), "{}", said(&done));
        }
        let bytes = fs::read(home.path(name)).expect("the export is there");
        assert!(bytes.starts_with(begins), "{name}");
    }
    fs::write(home.path("mine.csv"), "my,own\n1,2\n").expect("written");
    assert_eq!(code(&home.sweep(&["export", MAP, "mine.csv"])), Some(2));
    assert_eq!(code(&home.sweep(&["export", MAP, "m.ods"])), Some(2));
}

#[test]
fn a_point_is_traced_by_its_number_or_as_the_worst_and_its_row_is_told() {
    let home = mapped();
    let traced = home.sweep(&["trace", "g.toml", "--point", "3", "--out", "t.parquet"]);
    assert_eq!(code(&traced), Some(0), "{}", said(&traced));
    let row = parsed(&home.sweep(&["show", MAP, "--where", "point == 3", "--json"]));
    let ratio = row[0]["ratio_max"].as_f64().expect("a ratio");
    let text = said(&traced);
    assert!(text.contains("verdict  ") && text.contains(&format!("{ratio:.4}")[..5]), "{text}");

    let worst = home.sweep(&["trace", "g.toml", "--worst", "--out", "t.parquet"]);
    assert_eq!(code(&worst), Some(0), "{}", said(&worst));
    let first = parsed(&home.sweep(&["show", MAP, "--top", "1", "--by", "ratio_max", "--json"]));
    let told = format!("point {} is where ratio_max is greatest", first[0]["point"]);
    assert!(said(&worst).contains(&told), "{told}: {}", said(&worst));

    let beyond = home.sweep(&["trace", "g.toml", "--point", "6", "--out", "t.parquet"]);
    assert_eq!(code(&beyond), Some(2));
    assert!(said(&beyond).contains("from 0 to 5"), "{}", said(&beyond));
    let other = ["trace", "g.toml", "--worst", "--set", "tub_mass_kg=20", "--out", "t.parquet"];
    let other = home.sweep(&other);
    assert_eq!(code(&other), Some(2));
    assert!(said(&other).contains("of this very grid"), "{}", said(&other));
}

#[test]
fn every_scalar_of_the_grid_file_can_be_set() {
    let home = Home::new(&grid(3, 2));
    let plan =
        |sets: &[&str]| parsed(&home.sweep(&[&["check", "g.toml", "--json"], sets].concat()));
    let set = plan(&["--set", "end_s=0.2", "--ratio-limit", "1.5", "--set", "step_s=1e-4"]);
    assert_eq!(set["time"]["end_s"], 0.2);
    assert_eq!(set["reliability"]["ratio_limit"], 1.5);
    assert_eq!(set["integrator"]["step_s"], 1e-4);
    assert_eq!(set["set"]["ratio_limit"], 1.5);
    let method = plan(&["--set", "method=dopri5", "--set", "rtol=1e-5", "--set", "criterion=rms"]);
    assert_eq!(method["integrator"]["rtol"], 1e-5);
    assert_eq!(method["reliability"]["criterion"], "rms");
    assert!(plan(&[])["set"].is_null(), "a plan without --set reads as ever");
    let named = ["--set", "profile=ramp", "--set", "channels=tub_yaw, tub_pitch"];
    let named = plan(&[&named[..], &["--set", "metrics=static_sag,clash_time"]].concat());
    assert_eq!(named["spin"]["profile"], "ramp");
    assert_eq!(named["spin"]["peak_rpm"], plan(&[])["spin"]["peak_rpm"]);
    assert_eq!(named["reliability"]["channels"], json!(["tub_yaw", "tub_pitch"]));
    assert_eq!(named["metrics"], json!(["static_sag", "clash_time"]));
    assert_eq!(named["set"]["metrics"], "static_sag,clash_time");
    for (sets, expected) in [
        (["--set", "rtol=1e-5"], "the method \"rk4\" has no `rtol`"),
        (["--set", "method=dopri"], "did you mean `dopri5`?"),
        (["--set", "end_s=-1"], "`end_s`"),
        (["--set", "end_s=0.01"], "window"),
        (["--set", "seed=1"], "this grid has none"),
        (["--set", "profile=table"], "unknown profile"),
        (["--set", "channels=tub_yw"], "did you mean `tub_yaw`?"),
        (["--set", "channels=tub_yaw,tub_yaw"], "given twice"),
        (["--set", "channels="], "unknown channel"),
        (["--set", "metrics=growth"], "needs speeds"),
        (["--ratio-limit", "nan"], "ratio_limit"),
        (["--name", "a/b"], "expected letters"),
    ] {
        let refused = home.sweep(&[&["check", "g.toml"], &sets[..]].concat());
        assert_eq!(code(&refused), Some(2), "{sets:?}: {}", said(&refused));
        assert!(said(&refused).contains(expected), "{sets:?}: {}", said(&refused));
    }
}

#[test]
fn a_list_says_its_axes_and_an_unfinished_run_what_it_is() {
    let home = Home::new(&grid(3, 2));
    fs::write(home.path("list.csv"), "unbalance_mass_kg\n0.1\n0.2\n").expect("written");
    let listed = "name = \"short\"\n\
        spin = { profile = \"triangular\", peak_rpm = 350, ramp_s = 50 }\n\
        time = { end_s = 0.1 }\n\
        integrator = { method = \"rk4\" }\n\
        design = { method = \"list\", file = \"list.csv\" }\n";
    fs::write(home.path("list.toml"), listed).expect("written");
    let done = home.sweep(&["run", "list.toml", "--progress", "none"]);
    assert_eq!(code(&done), Some(0), "{}", said(&done));
    let shown = printed(&home.sweep(&["show", MAP]));
    assert!(shown.contains("design  file list.csv"), "{shown}");
    assert!(shown.contains("axis  unbalance_mass_kg\n"), "{shown}");

    // Of 32 rows a shard has every second chunk of 8.
    fs::write(home.path("g.toml"), grid(8, 4)).expect("written");
    let part = home.sweep(&["run", "g.toml", "--out", "part.parquet", "--shard", "1/2"]);
    assert_eq!(code(&part), Some(0), "{}", said(&part));
    for path in ["part.parquet", "part.parquet.partial"] {
        let shown = printed(&home.sweep(&["show", path]));
        assert!(shown.contains("unfinished: 16 of 32 points done (50.0 %)"), "{shown}");
        let told = parsed(&home.sweep(&["show", path, "--json"]));
        assert_eq!((&told["points"], &told["points_done"]), (&json!(32), &json!(16)));
    }
    for words in [
        &["show", "part.parquet", "--top", "3"][..],
        &["report", "part.parquet"],
        &["require", "part.parquet", "ratio_max < 2"],
        &["plot", "part.parquet"],
        &["export", "part.parquet", "part.csv"],
        &["compare", MAP, "part.parquet"],
    ] {
        let refused = home.sweep(words);
        assert_eq!(code(&refused), Some(2), "{words:?}");
        let text = said(&refused);
        assert!(text.contains("is not finished: 16 of 32 points done"), "{words:?}: {text}");
    }

    fs::create_dir(home.path("x.parquet.partial")).expect("made");
    let folder = home.sweep(&["show", "x.parquet.partial"]);
    assert!(said(&folder).contains("a run that is not finished"), "{}", said(&folder));
}

#[test]
fn a_gate_says_which_part_fails_and_how_sure_a_share_is() {
    let home = Home::new(&designed("monte_carlo"));
    let done = home.sweep(&["run", "g.toml", "--progress", "none"]);
    assert_eq!(code(&done), Some(0), "{}", said(&done));
    let text = "share(unbalance_mass_kg < 0.5) > 0.99 and count(true) == 32";
    let closed = home.sweep(&["require", MAP, text]);
    assert_eq!(code(&closed), Some(4), "{}", said(&closed));
    let told = parsed(&home.sweep(&["require", MAP, text, "--json"]));
    let whole = &told["expressions"][0];
    let share = whole["folded"][0].as_f64().expect("a share");
    let ends = [0, 1].map(|end| whole["intervals"][0][end].as_f64().expect("an interval"));
    assert!(ends[0] < share && share < ends[1] && ends[1] - ends[0] < 0.4, "{ends:?}");
    let holds: Vec<&Value> =
        whole["parts"].as_array().expect("parts").iter().map(|part| &part["holds"]).collect();
    assert_eq!(holds, [&json!(false), &json!(true)]);
    let text = printed(&closed);
    assert!(text.contains("95 % confidence"), "{text}");
    assert!(text.contains("       FAILS  share(unbalance_mass_kg < 0.5) > 0.99"), "{text}");
    assert!(text.contains("       holds  count(true) == 32"), "{text}");
    // The share of a grid is no estimate.
    let grid = mapped();
    let open = printed(&grid.sweep(&["require", MAP, "share(unbalance_mass_kg < 0.5) > 0"]));
    assert!(!open.contains("confidence"), "{open}");
}

#[test]
fn a_misspelt_quantity_of_a_figure_is_told_the_nearest() {
    let home = mapped();
    let refused = home.sweep(&["plot", MAP, "--quantity", "ratio_mx"]);
    assert_eq!(code(&refused), Some(2));
    assert!(said(&refused).contains("is `ratio_max` meant?"), "{}", said(&refused));
}

#[test]
fn what_was_set_is_told_by_a_figure() {
    let home = mapped();
    let light = ["run", "g.toml", "--set", "tub_mass_kg=20", "--set", "channels=tub_yaw"];
    let done = home.sweep(&[&light[..], &["--name", "light", "--progress", "none"]].concat());
    assert_eq!(code(&done), Some(0), "{}", said(&done));
    let drawn = home.sweep(&["plot", "results/light.parquet", "-o", "light.svg"]);
    assert_eq!(code(&drawn), Some(0), "{}", said(&drawn));
    let figure = fs::read_to_string(home.path("light.svg")).expect("a figure");
    assert!(figure.contains("tub_mass_kg = 20") && figure.contains("channels = tub_yaw"));
}

#[test]
fn a_small_result_takes_no_more_than_was_said() {
    let home = mapped();
    let checked = said(&home.sweep(&["check", "g.toml"]));
    let end = checked.find(" kB for the result").expect("a size in kB");
    let most = checked[..end].rsplit(' ').next().and_then(|kb| kb.parse::<f64>().ok());
    let most = most.expect("a number") * 1e3;
    let bytes = fs::metadata(home.path(MAP)).expect("a result").len() as f64;
    assert!(bytes <= most && most < 2.0 * bytes, "{bytes} of {most}: {checked}");
}

/// A grid file of a design over two parameters.
fn designed(method: &str) -> String {
    format!(
        "name = \"short\"\n\
         spin = {{ profile = \"triangular\", peak_rpm = 350, ramp_s = 50 }}\n\
         time = {{ end_s = 0.1 }}\n\
         integrator = {{ method = \"rk4\" }}\n\
         design = {{ method = \"{method}\", points = 32 }}\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nrange = {{ from = 0.1, to = 1.0 }}\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nrange = {{ from = 60, to = 300 }}\n"
    )
}

#[test]
fn a_run_of_a_design_recommends_a_figure_that_can_be_drawn() {
    for method in ["latin_hypercube", "sobol", "monte_carlo"] {
        let home = Home::new(&designed(method));
        let done = home.sweep(&["run", "g.toml", "--progress", "none"]);
        assert_eq!(code(&done), Some(0), "{}", said(&done));
        let text = said(&done);
        assert!(text.contains("share  ") && text.contains("next  sweep plot "), "{text}");
        let next = home.sweep(&["plot", MAP]);
        assert_eq!(code(&next), Some(0), "{}", said(&next));
        for (view, expected) in [
            ("scatter", "Greatest ratio"),
            ("histogram", "% confidence"),
            ("influence", "Rank correlation (Spearman)"),
        ] {
            for name in ["a.svg", "a.png", "a.html"] {
                let drawn = home.sweep(&["plot", MAP, "--view", view, "-o", name]);
                assert_eq!(code(&drawn), Some(0), "{}", said(&drawn));
            }
            let figure = fs::read_to_string(home.path("a.svg")).expect("a figure");
            assert!(figure.contains(expected), "{method}, {view}");
        }
    }
    let home = mapped();
    let refused = home.sweep(&["plot", MAP, "--view", "influence", "-o", "a.svg"]);
    assert_eq!(code(&refused), Some(2));
    assert!(said(&refused).contains("`--view` is for designs"), "{}", said(&refused));
}
