//! The keys of a grid file, table by table. Missing values have the defaults of a blank plan.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::json;
use sweep_parameter::{Range, decimal};

use super::form::NumberArray;
use super::keys::{Description, KeyVariants};
use super::{
    Diagnostic, Field, Form, GridInput, Key, KeyWalk, Keys, Located, Location, Report, Section,
    design,
};
use crate::method::{IntegrationMethod, Integrator, Setting};
use crate::plan::{MAX_END_S, NumberSources, Plan, RATIO_MIN_RANGE, ReadingNotes, Reliability};
use crate::{GridTable, Model};

impl<M: Model> Plan<M> {
    /// Returns the plan of a grid file without keys: the defaults.
    pub(super) fn blank_plan() -> Self {
        let end_s = 50.0;
        Self {
            name: String::new(),
            model: M::blank(),
            end_s,
            window_s: [0.0, end_s],
            integrator: M::ABOUT.default_method().with_defaults(),
            axes: Vec::new(),
            design: None,
            reliability: Reliability {
                limits: 2.0.into(),
                channels: M::ABOUT.default_channels.to_vec(),
            },
            set: Vec::new(),
            sources: NumberSources::default(),
            reading_notes: ReadingNotes::default(),
        }
    }
}

/// Walks over every key of a plan except its axes and `[set]`.
pub fn walk_plan_keys<M: Model>(plan: &mut Plan<M>, keys: &mut Keys<'_>) {
    walk_sections(plan, keys, None);
    design::walk_design(&mut plan.design, keys);
}

/// Returns the description of the keys of grid files, except axes and `[set]`.
pub fn describe_keys<M: Model>() -> Description {
    Keys::described(true, |keys| walk_plan_keys(&mut Plan::<M>::blank_plan(), keys))
}

/// Walks over the keys that are read before `[set]`; `input` is the grid that is read.
pub(super) fn walk_sections<M: Model>(
    plan: &mut Plan<M>,
    keys: &mut Keys<'_>,
    input: Option<&GridInput<M>>,
) {
    let Plan { name, model, end_s, window_s, integrator, reliability, .. } = plan;
    let description =
        "name of the run and of its result file; the grid file's own name if left out";
    let schema = json!({ "type": "string", "pattern": "^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$" });
    let read_run_name = |root: &Section<'_>, _| {
        let path = input.map_or(Path::new(""), |input| &input.path);
        let overriding_name = input.and_then(|input| input.name.as_deref());
        let name =
            self::read_name(root, path, overriding_name, "add `name = \"...\"`, or pass `--name`");
        Field::Present(Located { value: name.into(), location: root.location().clone() })
    };
    keys.walk_key(Key::new("name", description), &Form::Custom(&read_run_name, schema), name);
    model.walk(GridTable::Top, keys, input);
    keys.walk_table(Key::new("time", "").required("a section [time]"), |keys| {
        walk_time(end_s, window_s, keys)
    });
    keys.walk_table(Key::new("integrator", ""), |keys| {
        walk_method(M::ABOUT.methods, integrator, keys)
    });
    keys.walk_table(Key::new("reliability", ""), |keys| {
        model.walk(GridTable::Reliability, keys, input);
        let Reliability { limits, channels } = reliability;
        let key = Key::new("ratio_limit", "a point is reliable where every ratio is below this");
        keys.walk_key(key.settable(), &Form::Number(Range::Positive), &mut limits.upper);
        let description = "if given, a point is reliable where every ratio is above this too";
        keys.walk_key(
            Key::new("ratio_min", description).settable(),
            &Form::Number(RATIO_MIN_RANGE),
            &mut limits.lower,
        );
        let key = Key::new("channels", "channels that are compared").settable();
        keys.walk_words(key, "channel", M::ABOUT.channels, |channel| channel.name, channels);
    });
}

/// The form of names, which become file names.
const FILE_NAME_RULE: &str = "letters a to z and A to Z, digits, `-`, `_` and `.`, beginning with \
                              a letter or digit, at most 100 characters";

fn is_file_name(name: &str) -> bool {
    let begins_well = name.chars().next().is_some_and(|c| c.is_ascii_alphanumeric());
    begins_well
        && name.len() <= 100
        && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c))
}

/// Parses a run's name from the command line.
pub fn parse_name(text: &str) -> Result<String, String> {
    if is_file_name(text) { Ok(text.to_owned()) } else { Err(format!("expected {FILE_NAME_RULE}")) }
}

/// Returns the run's name: `overriding_name`, the name in the file, or the file's own name, in this
/// order. `help` is the advice for a file without any of them.
pub fn read_name(
    root: &Section<'_>,
    path: &Path,
    overriding_name: Option<&str>,
    help: &str,
) -> String {
    match root.text("name") {
        Field::Present(found) if is_file_name(found.value) => {
            return overriding_name.unwrap_or(found.value).to_owned();
        }
        Field::Present(found) => {
            let title = "`name` is not a plain file name";
            root.report.refuse::<()>(&found.location, title, format!("expected {FILE_NAME_RULE}"));
        }
        Field::Rejected => {}
        Field::Absent => {
            let stem = || path.file_stem().and_then(|stem| stem.to_str());
            if let Some(name) = overriding_name.or_else(stem).filter(|name| is_file_name(name)) {
                return name.to_owned();
            }
            let title = "`name` is missing, and the file's own name cannot replace it";
            let refusal = Diagnostic::new(title)
                .at_location(root.location(), format!("expected {FILE_NAME_RULE}"));
            root.report.push_missing(refusal.with_help(help));
        }
    }
    String::new()
}

