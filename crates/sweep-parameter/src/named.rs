//! Enumerations whose values have names.

/// An enumeration of values without data, each with its name in files: the type, `ALL` of its
/// values in the order of their codes, `name`, and `named`.
#[macro_export]
macro_rules! named {
    (
        $(#[$of_all:meta])*
        $visible:vis enum $Type:ident { $($(#[$of_one:meta])* $One:ident = $name:literal,)+ }
    ) => {
        $(#[$of_all])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        $visible enum $Type {
            $($(#[$of_one])* $One,)+
        }

        impl $Type {
            /// Every one, in the order of their codes.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$One),+];

            /// Name in files.
            pub const fn name(self) -> &'static str {
                [$($name),+][self as usize]
            }

            /// The one of this name.
            pub fn named(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|one| one.name() == name)
            }
        }
    };
}
