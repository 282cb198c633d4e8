//! The rung or method that a row's numbers come from.

/// Which method a row's numbers come from, and which rung if it has several.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// The lowest rung that a row may hold: bearings and hinge with capped modes.
    Fast,
    /// The same with less error.
    Fine,
    /// The same with shorter steps and higher caps.
    Finest,
    /// Plain RK4.
    Rk4,
    /// Dormand-Prince 5(4).
    Dopri5,
    /// Rodas5P.
    Rodas5p,
    /// The additive method, for forces with corners.
    Additive,
}

impl Level {
    /// Every level; the position is its code in chunk files, so new ones go to the end.
    pub const ALL: [Self; 7] = [
        Self::Fast,
        Self::Fine,
        Self::Finest,
        Self::Rk4,
        Self::Dopri5,
        Self::Rodas5p,
        Self::Additive,
    ];

    /// Whether it is a rung on which modes of bearings and hinge are capped.
    pub const fn is_capped(self) -> bool {
        match self {
            Self::Fast | Self::Fine | Self::Finest => true,
            Self::Rk4 | Self::Dopri5 | Self::Rodas5p | Self::Additive => false,
        }
    }

    /// As in the file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Fine => "fine",
            Self::Finest => "finest",
            Self::Rk4 => "rk4",
            Self::Dopri5 => "dopri5",
            Self::Rodas5p => "rodas5p",
            Self::Additive => "additive",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_coded_by_their_place() {
        for (code, level) in Level::ALL.into_iter().enumerate() {
            assert_eq!(level as usize, code);
        }
    }
}
