//! The figures: one module for each kind.

pub(crate) mod boundary;
pub(crate) mod curves;
pub(crate) mod histogram;
pub(crate) mod influence;
pub(crate) mod map;
pub(crate) mod matrix;
pub(crate) mod optimise;
