//! `sweep parameters`: prints the table of parameters, as text or JSON.

use std::path::PathBuf;

use serde_json::{Value, json};
use sweep_parameter::Range;

use super::cells::without_rounding_noise;
use crate::{Error, Exit, GridInput, Model, ModelParameter, Plan, show};

/// Arguments of `sweep parameters`.
#[derive(Debug, clap::Args)]
pub struct ParametersArgs {
    /// Grid file whose values are listed; without it only values that need no grid have one
    #[arg(value_name = "GRID.toml")]
    grid: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Prints every parameter with value, unit, meaning and source.
///
/// # Errors
/// Mistakes in the grid file, or standard output that cannot be written.
pub fn run<M: Model>(args: &ParametersArgs) -> Result<Exit, Error> {
    let plan =
        args.grid.clone().map(|grid| GridInput::<M>::file(grid, Vec::new()).load()).transpose()?;
    let listed_parameters = list_parameters(plan.as_ref());
    show(&if args.json { format_json(&listed_parameters) } else { format_text(&listed_parameters) })
}

/// A line of the listing of parameters.
pub struct ListedParameter<M: Model> {
    /// The parameter.
    pub parameter: ModelParameter<M>,
    /// The value, if there is one.
    pub value: Option<f64>,
    /// The source of the value.
    pub source: String,
}

/// Returns the lines of the listing; without a plan, those of the model's default values.
pub fn list_parameters<M: Model>(plan: Option<&Plan<M>>) -> Vec<ListedParameter<M>> {
    let list_parameter = |parameter: ModelParameter<M>| {
        let value = match parameter.window_edge {
            Some(edge) => plan.map(|plan| plan.window_s[edge]),
            None => parameter.value.filter(|_| plan.is_some() || !parameter.is_from_grid_file),
        };
        // A parameter of several numbers has the sources of all of them.
        let plan_source = plan.filter(|_| !parameter.is_from_grid_file);
        let plan_source = plan_source.and_then(|plan| plan.sources.source(&parameter.number_names));
        let source = plan_source.unwrap_or_else(|| parameter.source.to_owned());
        ListedParameter { parameter, value, source }
    };
    let parameters = match plan {
        Some(plan) => plan.model.parameters(),
        None => M::blank().parameters(),
    };
    parameters.into_iter().map(list_parameter).collect()
}

fn format_text<M: Model>(listed_parameters: &[ListedParameter<M>]) -> String {
    let value_text = |row: &ListedParameter<M>| {
        let value_text = row.value.map(|value| without_rounding_noise(value).to_string());
        value_text.unwrap_or_else(|| "-".to_owned())
    };
    let max_width = |length: &dyn Fn(&ListedParameter<M>) -> usize| {
        listed_parameters.iter().map(length).max().unwrap_or(0)
    };
    let name_width = max_width(&|row| row.parameter.name.len());
    let value_width = max_width(&|row| value_text(row).len());
    let unit_width = max_width(&|row| row.parameter.unit.len());
    let format_line = |row: &ListedParameter<M>| {
        let name = &row.parameter.name;
        let value_text = value_text(row);
        let unit = row.parameter.unit;
        let description = row.parameter.description;
        let source = &row.source;
        format!(
            "{name:name_width$}  {value_text:>value_width$} {unit:unit_width$}  {description} \
             [{source}]\n"
        )
    };
    listed_parameters.iter().map(format_line).collect()
}

/// Formats the table as JSON.
pub fn format_json<M: Model>(listed_parameters: &[ListedParameter<M>]) -> String {
    let to_json = |to_json: &ListedParameter<M>| {
        json!({
            "name": to_json.parameter.name,
            "value": to_json.value,
            "unit": to_json.parameter.unit,
            "description": to_json.parameter.description,
            "range": range_to_json(to_json.parameter.range),
            "source": to_json.source,
        })
    };
    format!("{:#}\n", listed_parameters.iter().map(to_json).collect::<Value>())
}

/// Returns the bounds of a range as JSON. An end that only the greatest magnitude of all parameters
/// limits is `null`.
fn range_to_json(range: Range) -> Value {
    let [least, greatest] = range.bounds();
    json!({ "least": least, "greatest": greatest, "zero_excluded": range.excludes_zero() })
}
