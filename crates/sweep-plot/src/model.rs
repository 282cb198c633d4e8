//! The interface through which a model adds its own figures to those that every model has.

use serde_json::Value;

use crate::PlotOptions;
use crate::chart::Chart;
use crate::error::Result;
use crate::read::{FigureFile, ModelKinds};
use crate::table::FigureTable;

/// A model's own kinds of files, their charts, and the model's text in pages. By default a model
/// has none of these.
pub trait Figures {
    /// Returns the model's kinds of files, and the sections of a plan that results follow from.
    fn model_kinds(&self) -> ModelKinds {
        ModelKinds::default()
    }

    /// Rejects options of the model that have no effect on a file or on the form of the output.
    ///
    /// # Errors
    /// [`crate::PlotError::Unfit`].
    fn check(&self, _source: &FigureFile, _is_page: bool) -> Result<()> {
        Ok(())
    }

    /// Draws a file of the model's own kind, or a trace.
    ///
    /// # Errors
    /// The errors of reading and drawing it.
    fn chart(&self, source: FigureFile, _options: &PlotOptions) -> Result<(FigureFile, Chart)> {
        Err(source.nothing_to_draw_error("this model has no figure of it"))
    }

    /// Draws the chart of a point's trace beside a map.
    ///
    /// # Errors
    /// The errors of drawing it.
    fn history(&self, trace: &FigureTable) -> Result<Chart> {
        Err(trace.source.nothing_to_draw_error("this model has no figure of it"))
    }

    /// Returns the lines of a plan's summary about the model: heading and text.
    fn plan_summary(&self, _plan: &Value) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// Returns the tables that follow the summary, in HTML.
    fn tables(&self) -> String {
        String::new()
    }

    /// Returns the notes on what to be careful about in every map.
    fn cautions(&self) -> &'static [&'static str] {
        &[]
    }

    /// Returns the live part of a page over these axes, given by name and whether they are
    /// logarithmic.
    fn live_part(&self, _axes: &[(&str, bool)]) -> Option<LivePart> {
        None
    }
}

/// The live part of a page: data and scripts with which it computes.
#[derive(Debug)]
pub struct LivePart {
    /// The data that scripts of the page find under `live`.
    pub data: Value,
    /// The scripts; one of them has the function `createLive`.
    pub scripts: &'static [&'static str],
    /// The templates of elements that the scripts copy, in HTML.
    pub templates: &'static str,
}

/// The figures of a model without its own figures.
#[derive(Clone, Copy, Debug, Default)]
pub struct CommonFigures;

impl Figures for CommonFigures {}
