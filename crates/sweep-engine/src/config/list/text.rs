//! Text of a file as loggers and spreadsheets write it: UTF-8, UTF-16 or Windows' western letters,
//! with the line ends of any system.

use super::Unreadable;

/// Kinds of file that are no text, by their first bytes, and what to do with them.
const OTHER_KINDS: [(&[u8], &str); 7] = [
    (b"PK\x03\x04", "it is an Excel workbook or another zip file: save its sheet as CSV"),
    (b"\xd0\xcf\x11\xe0", "it is an old Excel workbook: save its sheet as CSV"),
    (b"\x1f\x8b", "it is packed by gzip: unpack it first"),
    (b"\x89HDF", "it is an HDF5 file: export the signals as CSV or Parquet"),
    (b"MATLAB 5.0", "it is a MATLAB file: write its signals by `writetable` as CSV or Parquet"),
    (b"TDSm", "it is a LabVIEW TDMS file: export it as .lvm or CSV"),
    (b"ARROW1", "it is an Arrow file: write it as Parquet"),
];

/// Bytes by which text without a byte order mark is told from UTF-16.
const LOOKED_AT: usize = 512;

/// Returns the text of a file.
///
/// # Errors
/// The kind of the file, if it is no text.
pub(super) fn text(bytes: Vec<u8>) -> Result<String, Unreadable> {
    if let Some((_, kind)) = OTHER_KINDS.iter().find(|(first, _)| bytes.starts_with(first)) {
        return Err((*kind).to_owned());
    }
    let text = match wide(&bytes) {
        Some(read) => {
            let units = bytes.chunks_exact(2).map(|pair| read([pair[0], pair[1]]));
            let units: Vec<u16> = units.collect();
            String::from_utf16(&units).map_err(|_| "it is damaged UTF-16 text".to_owned())?
        }
        None => narrow(bytes)?,
    };
    // Old systems end lines by carriage returns alone.
    let has_old_ends = text.contains('\r') && !text.contains('\n');
    Ok(if has_old_ends { text.replace('\r', "\n") } else { text })
}

/// Returns how to read pairs of bytes, if they are UTF-16: by its mark, or by bytes of zero in
/// every other place, which no other text has.
fn wide(bytes: &[u8]) -> Option<fn([u8; 2]) -> u16> {
    match bytes {
        [0xff, 0xfe, ..] => return Some(u16::from_le_bytes),
        [0xfe, 0xff, ..] => return Some(u16::from_be_bytes),
        _ => {}
    }
    let begin = &bytes[..bytes.len().min(LOOKED_AT)];
    let zeros = |parity: usize| begin.iter().skip(parity).step_by(2).filter(|b| **b == 0).count();
    let pairs = begin.len() / 2;
    match [zeros(0), zeros(1)] {
        [0, odd] if pairs > 0 && odd * 10 > pairs * 9 => Some(u16::from_le_bytes),
        [even, 0] if pairs > 0 && even * 10 > pairs * 9 => Some(u16::from_be_bytes),
        _ => None,
    }
}

/// Returns the text of single bytes: UTF-8, else Windows' western letters.
fn narrow(bytes: Vec<u8>) -> Result<String, Unreadable> {
    let bytes = match String::from_utf8(bytes) {
        Ok(text) => return Ok(text),
        Err(error) => error.into_bytes(),
    };
    let is_control = |byte: &u8| *byte < 0x20 && !b"\t\r\n\x0c".contains(byte);
    if let Some(place) = bytes.iter().position(is_control) {
        return Err(format!("it is neither Parquet nor text: byte {} is wrong", place + 1));
    }
    Ok(bytes.into_iter().map(letter).collect())
}

/// Returns the letter of a byte in Windows' western letters (code page 1252): those of Latin-1, and
/// others in place of its control characters.
fn letter(byte: u8) -> char {
    const FIRST: u8 = 0x80;
    const LETTERS: [char; 32] = [
        '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž',
        '\u{8f}', '\u{90}', '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}',
        'ž', 'Ÿ',
    ];
    let place = byte.checked_sub(FIRST).map(usize::from);
    place.and_then(|place| LETTERS.get(place)).copied().unwrap_or(char::from(byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_every_system_are_read() {
        let expected = "Weg [µm]\n1\n";
        let wide = |order: fn(u16) -> [u8; 2], mark: &str| -> Vec<u8> {
            let text = format!("{mark}{expected}");
            text.encode_utf16().flat_map(order).collect()
        };
        for bytes in [
            expected.as_bytes().to_vec(),
            b"Weg [\xb5m]\n1\n".to_vec(),
            b"Weg [\xb5m]\r1\r".to_vec(),
            wide(u16::to_le_bytes, "\u{feff}"),
            wide(u16::to_be_bytes, "\u{feff}"),
            wide(u16::to_le_bytes, ""),
            wide(u16::to_be_bytes, ""),
        ] {
            let read = text(bytes).unwrap();
            assert_eq!(read.trim_start_matches('\u{feff}'), expected);
        }
        assert_eq!(text(b"\x80 \x93".to_vec()).unwrap(), "€ “");
    }

    #[test]
    fn what_is_no_text_is_told_by_its_kind() {
        let said = |bytes: &[u8]| text(bytes.to_vec()).unwrap_err();
        assert!(said(b"PK\x03\x04rest").contains("save its sheet as CSV"));
        assert!(said(b"MATLAB 5.0 MAT-file").contains("writetable"));
        assert!(said(b"a,b\n\xff\x01").contains("byte 6 is wrong"));
        assert!(said(b"\xff\xfe\x00\xd8").contains("damaged UTF-16"));
    }
}
