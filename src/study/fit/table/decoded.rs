//! The text of a table from its bytes.

use crate::scenario::MOST_BYTES;
use crate::study::fit::FitError;

/// The refusal of a line of a file.
pub fn refuse(file: &str, line: usize, why: impl std::fmt::Display) -> FitError {
    FitError::Data(format!("{file}:{line}: {why}"))
}

/// A text, and its encoding if that is not UTF-8.
pub struct Decoded {
    pub text: String,
    pub encoding: Option<&'static str>,
}

/// First bytes of archives, among them spreadsheets, and of older spreadsheets.
const SPREADSHEETS: [&[u8]; 2] = [b"PK\x03\x04", b"\xd0\xcf\x11\xe0"];

/// Decodes UTF-8, UTF-16 with a byte order mark, and Latin-1.
pub fn decode(bytes: &[u8], file: &str) -> Result<Decoded, FitError> {
    if bytes.len() as u64 > MOST_BYTES {
        let why = format!("is larger than {MOST_BYTES} bytes: keep every tenth row, or fewer");
        return Err(refuse(file, 1, why));
    }
    if SPREADSHEETS.iter().any(|first| bytes.starts_with(first)) {
        let why = "is a spreadsheet or another archive: export the table as CSV";
        return Err(refuse(file, 1, why));
    }
    let (text, encoding) = match bytes {
        [0xff, 0xfe, rest @ ..] => (utf16(rest, u16::from_le_bytes), Some("UTF-16")),
        [0xfe, 0xff, rest @ ..] => (utf16(rest, u16::from_be_bytes), Some("UTF-16")),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => (Some(text.into()), None),
            Err(_) => (latin_1(bytes), Some("Latin-1")),
        },
    };
    let Some(text) = text.filter(|text| !text.contains('\0')) else {
        return Err(refuse(
            file,
            1,
            "is not text in UTF-8: save the file as UTF-8",
        ));
    };
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    if text.contains('\r') && !text.contains('\n') {
        let why = "has line ends of CR alone: save it with line ends LF or CR LF";
        return Err(refuse(file, 1, why));
    }
    Ok(Decoded {
        text: text.into(),
        encoding,
    })
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Option<String> {
    let (pairs, rest) = bytes.as_chunks::<2>();
    let units: Vec<u16> = pairs.iter().map(|pair| unit(*pair)).collect();
    String::from_utf16(&units).ok().filter(|_| rest.is_empty())
}

/// The bytes from 0x80 to 0x9f have no characters in Latin-1, and different ones in its kin.
fn latin_1(bytes: &[u8]) -> Option<String> {
    let known = bytes.iter().all(|byte| !(0x80..0xa0).contains(byte));
    known.then(|| bytes.iter().copied().map(char::from).collect())
}
