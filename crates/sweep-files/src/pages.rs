//! The unpacked size of a column's pages, from their own headers.
//!
//! A page of a few kilobytes may unpack into gigabytes, and the library makes room for whatever a
//! header declares. So the headers are walked beforehand.

use std::io::{self, Read, Seek, SeekFrom};

use flate2::read::MultiGzDecoder;
use parquet::basic::Compression;

use crate::footer::{Refused, STATISTICS};
use crate::thrift::{self, Found, Shape, Wire};
use Wire::{Bool, Number, Struct};

/// How many bytes are read for a header: the first number is enough for nearly every one, and no
/// header has more than the last.
const HEADER_BYTES: [u64; 3] = [256, 4 << 10, 64 << 10];

/// Bytes of the smallest number that a dictionary holds.
const SMALLEST_NUMBER_BYTES: u64 = 4;

/// What the library takes the fields of a page header for.
const PAGE_HEADER: Shape = &[
    (1..=4, Number),
    (5..=5, Struct(&[(1..=4, Number), (5..=5, Struct(STATISTICS))])),
    (6..=6, Struct(&[])),
    (7..=7, Struct(&[(1..=2, Number), (3..=3, Bool)])),
    (8..=8, Struct(&[(1..=6, Number), (7..=7, Bool), (8..=8, Struct(STATISTICS))])),
];

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

/// Sizes of a column chunk, unpacked (bytes).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unpacked {
    /// All its pages together.
    pub total: u64,
    /// The dictionary and the largest page together: what a reader holds at once.
    pub at_once: u64,
}

/// Sizes of the column chunk in these bytes of a file, which are at most these. What its headers
/// declare is true, or at most what the library would unpack.
///
/// # Errors
/// [`Refused`].
pub fn unpacked(
    file: &mut (impl Read + Seek),
    start: u64,
    length: u64,
    codec: Compression,
    most: Unpacked,
) -> Result<Unpacked, Refused> {
    let end = start.checked_add(length).ok_or(Refused::PageHeader)?;
    let (mut at, mut dictionary, mut largest) = (start, 0, 0);
    let mut sizes = Unpacked::default();
    while at < end {
        let (header, header_bytes) = header(file, at, end)?;
        at += header_bytes;
        let size = |declared: i32| u64::try_from(declared).map_err(|_| Refused::PageHeader);
        let (unpacked, packed) = (size(header.unpacked)?, size(header.packed)?);
        if SMALLEST_NUMBER_BYTES * size(header.dictionary)? > unpacked || packed > end - at {
            return Err(Refused::PageHeader);
        }
        sizes.total = sizes.total.saturating_add(unpacked);
        let kind = if header.dictionary > 0 { &mut dictionary } else { &mut largest };
        *kind = unpacked.max(*kind);
        sizes.at_once = dictionary.saturating_add(largest);
        if sizes.total > most.total || sizes.at_once > most.at_once {
            return Err(Refused::TooLong);
        }
        if matches!(codec, Compression::GZIP(_)) && !header.is_plain {
            let levels = size(header.levels[0])? + size(header.levels[1])?;
            file.seek(SeekFrom::Start(at.saturating_add(levels)))?;
            let page = packed.checked_sub(levels).ok_or(Refused::PageHeader)?;
            check_gzip(file.take(page), unpacked.saturating_sub(levels))?;
        }
        at += packed;
    }
    Ok(sizes)
}

/// The header of the page that begins here, and how many bytes it takes.
fn header(file: &mut (impl Read + Seek), at: u64, end: u64) -> Result<(Header, u64), Refused> {
    let mut bytes = Vec::new();
    for most in HEADER_BYTES {
        file.seek(SeekFrom::Start(at + bytes.len() as u64))?;
        let more = most.min(end - at) - bytes.len() as u64;
        file.take(more).read_to_end(&mut bytes)?;
        if let Some((header, rest)) = Header::read(&bytes) {
            return Ok((header, (bytes.len() - rest.len()) as u64));
        }
    }
    Err(Refused::PageHeader)
}

