//! Checksums of files and texts, to detect damage and changes.

use std::fmt::{self, Display};

/// The 64-bit FNV-1a hash, stable across releases: detects damage, not malice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Checksum(u64);

impl Checksum {
    /// The checksum of no bytes.
    pub fn new() -> Self {
        Checksum(0xcbf2_9ce4_8422_2325)
    }

    pub fn add(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    /// The checksum of a formatted text, which is never assembled.
    pub fn of(text: fmt::Arguments) -> Self {
        let mut sum = Checksum::new();
        // Adding to a sum cannot fail.
        let _ = fmt::write(&mut sum, text);
        sum
    }
}

impl fmt::Write for Checksum {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.add(text.as_bytes());
        Ok(())
    }
}

/// Sixteen hexadecimal digits.
impl Display for Checksum {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "{:016x}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_values() {
        for (text, sum) in [
            ("", "cbf29ce484222325"),
            ("a", "af63dc4c8601ec8c"),
            ("foobar", "85944171f73967e8"),
        ] {
            assert_eq!(Checksum::of(format_args!("{text}")).to_string(), sum);
        }
    }
}
