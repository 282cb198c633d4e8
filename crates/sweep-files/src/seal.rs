//! The digest in our Parquet files, which shows that their bytes are unchanged.
//!
//! The digest is the last entry of the file's key-value metadata ([`key::DIGEST`]): the BLAKE3 hash
//! of the whole file with zeros in the digest's own place. It covers the columns, the metadata and
//! the file's structure, and is checked before any of them is parsed. The digest depends on the
//! other bytes alone, so that the same input still makes the same file.

use std::io::{self, Read, Seek, SeekFrom, Write};

use parquet::file::metadata::KeyValue;

use crate::key;

/// Number of hexadecimal digits of a digest.
const DIGEST_DIGITS: usize = 2 * blake3::OUT_LEN;
/// Placeholder for a digest that is not computed yet.
const BLANK_DIGEST: [u8; DIGEST_DIGITS] = [b'0'; DIGEST_DIGITS];

/// Greatest distance of a digest from the end of its file, in bytes. Basis: only the number of
/// columns adds to it, some ten bytes each. Twice as many allow twice as many columns.
const TAIL_BYTES: u64 = 1 << 16;

/// The result of a comparison of a file with its digest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Seal {
    /// Every byte is as it was written.
    Whole,
    /// Some bytes have changed.
    Broken,
    /// The file has no digest where this program writes one.
    Absent,
}

/// Returns the metadata's last entry with a placeholder, which [`seal`] overwrites.
pub fn blank_digest() -> KeyValue {
    KeyValue::new(key::DIGEST.to_owned(), String::from_utf8_lossy(&BLANK_DIGEST).into_owned())
}

/// Writes the digest into a finished file that has a blank one ([`blank_digest`]).
///
/// # Errors
/// Fails if the file cannot be read or written, or has no blank digest.
pub fn seal(file: &mut (impl Read + Write + Seek)) -> io::Result<()> {
    let digest_offset = find_digest_offset(file)?
        .ok_or_else(|| io::Error::other("it has no place for its digest"))?;
    let digest = compute_digest(file, digest_offset)?;
    file.seek(SeekFrom::Start(digest_offset))?;
    file.write_all(digest.as_bytes())?;
    file.flush()
}

/// Compares a file with its digest.
pub(crate) fn check_seal(file: &mut (impl Read + Seek)) -> io::Result<Seal> {
    let Some(digest_offset) = find_digest_offset(file)? else { return Ok(Seal::Absent) };
    let mut found_digest = BLANK_DIGEST;
    file.seek(SeekFrom::Start(digest_offset))?;
    file.read_exact(&mut found_digest)?;
    Ok(if compute_digest(file, digest_offset)?.as_bytes() == found_digest {
        Seal::Whole
    } else {
        Seal::Broken
    })
}

/// Finds the place at which the digest begins.
fn find_digest_offset(file: &mut (impl Read + Seek)) -> io::Result<Option<u64>> {
    let file_length = file.seek(SeekFrom::End(0))?;
    let tail_start = file_length.saturating_sub(TAIL_BYTES);
    let mut tail = Vec::new();
    file.seek(SeekFrom::Start(tail_start))?;
    file.take(TAIL_BYTES).read_to_end(&mut tail)?;
    // Thrift's compact protocol writes the key, then 0x18 for a text, its length, and the text.
    let mut key_bytes = key::DIGEST.as_bytes().to_vec();
    key_bytes.extend_from_slice(&[0x18, DIGEST_DIGITS as u8]);
    let key_offset = tail.windows(key_bytes.len()).rposition(|window| window == key_bytes);
    let digest_offset = key_offset
        .map(|key_offset| key_offset + key_bytes.len())
        .filter(|digest_offset| digest_offset + DIGEST_DIGITS <= tail.len());
    Ok(digest_offset.map(|digest_offset| tail_start + digest_offset as u64))
}

/// Computes the digest of a file whose digest begins at `digest_offset`.
fn compute_digest(file: &mut (impl Read + Seek), digest_offset: u64) -> io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    file.seek(SeekFrom::Start(0))?;
    hasher.update_reader(file.by_ref().take(digest_offset))?;
    hasher.update(&BLANK_DIGEST);
    file.seek(SeekFrom::Start(digest_offset + DIGEST_DIGITS as u64))?;
    hasher.update_reader(file)?;
    Ok(hasher.finalize().to_hex().to_string())
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    /// Returns bytes with the end of a file, and their digest.
    fn sealed_file() -> Vec<u8> {
        let mut bytes = b"PAR1 columns and metadata ".to_vec();
        bytes.extend_from_slice(b"\x18\x0csweep.digest\x18\x40");
        bytes.extend_from_slice(&BLANK_DIGEST);
        bytes.extend_from_slice(b"\0 created by \x10\0\0\0PAR1");
        let mut file = Cursor::new(bytes);
        seal(&mut file).unwrap();
        file.into_inner()
    }

    #[test]
    fn every_flipped_bit_breaks_the_seal_or_hides_it() {
        let sealed_bytes = sealed_file();
        assert_eq!(check_seal(&mut Cursor::new(&sealed_bytes)).unwrap(), Seal::Whole);
        for bit in 0..8 * sealed_bytes.len() {
            let mut bytes = sealed_bytes.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert_ne!(check_seal(&mut Cursor::new(&bytes)).unwrap(), Seal::Whole, "bit {bit}");
        }
        for length in 0..sealed_bytes.len() {
            assert_ne!(
                check_seal(&mut Cursor::new(&sealed_bytes[..length])).unwrap(),
                Seal::Whole,
                "{length} bytes"
            );
        }
        let with_extra_byte = [sealed_bytes.as_slice(), b"x"].concat();
        assert_eq!(check_seal(&mut Cursor::new(&with_extra_byte)).unwrap(), Seal::Broken);
    }

    #[test]
    fn a_file_without_a_place_for_a_digest_has_none() {
        assert_eq!(check_seal(&mut Cursor::new(b"")).unwrap(), Seal::Absent);
        assert_eq!(
            check_seal(&mut Cursor::new(b"sweep.digest\x18\x40 and too little")).unwrap(),
            Seal::Absent
        );
        assert!(seal(&mut Cursor::new(b"PAR1".to_vec())).is_err());
    }
}
