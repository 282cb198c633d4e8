//! The text of a file from loggers and spreadsheets: UTF-8, UTF-16 or Windows code page 1252, with
//! the line ends of any system.

use super::ListError;

/// Kinds of files that are no text, by their first bytes, with advice.
const BINARY_KINDS: [(&[u8], &str); 7] = [
    (b"PK\x03\x04", "it is an Excel workbook or another zip file: save its sheet as CSV"),
    (b"\xd0\xcf\x11\xe0", "it is an old Excel workbook: save its sheet as CSV"),
    (b"\x1f\x8b", "it is packed by gzip: unpack it first"),
    (b"\x89HDF", "it is an HDF5 file: export the signals as CSV or Parquet"),
    (b"MATLAB 5.0", "it is a MATLAB file: write its signals by `writetable` as CSV or Parquet"),
    (b"TDSm", "it is a LabVIEW TDMS file: export it as .lvm or CSV"),
    (b"ARROW1", "it is an Arrow file: write it as Parquet"),
];

/// Number of bytes by which UTF-16 without a byte order mark is recognised. Basis: a header has
/// letters enough within it. Doubling it reads more of the file for that.
const UTF16_DETECTION_BYTES: usize = 512;

/// Returns the text of a file.
///
/// # Errors
/// The kind of the file, if it is no text.
pub(super) fn decode_text(bytes: Vec<u8>) -> Result<String, ListError> {
    if let Some((_, kind_and_advice)) =
        BINARY_KINDS.iter().find(|(magic_bytes, _)| bytes.starts_with(magic_bytes))
    {
        return Err((*kind_and_advice).to_owned());
    }
    let text = match utf16_decoder(&bytes) {
        Some(decode) => {
            let code_units = bytes.chunks_exact(2).map(|pair| decode([pair[0], pair[1]]));
            let code_units: Vec<u16> = code_units.collect();
            String::from_utf16(&code_units).map_err(|_| "it is damaged UTF-16 text".to_owned())?
        }
        None => decode_bytes(bytes)?,
    };
    // Old systems end lines by carriage returns alone.
    let has_carriage_returns_only = text.contains('\r') && !text.contains('\n');
    Ok(if has_carriage_returns_only { text.replace('\r', "\n") } else { text })
}

/// Returns the decoder of byte pairs if the text is UTF-16: by its mark, or by zeros in every other
/// byte, which no other text has.
fn utf16_decoder(bytes: &[u8]) -> Option<fn([u8; 2]) -> u16> {
    match bytes {
        [0xff, 0xfe, ..] => return Some(u16::from_le_bytes),
        [0xfe, 0xff, ..] => return Some(u16::from_be_bytes),
        _ => {}
    }
    let first_bytes = &bytes[..bytes.len().min(UTF16_DETECTION_BYTES)];
    let count_zeros =
        |parity: usize| first_bytes.iter().skip(parity).step_by(2).filter(|b| **b == 0).count();
    let pair_count = first_bytes.len() / 2;
    match [count_zeros(0), count_zeros(1)] {
        [0, odd] if pair_count > 0 && odd * 10 > pair_count * 9 => Some(u16::from_le_bytes),
        [even, 0] if pair_count > 0 && even * 10 > pair_count * 9 => Some(u16::from_be_bytes),
        _ => None,
    }
}

/// Decodes single bytes: UTF-8, or else code page 1252.
fn decode_bytes(bytes: Vec<u8>) -> Result<String, ListError> {
    let bytes = match String::from_utf8(bytes) {
        Ok(text) => return Ok(text),
        Err(error) => error.into_bytes(),
    };
    let is_control = |byte: &u8| *byte < 0x20 && !b"\t\r\n\x0c".contains(byte);
    if let Some(byte_index) = bytes.iter().position(is_control) {
        return Err(format!("it is neither Parquet nor text: byte {} is wrong", byte_index + 1));
    }
    Ok(bytes.into_iter().map(cp1252_letter).collect())
}

/// Returns the letter of a byte in Windows code page 1252: those of Latin-1, and others in place of
/// its control characters.
fn cp1252_letter(byte: u8) -> char {
    /// The first byte whose letter differs from Latin-1.
    const FIRST_DIFFERENT_BYTE: u8 = 0x80;
    /// The letters from that byte on.
    const LETTERS_FROM_FIRST: [char; 32] = [
        '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž',
        '\u{8f}', '\u{90}', '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}',
        'ž', 'Ÿ',
    ];
    let byte_index = byte.checked_sub(FIRST_DIFFERENT_BYTE).map(usize::from);
    byte_index
        .and_then(|byte_index| LETTERS_FROM_FIRST.get(byte_index))
        .copied()
        .unwrap_or(char::from(byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_encodings_are_detected() {
        let expected_text = "Weg [µm]\n1\n";
        let encode_utf16 = |order: fn(u16) -> [u8; 2], mark: &str| -> Vec<u8> {
            let text = format!("{mark}{expected_text}");
            text.encode_utf16().flat_map(order).collect()
        };
        for bytes in [
            expected_text.as_bytes().to_vec(),
            b"Weg [\xb5m]\n1\n".to_vec(),
            b"Weg [\xb5m]\r1\r".to_vec(),
            encode_utf16(u16::to_le_bytes, "\u{feff}"),
            encode_utf16(u16::to_be_bytes, "\u{feff}"),
            encode_utf16(u16::to_le_bytes, ""),
            encode_utf16(u16::to_be_bytes, ""),
        ] {
            let decoded_text = decode_text(bytes).unwrap();
            assert_eq!(decoded_text.trim_start_matches('\u{feff}'), expected_text);
        }
        assert_eq!(decode_text(b"\x80 \x93".to_vec()).unwrap(), "€ “");
    }

    #[test]
    fn other_kinds_of_files_are_named() {
        let decode_error = |bytes: &[u8]| decode_text(bytes.to_vec()).unwrap_err();
        assert!(decode_error(b"PK\x03\x04rest").contains("save its sheet as CSV"));
        assert!(decode_error(b"MATLAB 5.0 MAT-file").contains("writetable"));
        assert!(decode_error(b"a,b\n\xff\x01").contains("byte 6 is wrong"));
        assert!(decode_error(b"\xff\xfe\x00\xd8").contains("damaged UTF-16"));
    }
}
