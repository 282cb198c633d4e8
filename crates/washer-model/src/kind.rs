//! The two models by name.

sweep_parameter::named! {
    /// Which of the two models.
    pub enum ModelKind {
        /// Section 4 of the model page.
        Nonlinear = "nonlinear",
        /// Its first-order expansion.
        Linear = "linear",
    }
}
