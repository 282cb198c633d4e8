//! Enumerations whose values have names.

/// Declares an enumeration whose values have no data, each with its name in files. Adds `ALL` (its
/// values in the order of their codes), `name` and `named`.
#[macro_export]
macro_rules! named {
    (
        $(#[$type_attribute:meta])*
        $visible:vis enum $Type:ident {
            $($(#[$value_attribute:meta])* $One:ident = $name:literal,)+
        }
    ) => {
        $(#[$type_attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        $visible enum $Type {
            $($(#[$value_attribute])* $One,)+
        }

        impl $Type {
            /// Every value, in the order of the codes.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$One),+];

            /// Returns the name in files.
            pub const fn name(self) -> &'static str {
                [$($name),+][self as usize]
            }

            /// Finds the value of this name.
            pub fn named(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|value| value.name() == name)
            }
        }
    };
}
