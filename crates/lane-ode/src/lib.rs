//! ODE over lanes.