/// Gzip is the only codec that is unpacked to its end whatever the header declares.
fn check_gzip(packed: impl Read, most: u64) -> Result<(), Refused> {
    let mut decoder = MultiGzDecoder::new(packed).take(most + 1);
    // The library reports bytes that are not gzip.
    match io::copy(&mut decoder, &mut io::sink()) {
        Ok(found) if found > most => Err(Refused::PageHeader),
        _ => Ok(()),
    }
}

impl Header {
    /// The header at the beginning of some bytes, and what follows it.
    fn read(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let mut header = Self::default();
        let rest = thrift::walk(bytes, PAGE_HEADER, &mut |path, found| {
            let Found::Number(number) = found else { return };
            // As the library does, which drops what is beyond the type.
            let number = number as i32;
            match path {
                [2] => header.unpacked = number,
                [3] => header.packed = number,
                [7, 1] => header.dictionary = number,
                [8, 5] => header.levels[0] = number,
                [8, 6] => header.levels[1] = number,
                [8, 7] => header.is_plain = number == 0,
                _ => {}
            }
        })?;
        Some((header, rest))
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Cursor, Write as _};

    use flate2::write::GzEncoder;

    use super::*;
    use crate::thrift::encode::{number, varint};

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

    fn sizes(chunk: &[u8], codec: Compression) -> Result<Unpacked, Refused> {
        // Something stands before and behind it.
        let file = [&[9; 5], chunk, &[9; 500]].concat();
        let most = Unpacked { total: 10 << 30, at_once: 0x7fff_ffff };
        unpacked(&mut Cursor::new(file), 5, chunk.len() as u64, codec, most)
    }

    fn told(chunk: &[u8], codec: Compression) -> String {
        match sizes(chunk, codec) {
            Ok(sizes) => sizes.total.to_string(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn pages_add_up_and_one_is_held_at_once_beside_its_dictionary() {
        let chunk = [dictionary(80, 10), page(100, &[1; 10]), page(50, &[2; 60])].concat();
        let found = sizes(&chunk, Compression::SNAPPY).unwrap();
        assert_eq!(found, Unpacked { total: 230, at_once: 180 });
        let many = page(i32::MAX, &[0; 40]).repeat(3);
        let found = sizes(&many, Compression::ZSTD(Default::default())).unwrap();
        assert_eq!(found, Unpacked { total: 3 * 0x7fff_ffff, at_once: 0x7fff_ffff });
        let many = page(i32::MAX, &[0; 40]).repeat(6);
        assert!(told(&many, Compression::SNAPPY).contains("too many bytes"));
        let both = [dictionary(80, 10), page(i32::MAX, &[0; 40])].concat();
        assert!(told(&both, Compression::SNAPPY).contains("too many bytes"));
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
    fn headers_with_long_statistics_are_read() {
        for length in [10_usize, 300, 5000, 60_000, 70_000] {
            let mut bytes = [&[0x15, 0, 0x15], number(100).as_slice(), &[0x15, 0]].concat();
            // Statistics, whose first field is a text.
            bytes.extend([0x2c, 0x15, 2, 0x15, 0, 0x15, 6, 0x15, 6, 0x1c, 0x18]);
            bytes.extend(varint(length as u64));
            bytes.extend(vec![7; length]);
            bytes.extend([0, 0, 0]);
            let expected = if length < 65_000 { "100" } else { "no sense" };
            assert!(told(&bytes, Compression::SNAPPY).contains(expected), "{length}");
        }
    }

    #[test]
    fn headers_that_make_no_sense_are_refused() {
        let sound = page(100, &[1; 10]);
        for length in 1..sound.len() {
            assert!(told(&sound[..length], Compression::SNAPPY).contains("no sense"), "{length}");
        }
        // A size as a text, which a reader that trusts the schema would take for a number.
        let mut other = sound;
        other[2] = 0x18;
        assert!(told(&other, Compression::SNAPPY).contains("no sense"));
        assert!(told(&page(-1, &[1; 10]), Compression::SNAPPY).contains("no sense"));
    }
}
