//! The names of the two models.

sweep_parameter::named! {
    /// A model.
    pub enum ModelKind {
        /// The nonlinear model, section 4 of the model page.
        Nonlinear = "nonlinear",
        /// The linear model, section 5 of the model page.
        Linear = "linear",
    }
}
