//! One figure a file.

pub(crate) mod boundary;
pub(crate) mod campbell;
pub(crate) mod curves;
pub(crate) mod dwell;
pub(crate) mod histogram;
pub(crate) mod influence;
mod machine;
pub(crate) mod map;
pub(crate) mod matrix;
pub(crate) mod optimise;
pub(crate) mod passages;
pub(crate) mod profiles;
pub(crate) mod shapes;
pub(crate) mod spectrum;
pub(crate) mod stability;
pub(crate) mod trace;
pub(crate) mod turn;
