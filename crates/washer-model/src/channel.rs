//! Output channels: what is compared between the two models.

/// One observed motion, always as deviation from the static equilibrium.
///
/// `y` is along c2 (up), `z` along c3 (horizontal). P_TE and P_DE are the front centres of tub and drum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Channel {
    /// P_TE along c2.
    TubFrontY,
    /// P_TE along c3.
    TubFrontZ,
    /// P_DE along c2.
    DrumFrontY,
    /// P_DE along c3.
    DrumFrontZ,
    /// Mass centre of all three bodies along c2.
    TotalCentreY,
    /// Mass centre of all three bodies along c3.
    TotalCentreZ,
    /// q5.
    TubYaw,
    /// q6.
    TubPitch,
}

impl Channel {
    /// Every known channel, in the order of the model's output vector.
    pub const ALL: [Self; 8] = [
        Self::TubFrontY,
        Self::TubFrontZ,
        Self::DrumFrontY,
        Self::DrumFrontZ,
        Self::TotalCentreY,
        Self::TotalCentreZ,
        Self::TubYaw,
        Self::TubPitch,
    ];

    /// Position in [`Channel::ALL`] and in the model's output vector.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Name in grid files and column names.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::TubFrontY => "tub_front_y",
            Self::TubFrontZ => "tub_front_z",
            Self::DrumFrontY => "drum_front_y",
            Self::DrumFrontZ => "drum_front_z",
            Self::TotalCentreY => "total_centre_y",
            Self::TotalCentreZ => "total_centre_z",
            Self::TubYaw => "tub_yaw",
            Self::TubPitch => "tub_pitch",
        }
    }

    /// `"m"` or `"rad"`.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::TubYaw | Self::TubPitch => "rad",
            _ => "m",
        }
    }

    /// One line for column dictionaries and docs.
    #[must_use]
    pub const fn description(self) -> &'static str {
        match self {
            Self::TubFrontY => "vertical motion of the tub's front centre",
            Self::TubFrontZ => "horizontal motion of the tub's front centre",
            Self::DrumFrontY => "vertical motion of the drum's front centre",
            Self::DrumFrontZ => "horizontal motion of the drum's front centre",
            Self::TotalCentreY => "vertical motion of the mass centre of tub, shaft and drum",
            Self::TotalCentreZ => "horizontal motion of the mass centre of tub, shaft and drum",
            Self::TubYaw => "rotation of the tub about the vertical (q5)",
            Self::TubPitch => "rotation of the tub about its horizontal cross axis (q6)",
        }
    }
}
