//! The two models by name.

/// Which of the two models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ModelKind {
    /// Section 4 of the model page.
    Nonlinear,
    /// Its first-order expansion.
    Linear,
}
