//! The unpacked size of a column's pages, from their own headers.
//!
//! A page of a few kilobytes may unpack into gigabytes, and the library makes room for whatever a
//! header declares. So the headers are walked beforehand. They are structs in Thrift's compact
//! protocol.

use std::io::Read as _;

use flate2::read::MultiGzDecoder;
use parquet::basic::Compression;

use super::{LONGEST_BYTES, Unreadable};

/// Structs within structs of a page header: the page's own, and its statistics.
const DEEPEST: usize = 3;

/// Bytes of the smallest number that a dictionary holds.
const SMALLEST_NUMBER_BYTES: u64 = 4;

/// Kinds of a field.
const TRUE: u8 = 1;
const FALSE: u8 = 2;
const I8: u8 = 3;
const I16: u8 = 4;
const I32: u8 = 5;
const I64: u8 = 6;
const DOUBLE: u8 = 7;
const BINARY: u8 = 8;
const STRUCT: u8 = 12;

/// Numbers of a page header that matter here.
#[derive(Default)]
struct Header {
    /// Bytes with and without compression.
    unpacked: i32,
    packed: i32,
    /// Entries of a dictionary.
    dictionary: i32,
    /// Bytes before what is compressed, in pages of the second version.
    levels: [i32; 2],
    is_plain: bool,
}

/// Bytes of all pages of a column chunk, unpacked. What its headers declare is true, or at most
/// what the library would unpack.
pub(super) fn unpacked_bytes(chunk: &[u8], codec: Compression) -> Result<u64, Unreadable> {
    let mut rest = chunk;
    let mut total = 0_u64;
    while !rest.is_empty() {
        let (header, page);
        (header, rest) = Header::read(rest).ok_or_else(senseless)?;
        let size = |declared: i32| u64::try_from(declared).map_err(|_| senseless());
        let (unpacked, packed) = (size(header.unpacked)?, size(header.packed)?);
        if SMALLEST_NUMBER_BYTES * size(header.dictionary)? > unpacked {
            return Err(senseless());
        }
        (page, rest) = rest.split_at_checked(packed as usize).ok_or_else(senseless)?;
        total = total.saturating_add(unpacked);
        if total > LONGEST_BYTES {
            return Err(Unreadable::TooLongUnpacked);
        }
        if matches!(codec, Compression::GZIP(_)) && !header.is_plain {
            let levels = size(header.levels[0])? + size(header.levels[1])?;
            check_gzip(page, levels, unpacked)?;
        }
    }
    Ok(total)
}

/// Of the codecs, gzip alone is unpacked to its end whatever the header declares.
fn check_gzip(page: &[u8], levels: u64, unpacked: u64) -> Result<(), Unreadable> {
    let packed = usize::try_from(levels).ok().and_then(|levels| page.get(levels..));
    let packed = packed.ok_or_else(senseless)?;
    let most = unpacked.saturating_sub(levels);
    let mut decoder = MultiGzDecoder::new(packed).take(most + 1);
    // The library reports bytes that are not gzip.
    match std::io::copy(&mut decoder, &mut std::io::sink()) {
        Ok(found) if found > most => Err(senseless()),
        _ => Ok(()),
    }
}

fn senseless() -> Unreadable {
    Unreadable::Damaged("the header of a page makes no sense".to_owned())
}

impl Header {
    /// The header at the beginning of some bytes, and what follows it.
    fn read(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let mut header = Self::default();
        let mut thrift = Thrift(bytes);
        thrift.fields(&mut Vec::new(), &mut |path, number| match path {
            [2] => header.unpacked = number,
            [3] => header.packed = number,
            [7, 1] => header.dictionary = number,
            [8, 5] => header.levels[0] = number,
            [8, 6] => header.levels[1] = number,
            [8, 7] => header.is_plain = number == 0,
            _ => {}
        })?;
        Some((header, thrift.0))
    }
}

/// Whether a field of a page header may be of this kind. The library reads each as what it should
/// be, whatever kind the file declares, so another one would part its reading from this one.
fn is_kind(path: &[i16], kind: u8) -> bool {
    match path {
        [1..=4] | [5, 1..=4] | [7, 1..=2] | [8, 1..=6] => kind == I32,
        [5..=8] | [5, 5] | [8, 8] => kind == STRUCT,
        [7, 3] | [8, 7] => matches!(kind, TRUE | FALSE),
        _ => true,
    }
}

/// Bytes in the compact protocol that are yet to be read.
struct Thrift<'a>(&'a [u8]);