/// Walks over the keys of `[time]`: the end and the window.
fn walk_time(end_s: &mut f64, window_s: &mut [f64; 2], keys: &mut Keys<'_>) {
    let key_description = Key::new("end_s", "end of the integration, s").settable();
    let key = key_description.required("the end of the integration in s");
    let end_schema = json!({ "type": "number", "exclusiveMinimum": 0, "maximum": MAX_END_S });
    let (form, expectation) = match &keys.walk {
        KeyWalk::Read(_) => (Form::Number(Range::Any), "a time greater than 0, "),
        KeyWalk::Set(_) => (Form::Number(Range::Positive), ""),
        _ => (Form::Custom(&|_, _| Field::Absent, end_schema), ""),
    };
    let mut value = *end_s;
    let end = keys.walk_key(key, &form, &mut value).into_located().and_then(
        |Located { location, .. }| {
            if 0.0 < value && value <= MAX_END_S {
                return Some(Located { value, location });
            }
            let title = format!("`end_s` = {} is out of range", decimal(value));
            keys.report()?.refuse(
                &location,
                title,
                format!("expected {expectation}at most {MAX_END_S:e} s"),
            )
        },
    );
    let is_window_written = |report: &Report| report.location(WINDOW_PARAMETERS[1]).is_some();
    if let Some(end) = &end {
        *end_s = end.value;
        // The default window ends at the end of the run.
        if !keys.report().is_some_and(is_window_written) {
            window_s[1] = end.value;
        }
    }
    let key_description = "amplitudes are taken from the first to the second time, s; the whole \
                           run if left out";
    let expectation = "expected two, [from, to], in s";
    let form = Form::Numbers(NumberArray {
        location_keys: WINDOW_PARAMETERS.map(str::to_owned).to_vec(),
        ..NumberArray::new(Range::NonNegative, 2..=2, expectation)
    });
    let mut window_edges = if keys.is_schema() { Vec::new() } else { window_s.to_vec() };
    let window_field =
        keys.walk_key(Key::new("window_s", key_description), &form, &mut window_edges);
    if let (Field::Present(window_field), Some(report)) = (window_field, keys.report())
        && let Some(window) =
            check_window(&window_field.location, &window_edges, end.as_ref(), report)
        && end.is_some()
    {
        *window_s = window;
    }
}

/// The names of the window's edges as parameters.
const WINDOW_PARAMETERS: [&str; 2] = ["window_from_s", "window_to_s"];

/// Returns the window that was read, if it is valid.
fn check_window(
    location: &Location,
    window_edges: &[f64],
    end: Option<&Located<f64>>,
    report: &Report,
) -> Option<[f64; 2]> {
    let &[from, to] = window_edges else { return None };
    let [from_text, to_text] = [from, to].map(decimal);
    if from >= to {
        let window_defect = if from > to { "reversed" } else { "empty" };
        let title =
            format!("the window is {window_defect}: it goes from {from_text} s to {to_text} s");
        return report.refuse(location, title, "expected [from, to] with from < to");
    }
    if let Some(end) = end.filter(|end| to > end.value) {
        let title = format!("the window ends at {to_text} s, after the integration");
        let refusal = Diagnostic::new(title).at_location(
            &report.location(WINDOW_PARAMETERS[1])?,
            format!("expected at most {}", decimal(end.value)),
        );
        report.push(refusal.at_location(&end.location, "the integration ends here"));
        return None;
    }
    Some([from, to])
}

/// Walks over the keys of `[integrator]`: the method and its settings.
fn walk_method(
    methods: &'static [IntegrationMethod],
    integrator: &mut Integrator,
    keys: &mut Keys<'_>,
) {
    let variants = KeyVariants {
        words: methods.iter().map(|method| (method.name, method.description)).collect(),
        default_index: Some(methods.len() - 1),
        settable_count: methods.len(),
    };
    let current_method = methods.iter().position(|method| method.name == integrator.name());
    keys.walk_variants(
        Key::new("method", "").settable(),
        &variants,
        current_method,
        |keys, index| {
            let method = &methods[index];
            let name = method.name;
            let other_keys =
                methods.iter().flat_map(|other| other.settings).map(|setting| setting.key);
            for key in other_keys.filter(|key| !method.has_setting(key)).collect::<BTreeSet<_>>() {
                let methods_with_key =
                    methods.iter().filter(|other| other.has_setting(key)).map(|other| other.name);
                let methods_with_key: Vec<&str> = methods_with_key.collect();
                let (noun, verb) = if methods_with_key.len() == 1 {
                    ("method", "has")
                } else {
                    ("methods", "have")
                };
                let quoted_methods = methods_with_key.join("\" and \"");
                keys.mark_misplaced(
                    &[key],
                    &format!("only the {noun} \"{quoted_methods}\" {verb} it, not \"{name}\""),
                );
                let title = format!("the method \"{name}\" has no `{key}`");
                keys.refuse_option(
                    key,
                    &title,
                    &format!("`{key}` belongs to \"{}\"", methods_with_key.join("\", \"")),
                );
            }
            // Settings that the old and the new method share keep their values.
            let old_settings = integrator.settings();
            *integrator =
                method.with_settings(|&Setting { key, range, default, description, help }| {
                    let old_settings = old_settings.iter().find(|(known, _)| *known == key);
                    let mut number = old_settings.map_or(default, |(_, number)| *number);
                    let setting = Key::new(key, description).settable();
                    let field = keys.walk_key(setting, &Form::Number(range), &mut number);
                    if let (Field::Rejected, false, Some(report)) =
                        (field, help.is_empty(), keys.report())
                    {
                        report.add_help(help);
                    }
                    if let Some((section, location)) = keys
                        .section()
                        .and_then(|section| Some((section, section.key_location(key)?)))
                    {
                        section.report.record_location(format!("integrator.{key}"), location);
                    }
                    number
                });
        },
    );
}
