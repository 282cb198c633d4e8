//! The rung or method that a row's numbers come from.

sweep_parameter::named! {
    /// Which method a row's numbers come from, and which rung if it has several. The position is
    /// its code in chunk files, so new ones go to the end.
    #[derive(Default)]
    pub enum Level {
        /// The lowest rung that a row may hold: bearings and hinge with capped modes.
        Fast = "fast",
        /// The same with less error.
        Fine = "fine",
        /// The same with shorter steps and higher caps.
        Finest = "finest",
        /// Plain RK4.
        #[default]
        Rk4 = "rk4",
        /// Dormand-Prince 5(4).
        Dopri5 = "dopri5",
        /// Rodas5P.
        Rodas5p = "rodas5p",
        /// The additive method, for forces with corners.
        Additive = "additive",
        /// Dormand and Prince's formula of order 8, for the same.
        Dop853 = "dop853",
    }
}

impl Level {
    /// Whether it is a rung on which modes of bearings and hinge are capped.
    pub const fn is_capped(self) -> bool {
        matches!(self, Self::Fast | Self::Fine | Self::Finest)
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
