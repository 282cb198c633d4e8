//! What a model adds to the figures that every model's files have.

use serde_json::Value;

use crate::Options;
use crate::chart::Chart;
use crate::error::Result;
use crate::read::{Known, Source};
use crate::table::Table;

/// A model's own kinds of files, their charts, and what pages say of it. What is not given is what
/// a model without any has.
pub trait Figures {
    /// The kinds, and which sections of a plan files follow from.
    fn known(&self) -> Known {
        Known::default()
    }

    /// Refuses options of the model that a file, or the form of the output, would leave without
    /// effect.
    ///
    /// # Errors
    /// [`crate::PlotError::Unfit`].
    fn check(&self, _source: &Source, _is_page: bool) -> Result<()> {
        Ok(())
    }

    /// The chart of a file whose kind is the model's own, or a trace.
    ///
    /// # Errors
    /// Whatever stands against drawing it.
    fn chart(&self, source: Source, _options: &Options) -> Result<(Source, Chart)> {
        Err(source.empty("this model has no figure of it"))
    }

    /// The chart of a point's trace beside a map.
    ///
    /// # Errors
    /// Whatever stands against drawing it.
    fn history(&self, trace: &Table) -> Result<Chart> {
        Err(trace.source.empty("this model has no figure of it"))
    }

    /// What a plan says of the model, in words, each with its heading.
    fn told(&self, _plan: &Value) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// Tables behind these words, in HTML.
    fn tables(&self) -> String {
        String::new()
    }

    /// What to be careful about in every map.
    fn caveats(&self) -> &'static [&'static str] {
        &[]
    }

    /// What a page of a map over these axes computes with: their names, and whether they are
    /// logarithmic.
    fn computing(&self, _axes: &[(&str, bool)]) -> Option<Computing> {
        None
    }
}

/// What a page computes with.
#[derive(Debug)]
pub struct Computing {
    /// The page's script finds it under `live`.
    pub data: Value,
    /// Scripts; one of them has the function `createLive`.
    pub scripts: &'static [&'static str],
    /// Elements that they copy, in HTML.
    pub parts: &'static str,
}

/// The figures that every model has, and no others.
#[derive(Clone, Copy, Debug, Default)]
pub struct CommonFigures;

impl Figures for CommonFigures {}
