//! The channels: motions that are compared between the two models.

use core::ffi::CStr;

/// Passes the table of channels to the macro `$then`, in the order of the models' output vectors. A
/// row has all properties of a channel:
///
/// - the variant, the name and the description;
/// - the kind ([`ChannelKind`]);
/// - the output of the nonlinear model: `point` with an entry of `outputs::ChannelPoints` and an
///   axis, or `angle` with a coordinate;
/// - `steady`: the coordinates on which the linear model's output depends;
/// - `turning`, if the output has harmonics of theta: the coordinates on which the cosine part and
///   the sine part depend, and the parts (0: steady, 1: cosine, 2: sine) that are not 0 at rest.
///
/// At the equilibrium the unbalance is up and the hinge is bent in the vertical plane only, so that
/// no output along c2 has a sine at rest.
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

/// The kind of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ChannelKind {
    /// A point whose motion is mostly that of the tub.
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
        /// A motion that is compared between the two models, as deviation from the static
        /// equilibrium.
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

            /// Returns the name in grid files and column names.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => $key,)+
                }
            }

            /// Returns the name as a C string, for `washer-capi`.
            pub const fn c_name(self) -> &'static CStr {
                match self {
                    $(Self::$name => to_c_string(concat!($key, "\0")),)+
                }
            }

            /// Returns the description in one line.
            pub const fn description(self) -> &'static str {
                match self {
                    $(Self::$name => $description,)+
                }
            }

            pub(crate) const fn kind(self) -> ChannelKind {
                match self {
                    $(Self::$name => ChannelKind::$kind,)+
                }
            }
        }
    };
}
channels!(declare);

/// Returns a name that ends with a zero byte as a C string.
const fn to_c_string(name: &'static str) -> &'static CStr {
    match CStr::from_bytes_with_nul(name.as_bytes()) {
        Ok(name) => name,
        Err(_) => panic!("a channel's name has no zero byte"),
    }
}

/// The number of channels.
pub(crate) const CHANNELS: usize = Channel::ALL.len();

impl Channel {
    /// Returns the position in [`Channel::ALL`] and in the model's output vector.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Returns the unit, `"m"` or `"rad"`.
    pub const fn unit(self) -> &'static str {
        match self.kind() {
            ChannelKind::TubPoint | ChannelKind::DrumPoint => "m",
            ChannelKind::TubAngle => "rad",
        }
    }
}
