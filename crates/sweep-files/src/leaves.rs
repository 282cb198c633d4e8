//! Compares two JSON values, such as the plans of two files, leaf by leaf.

use std::fmt;

use serde_json::Value;

/// A step of the path to a value inside another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step<'a> {
    /// The name of a value in an object.
    Name(&'a str),
    /// The index of an element in a list, from 0.
    Index(usize),
}

impl fmt::Display for Step<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name(name) => formatter.write_str(name),
            // People count from 1.
            Self::Index(index) => write!(formatter, "{}", index + 1),
        }
    }
}

/// Returns a path as text with dots: `machine.dampers.1.damping_n_s_per_m`.
pub fn dotted_path(path: &[Step<'_>]) -> String {
    path.iter().map(Step::to_string).collect::<Vec<_>>().join(".")
}

/// Calls `visit_leaf` with each pair of leaves of two values and the path to them; `None` stands
/// for a value that one side lacks. Two lists are leaves unless `is_nested_list` returns true for
/// them.
pub fn visit_leaves<'a>(
    values: [Option<&'a Value>; 2],
    is_nested_list: fn(&[Value], &[Value]) -> bool,
    path: &mut Vec<Step<'a>>,
    visit_leaf: &mut dyn FnMut(&[Step<'a>], [Option<&'a Value>; 2]),
) {
    let mut visit_step = |step: Step<'a>, values| {
        path.push(step);
        visit_leaves(values, is_nested_list, path, visit_leaf);
        path.pop();
    };
    match values {
        [Some(Value::Object(first)), Some(Value::Object(second))] => {
            let added_names = second.keys().filter(|name| !first.contains_key(*name));
            for name in first.keys().chain(added_names) {
                visit_step(Step::Name(name), [first.get(name), second.get(name)]);
            }
        }
        [Some(Value::Array(first)), Some(Value::Array(second))]
            if is_nested_list(first, second) =>
        {
            for index in 0..first.len().max(second.len()) {
                visit_step(Step::Index(index), [first.get(index), second.get(index)]);
            }
        }
        values => visit_leaf(path, values),
    }
}
