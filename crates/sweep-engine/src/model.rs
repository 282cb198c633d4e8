//! The facts about a model that are the same for every plan.

use sweep_parameter::Channel;

use crate::build::Build;
use crate::method::IntegrationMethod;

/// A table of the grid file in which a model has keys of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GridTable {
    /// The top of the file, and the model's own tables.
    Top,
    /// `[reliability]`.
    Reliability,
}

/// The facts about a model that are the same for every plan.
#[derive(Clone, Copy)]
pub struct About {
    /// The build, which is recorded in results.
    pub build: Build,
    /// The channels, in the order of columns.
    pub channels: &'static [Channel],
    /// The channels that are compared if the grid file names none.
    pub default_channels: &'static [Channel],
    /// The methods of integration, in the order of messages and pages; the last is the default.
    pub methods: &'static [IntegrationMethod],
    /// The model's own file, which grids may name.
    pub model_file: Option<ModelFile>,
    /// The advice for a user without a grid file.
    pub start_advice: Option<&'static str>,
    /// The settings that optional columns require, each by the prefix of the columns' names (the
    /// part before the first underscore).
    pub required_settings: &'static [(&'static str, &'static str)],
    /// The sentence about optional columns in the message about an unknown column.
    pub further_columns: &'static str,
}

/// A file of a model's own.
#[derive(Clone, Copy, Debug)]
pub struct ModelFile {
    /// The key by which a grid file names the model's file.
    pub key: &'static str,
    /// The keys at the top of the file.
    pub keys: &'static [&'static str],
}

impl About {
    /// Creates the facts about a model without a file and optional columns of its own, which
    /// compares all channels.
    pub const fn new(
        build: Build,
        channels: &'static [Channel],
        methods: &'static [IntegrationMethod],
    ) -> Self {
        Self {
            build,
            channels,
            default_channels: channels,
            methods,
            model_file: None,
            start_advice: None,
            required_settings: &[],
            further_columns: "",
        }
    }

    /// Returns the method of grid files that name none.
    pub const fn default_method(&self) -> &'static IntegrationMethod {
        &self.methods[self.methods.len() - 1]
    }
}
