//! The error left in the finer of two runs, estimated from their difference.

/// Errors of a run by a method's own may be at most this share of its difference from a coarser
/// one.
const OWN_SHARE: f64 = 0.5;

/// What all runs with capped modes leave out is amplified this many times as much as what they
/// differ in: twice was seen.
const RESERVE: f64 = 2.5;

/// How far a run may be believed, by its difference from a coarser run of the same trajectory.
/// Differences and errors are relative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convergence {
    /// The error left as a share of the difference.
    pub contraction: f64,
    /// The same of what caps move more than the motion.
    pub of_caps: f64,
    /// The error left as a share of the difference before the last one, at least: two runs may
    /// agree by chance, three hardly do.
    pub of_earlier: f64,
    /// Up to which difference that is so. Beyond, errors are not of first order, and the difference
    /// itself counts.
    pub believed_to: f64,
    /// Error of the finer run that the difference does not show, and that comes on top.
    pub own_error: f64,
    /// The difference where the motion amplifies nothing; infinite if nothing says so.
    pub expected: f64,
}

impl Convergence {
    /// The convergence of a run that is compared with nothing.
    pub const NONE: Self = Self {
        contraction: 1.0,
        of_caps: 0.0,
        of_earlier: 0.0,
        believed_to: 0.0,
        own_error: 0.0,
        expected: f64::INFINITY,
    };

    /// The error left, of this difference. `unseen` is what both runs leave out, as a share of the
    /// motion without amplification: it grows with the motion as their difference did.
    pub fn error_left(&self, difference: f64, unseen: f64) -> f64 {
        let Self { contraction, believed_to, own_error, expected, .. } = *self;
        let seen = if difference <= believed_to {
            contraction * difference + own_error.min(OWN_SHARE * difference)
        } else {
            difference
        };
        seen.max((RESERVE * difference / expected).max(1.0) * unseen)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_unseen_grows_as_the_difference_did() {
        let of = Convergence { contraction: 0.1, believed_to: 0.1, ..Convergence::NONE };
        let of = Convergence { expected: 1e-5, ..of };
        assert_eq!(of.error_left(1e-6, 1e-6), 1e-6);
        // Eight and a half times what is expected: a row that was off by 2.2e-4.
        assert!(of.error_left(8.5e-5, 1.3e-5) > 2.2e-4);
        assert_eq!(of.error_left(8.5e-5, 0.0), 0.1 * 8.5e-5);
        assert_eq!(of.error_left(0.2, 0.0), 0.2);
    }

    #[test]
    fn an_error_of_ones_own_is_no_more_than_half_the_difference() {
        let of = Convergence { own_error: 3e-4, contraction: 0.02, ..Convergence::NONE };
        let of = Convergence { believed_to: 0.2, ..of };
        assert_eq!(of.error_left(1e-4, 0.0), 0.02 * 1e-4 + 0.5e-4);
        assert_eq!(of.error_left(1e-2, 0.0), 0.02 * 1e-2 + 3e-4);
    }
}
