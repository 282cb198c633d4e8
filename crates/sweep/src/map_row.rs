//! A row of a map in memory, whose cells are read by the names of their columns.

use std::sync::Arc;

use sweep_engine::store::{Layout, RowCells};
use sweep_engine::{Model as _, Reliability};
use washer_row::Verdict;

use crate::model::Washer;
use crate::plan::Plan;

/// The facts of a plan that its rows share.
#[derive(Debug)]
pub(crate) struct MapLayout {
    layout: Layout,
    reliability: Reliability,
}

impl MapLayout {
    /// Returns the layout of a plan's rows.
    pub(crate) fn new(plan: &Plan) -> Self {
        Self { layout: Washer::layout(plan), reliability: plan.reliability.clone() }
    }
}

/// A row of a plan's map.
#[derive(Clone, Debug)]
pub struct MapRow {
    map: Arc<MapLayout>,
    cells: RowCells,
}

impl MapRow {
    /// Creates a row from its cells, in the order of the layout's columns.
    pub(crate) const fn new(map: Arc<MapLayout>, cells: RowCells) -> Self {
        Self { map, cells }
    }

    /// Returns the number of a column; `None` for null, and without such a column.
    pub fn number(&self, column: &str) -> Option<f64> {
        self.map.layout.number(&self.cells, column)
    }

    /// Returns the truth value of a column; `None` for null, and without such a column.
    pub fn flag(&self, column: &str) -> Option<bool> {
        self.map.layout.flag(&self.cells, column)
    }

    /// Returns the name of a column; `None` for null, and without such a column.
    pub fn name(&self, column: &str) -> Option<&'static str> {
        self.map.layout.name(&self.cells, column)
    }

    /// Returns the status.
    pub fn status(&self) -> &'static str {
        self.name("status").unwrap_or_default()
    }

    /// Returns the amplitudes of a model, by channel of the plan; none if the model failed.
    pub fn amplitudes(&self, model: &str) -> Vec<f64> {
        self.by_channel(model).into_iter().flatten().collect()
    }

    /// Returns the ratios with their verdict.
    pub fn verdict(&self) -> Verdict {
        Verdict::new(self.by_channel("ratio"), self.map.reliability.limits)
    }

    /// Returns the numbers of the columns with a prefix, one for each channel of the plan.
    fn by_channel(&self, prefix: &str) -> Vec<Option<f64>> {
        let channels = self.map.reliability.channels.iter();
        channels.map(|channel| self.number(&format!("{prefix}_{}", channel.name))).collect()
    }
}
