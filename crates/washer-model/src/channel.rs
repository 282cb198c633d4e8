//! Output channels: what is compared between the two models.

use core::ffi::CStr;

/// The table of channels, in the order of the models' output vectors: all that the crate knows of a
/// channel is a row of it. Passes the rows to the macro `$then`.
///
/// A row holds the variant; its name and description; what it is of ([`ChannelKind`]); what the
/// nonlinear model takes it from (`point`: an entry of `outputs::Places` and its axis, `angle`: a
/// coordinate); and which coordinates the linear model's output depends on. `turning` says that the
/// output has harmonics of theta as well: the coordinates of the cosine's and of the sine's part,
/// and which of the parts (0: steady, 1: cosine, 2: sine) are there at rest. The equilibrium has
/// the unbalance up and the hinge bent in the vertical plane alone, so that nothing moves along c2
/// with the sine then.
macro_rules! channels {
    ($then:ident) => {
        $then! {
            /// P_TE along c2.
            TubFrontY, "tub_front_y", "vertical motion of the tub's front centre",
                TubPoint, [point tub_front 1], steady [TUB_Y TUB_PITCH];
            /// P_TE along c3.
            TubFrontZ, "tub_front_z", "horizontal motion of the tub's front centre",
                TubPoint, [point tub_front 2], steady [TUB_Z TUB_YAW TUB_PITCH];
            /// P_DE along c2.
            DrumFrontY, "drum_front_y", "vertical motion of the drum's front centre",
                DrumPoint, [point drum_front 1], steady [SHAFT_Y SHAFT_PITCH HINGE_PITCH],
                turning cos [SHAFT_PITCH HINGE_PITCH] sin [HINGE_YAW] rest [0 1];
            /// P_DE along c3.
            DrumFrontZ, "drum_front_z", "horizontal motion of the drum's front centre",
                DrumPoint, [point drum_front 2],
                steady [SHAFT_Z SHAFT_YAW SHAFT_PITCH HINGE_PITCH],
                turning cos [SHAFT_YAW SHAFT_PITCH HINGE_YAW HINGE_PITCH]
                    sin [SHAFT_YAW HINGE_YAW HINGE_PITCH] rest [0 1 2];
            /// Mass centre of all three bodies along c2.
            TotalCentreY, "total_centre_y",
                "vertical motion of the mass centre of tub, shaft and drum",
                TubPoint, [point total_centre 1],
                steady [TUB_Y SHAFT_Y TUB_PITCH SHAFT_PITCH HINGE_PITCH],
                turning cos [SHAFT_PITCH HINGE_PITCH] sin [HINGE_YAW] rest [0 1];
            /// Mass centre of all three bodies along c3.
            TotalCentreZ, "total_centre_z",
                "horizontal motion of the mass centre of tub, shaft and drum",
                TubPoint, [point total_centre 2],
                steady [TUB_Z SHAFT_Z TUB_YAW TUB_PITCH SHAFT_YAW SHAFT_PITCH HINGE_PITCH],
                turning cos [SHAFT_YAW SHAFT_PITCH HINGE_YAW HINGE_PITCH]
                    sin [SHAFT_YAW HINGE_YAW HINGE_PITCH] rest [0 1 2];
            /// q5.
            TubYaw, "tub_yaw", "rotation of the tub about the vertical (q5)",
                TubAngle, [angle TUB_YAW], steady [TUB_YAW];
            /// q6.
            TubPitch, "tub_pitch", "rotation of the tub about its horizontal cross axis (q6)",
                TubAngle, [angle TUB_PITCH], steady [TUB_PITCH];
        }
    };
}
pub(crate) use channels;

/// What a channel is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ChannelKind {
    /// A point that moves with the tub, or mostly so.
    TubPoint,
    /// A point of the drum.
    DrumPoint,
    /// An angle of the tub.
    TubAngle,
}

macro_rules! declare {
    ($(
        $(#[$doc:meta])* $name:ident, $key:literal, $description:literal, $kind:ident,
        $from:tt, steady $steady:tt $(, turning cos $cos:tt sin $sin:tt rest $rest:tt)?;
    )+) => {
        /// One observed motion, always as deviation from the static equilibrium.
        ///
        /// `y` is along c2 (up), `z` along c3 (horizontal). P_TE and P_DE are the front centres of
        /// tub and drum.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Channel {
            $($(#[$doc])* $name,)+
        }

        impl Channel {
            /// Every channel, in the order of the model's output vector.
            pub const ALL: [Self; [$($key),+].len()] = [$(Self::$name),+];

            /// Name in grid files and column names.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => $key,)+
                }
            }

            /// The name for C, with its zero byte.
            pub const fn c_name(self) -> &'static CStr {
                match self {
                    $(Self::$name => terminated(concat!($key, "\0")),)+
                }
            }

            /// One line for column dictionaries and docs.
            pub const fn description(self) -> &'static str {
                match self {
                    $(Self::$name => $description,)+
                }
            }

            /// What it is of.
            pub(crate) const fn kind(self) -> ChannelKind {
                match self {
                    $(Self::$name => ChannelKind::$kind,)+
                }
            }
        }
    };
}
channels!(declare);

impl sweep_parameter::Channel for Channel {
    fn name(self) -> &'static str {
        self.name()
    }

    fn unit(self) -> &'static str {
        self.unit()
    }

    fn description(self) -> &'static str {
        self.description()
    }
}

/// A name that ends with its only zero byte.
const fn terminated(name: &'static str) -> &'static CStr {
    match CStr::from_bytes_with_nul(name.as_bytes()) {
        Ok(name) => name,
        Err(_) => panic!("a channel's name has no zero byte"),
    }
}

/// Number of channels.
pub(crate) const CHANNELS: usize = Channel::ALL.len();

impl Channel {
    /// Position in [`Channel::ALL`] and in the model's output vector.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// `"m"` or `"rad"`.
    pub const fn unit(self) -> &'static str {
        match self.kind() {
            ChannelKind::TubPoint | ChannelKind::DrumPoint => "m",
            ChannelKind::TubAngle => "rad",
        }
    }
}