impl Thrift<'_> {
    /// Reads a struct to its end, and hands over each number by the fields that lead to it; true is
    /// 1.
    fn fields(&mut self, path: &mut Vec<i16>, found: &mut dyn FnMut(&[i16], i32)) -> Option<()> {
        let mut field = 0_i16;
        loop {
            let head = self.byte()?;
            let (step, kind) = (head >> 4, head & 0xf);
            if kind == 0 {
                return Some(());
            }
            if step == 0 {
                // A field far from the one before it: a page header has none.
                return None;
            }
            field = field.checked_add(i16::from(step))?;
            path.push(field);
            if !is_kind(path, kind) {
                return None;
            }
            match kind {
                TRUE | FALSE => found(path, i32::from(kind == TRUE)),
                I8 => self.skip(1)?,
                // As the library does, which drops what is beyond the type.
                I16 | I32 | I64 => found(path, self.number()? as i32),
                DOUBLE => self.skip(8)?,
                BINARY => {
                    let length = self.varint()?;
                    self.skip(length)?;
                }
                STRUCT if path.len() < DEEPEST => self.fields(path, found)?,
                _ => return None,
            }
            path.pop();
        }
    }

    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    fn skip(&mut self, length: u64) -> Option<()> {
        self.0 = self.0.get(usize::try_from(length).ok()?..)?;
        Some(())
    }

    /// A number in groups of seven bits, the lowest first.
    fn varint(&mut self) -> Option<u64> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
        None
    }

    /// One whose lowest bit is its sign.
    fn number(&mut self) -> Option<i64> {
        let number = self.varint()?;
        Some((number >> 1) as i64 ^ -((number & 1) as i64))
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use flate2::write::GzEncoder;

    use super::*;

    /// A number whose lowest bit is its sign, in groups of seven bits.
    fn number(value: i32) -> Vec<u8> {
        let mut rest = ((i64::from(value) << 1) ^ (i64::from(value) >> 63)) as u64;
        let mut bytes = Vec::new();
        while rest >= 0x80 {
            bytes.push(rest as u8 | 0x80);
            rest >>= 7;
        }
        bytes.push(rest as u8);
        bytes
    }

    /// A page of the first version with a header that declares these sizes.
    fn page(unpacked: i32, packed: &[u8]) -> Vec<u8> {
        let sizes = [number(0), number(unpacked), number(packed.len() as i32)];
        let size = |size: &Vec<u8>| [&[0x15], size.as_slice()].concat();
        let mut bytes: Vec<u8> = sizes.iter().flat_map(size).collect();
        // Field 5, the data page's own: four numbers.
        bytes.extend([0x2c, 0x15, 2, 0x15, 0, 0x15, 6, 0x15, 6, 0, 0]);
        bytes.extend(packed);
        bytes
    }

    /// A dictionary's, with so many entries.
    fn dictionary(unpacked: i32, entries: i32) -> Vec<u8> {
        let unpacked = number(unpacked);
        let mut bytes = [&[0x15, 4, 0x15], unpacked.as_slice(), &[0x15, 0, 0x4c, 0x15]].concat();
        bytes.extend(number(entries));
        bytes.extend([0x15, 0, 0, 0]);
        bytes
    }

    fn told(chunk: &[u8], codec: Compression) -> String {
        match unpacked_bytes(chunk, codec) {
            Ok(bytes) => bytes.to_string(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn pages_add_up_and_declarations_have_a_bound() {
        let two = [page(100, &[1; 10]), page(50, &[2; 60])].concat();
        assert_eq!(told(&two, Compression::SNAPPY), "150");
        let large = page(i32::MAX, &[0; 40]);
        assert!(told(&large, Compression::SNAPPY).contains("longer than 256 MiB"));
        let many = page(200 << 20, &[0; 40]).repeat(2);
        assert!(told(&many, Compression::ZSTD(Default::default())).contains("longer than 256 MiB"));
    }

    #[test]
    fn a_dictionary_has_no_more_entries_than_fit() {
        assert_eq!(told(&dictionary(80, 10), Compression::UNCOMPRESSED), "80");
        assert!(told(&dictionary(80, i32::MAX), Compression::UNCOMPRESSED).contains("no sense"));
    }

    #[test]
    fn gzip_that_unpacks_into_more_than_declared_is_refused() {
        let mut encoder = GzEncoder::new(Vec::new(), flate2::Compression::best());
        encoder.write_all(&vec![0; 50_000_000]).unwrap();
        let packed = encoder.finish().unwrap();
        assert!(packed.len() < 100_000, "{}", packed.len());
        let gzip = Compression::GZIP(Default::default());
        assert_eq!(told(&page(50_000_000, &packed), gzip), "50000000");
        assert!(told(&page(49_999_999, &packed), gzip).contains("no sense"));
    }

    #[test]
    fn headers_that_make_no_sense_are_refused() {
        let sound = page(100, &[1; 10]);
        for length in 1..sound.len() {
            assert!(told(&sound[..length], Compression::SNAPPY).contains("no sense"), "{length}");
        }
        // A size as a text, which a reader that trusts the schema would take for a number; and a
        // field number in full.
        for (at, kind) in [(2, 0x18), (2, 0x05)] {
            let mut other = sound.clone();
            other[at] = kind;
            assert!(told(&other, Compression::SNAPPY).contains("no sense"), "{at}: {kind:#x}");
        }
        assert!(told(&page(-1, &[1; 10]), Compression::SNAPPY).contains("no sense"));
    }
}
