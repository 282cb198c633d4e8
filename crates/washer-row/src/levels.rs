//! Refinement levels: the methods by which a trajectory is integrated, coarsest first.

use washer_model::{Method, MethodKind, UnresolvedModes};

/// The number of levels of a method: two give one difference.
pub(crate) const LEVELS_PER_METHOD: usize = 2;

/// The change by which a level starts a family, whose errors have other terms than those of the
/// level before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FamilyStart {
    /// No change: the level has shorter steps or a smaller tolerance.
    None,
    /// Another method of integration.
    Method,
    /// Modes that the level before does not resolve.
    Modes,
}

/// The refinement levels of one model.
#[derive(Clone, Debug, PartialEq)]
pub struct RefinementLevels {
    /// The levels, coarsest first; at least one.
    pub levels: Vec<Method>,
    /// Whether each level is compared with the one before.
    is_checked: bool,
    /// The reason why no modes are capped, if there is one.
    pub note: Option<String>,
}

impl RefinementLevels {
    /// Creates a single level of this method, without a comparison.
    pub fn direct(method: Method) -> Self {
        Self { levels: vec![method], is_checked: false, note: None }
    }

    /// Creates levels each of which is compared with the one before; at least two.
    pub const fn checked(levels: Vec<Method>, note: Option<String>) -> Self {
        Self { levels, is_checked: true, note }
    }

    /// Whether each level is compared with the one before.
    pub const fn is_checked(&self) -> bool {
        self.is_checked
    }

    /// Returns the index of the first level without capped modes.
    pub fn first_uncapped(&self) -> usize {
        self.levels.iter().take_while(|method| method.kind.is_capped()).count()
    }

    /// Returns whether a level starts a family of levels, and by which change.
    pub fn family_start(&self, level_index: usize) -> FamilyStart {
        let Some(previous_index) = level_index.checked_sub(1) else { return FamilyStart::None };
        let [previous, kind] = [previous_index, level_index].map(|index| self.levels[index].kind);
        if self.unresolved_modes(previous_index) != self.unresolved_modes(level_index) {
            FamilyStart::Modes
        } else if previous != kind && !kind.is_capped() {
            FamilyStart::Method
        } else {
            FamilyStart::None
        }
    }

    /// Returns the index of the first level whose steps resolve the bearings' modes. The levels of
    /// that method come last.
    pub const fn first_resolving(&self) -> usize {
        self.levels.len().saturating_sub(LEVELS_PER_METHOD)
    }

    /// Returns the modes that a level does not resolve, if there are any.
    pub fn unresolved_modes(&self, level_index: usize) -> Option<UnresolvedModes> {
        if self.levels[level_index].kind.is_capped() {
            Some(UnresolvedModes::HingeAndBearings)
        } else if level_index < self.first_resolving() {
            Some(UnresolvedModes::Bearings)
        } else {
            None
        }
    }

    /// Returns the index that denotes the perturbed run of a level: the same method from a slightly
    /// different start ([`Point::perturbed`](washer_model::Point::perturbed)).
    pub const fn perturbed_index(&self, level_index: usize) -> usize {
        self.levels.len() + level_index
    }

    /// Whether an index denotes a perturbed run.
    pub const fn is_perturbed(&self, level_index: usize) -> bool {
        level_index >= self.levels.len()
    }

    /// Returns the method of a level, or of its perturbed run.
    pub fn method(&self, level_index: usize) -> &Method {
        &self.levels[level_index % self.levels.len()]
    }

    /// Returns the method of the given capped kind; if the model lacks it, of the finest coarser
    /// capped kind.
    pub fn capped_method(&self, kind: MethodKind) -> Option<Method> {
        let is_coarse_enough = |method: &&Method| method.kind.is_capped() && method.kind <= kind;
        self.levels.iter().rfind(is_coarse_enough).copied()
    }
}
