//! Words for the variants of an enum, such as a method or an outcome.

/// A word that is not among those allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{found}: must be one of {}", allowed.join(", "))]
pub struct UnknownWord {
    /// The word.
    pub found: String,
    /// The allowed words.
    pub allowed: Vec<&'static str>,
}

/// Declares an enum by the words for its variants, with `ALL` and `word()`, on which everything
/// else is based.
#[doc(hidden)]
#[macro_export]
macro_rules! words {
    ($(
        $(#[$about:meta])*
        pub enum $type:ident {
            $($(#[$of:meta])* $variant:ident = $word:literal,)*
        }
    )*) => {$(
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $type {
            $($(#[$of])* $variant,)*
        }

        impl $type {
            /// All of them.
            pub const ALL: [$type; [$($word),*].len()] = [$($type::$variant),*];

            /// The word for it on the command line and in files.
            pub fn word(self) -> &'static str {
                match self {
                    $($type::$variant => $word),*
                }
            }
        }

        $crate::read_and_write!($type);
    )*};
}

/// Implements writing and parsing by word for types with `ALL` and `word()`.
#[doc(hidden)]
#[macro_export]
macro_rules! read_and_write {
    ($type:ty) => {
        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str(self.word())
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::study::UnknownWord;

            fn from_str(text: &str) -> std::result::Result<Self, Self::Err> {
                let found = Self::ALL.into_iter().find(|it| it.word() == text);
                found.ok_or_else(|| $crate::study::UnknownWord {
                    found: text.into(),
                    allowed: Self::ALL.map(|it| it.word()).to_vec(),
                })
            }
        }

        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
                serializer.serialize_str(self.word())
            }
        }

        impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
                let word = <String as serde::Deserialize>::deserialize(deserializer)?;
                word.parse().map_err(serde::de::Error::custom)
            }
        }
    };
}
