//! Computes the unpacked size of a column's pages from the page headers.
//!
//! A page of a few kilobytes may unpack into gigabytes, and the library allocates the size that a
//! header declares. So the headers are read before the library reads the pages.

use std::io::{self, Read, Seek, SeekFrom};

use flate2::read::MultiGzDecoder;
use parquet::basic::Compression;

use crate::footer::{Refused, STATISTICS};
use crate::thrift::{self, Found, Shape, Wire};
use Wire::{Bool, Number, Struct};

/// Numbers of bytes that are read to parse a header, one after the other until it is complete. The
/// first is enough for nearly every header, and no sound header is longer than the last.
const HEADER_BYTES: [u64; 3] = [256, 4 << 10, 64 << 10];

/// Size of the smallest number in a dictionary, in bytes.
const SMALLEST_NUMBER_BYTES: u64 = 4;

/// The types as which the library reads the fields of a page header.
const PAGE_HEADER: Shape = &[
    (1..=4, Number),
    (5..=5, Struct(&[(1..=4, Number), (5..=5, Struct(STATISTICS))])),
    (6..=6, Struct(&[])),
    (7..=7, Struct(&[(1..=2, Number), (3..=3, Bool)])),
    (8..=8, Struct(&[(1..=6, Number), (7..=7, Bool), (8..=8, Struct(STATISTICS))])),
];

/// The fields of a page header that are used here.
#[derive(Default)]
struct Header {
    /// The page's sizes without and with compression (bytes).
    unpacked: i32,
    packed: i32,
    /// The number of entries, if the page is a dictionary.
    dictionary: i32,
    /// The sizes of the two parts before the compressed one, in data pages of version 2 (bytes).
    levels: [i32; 2],
    is_plain: bool,
}

/// The unpacked sizes of a column chunk (bytes).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unpacked {
    /// The sum over all pages.
    pub total: u64,
    /// The dictionary and the largest page together, which a reader holds at once.
    pub at_once: u64,
}

/// Computes the unpacked sizes of the column chunk that takes `length` bytes of a file from
/// `start`. A page counts as its header declares; pages that the library would unpack further than
/// that are refused.
///
/// # Errors
/// [`Refused::TooLong`] if a size exceeds that in `most`, [`Refused::PageHeader`], [`Refused::Io`].
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
            let compressed_bytes = packed.checked_sub(levels).ok_or(Refused::PageHeader)?;
            check_gzip(file.take(compressed_bytes), unpacked.saturating_sub(levels))?;
        }
        at += packed;
    }
    Ok(sizes)
}

/// Reads the header of the page that begins at `at`, and returns it with its length (bytes).
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

/// Checks that a page unpacks into at most `most` bytes. The library unpacks gzip, and no other
/// codec, to its end, even beyond the size in the header.
fn check_gzip(packed: impl Read, most: u64) -> Result<(), Refused> {
    let mut decoder = MultiGzDecoder::new(packed).take(most + 1);
    // Bytes that are not gzip pass: the library reports them.
    match io::copy(&mut decoder, &mut io::sink()) {
        Ok(found) if found > most => Err(Refused::PageHeader),
        _ => Ok(()),
    }
}

impl Header {
    /// Parses the header at the beginning of `bytes`, and returns it with the bytes behind it.
    fn read(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let mut header = Self::default();
        let rest = thrift::walk(bytes, PAGE_HEADER, &mut |path, found| {
            let Found::Number(number) = found else { return };
            // The library truncates numbers to this type too.
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

    /// Encodes a page of version 1 whose header declares these sizes.
    fn page(unpacked: i32, packed: &[u8]) -> Vec<u8> {
        let sizes = [number(0), number(unpacked), number(packed.len() as i32)];
        let size = |size: &Vec<u8>| [&[0x15], size.as_slice()].concat();
        let mut bytes: Vec<u8> = sizes.iter().flat_map(size).collect();
        // Field 5, the data page's header: four numbers.
        bytes.extend([0x2c, 0x15, 2, 0x15, 0, 0x15, 6, 0x15, 6, 0, 0]);
        bytes.extend(packed);
        bytes
    }

    /// Encodes a dictionary page that declares this number of entries.
    fn dictionary(unpacked: i32, entries: i32) -> Vec<u8> {
        let unpacked = number(unpacked);
        let mut bytes = [&[0x15, 4, 0x15], unpacked.as_slice(), &[0x15, 0, 0x4c, 0x15]].concat();
        bytes.extend(number(entries));
        bytes.extend([0x15, 0, 0, 0]);
        bytes
    }

    fn sizes(chunk: &[u8], codec: Compression) -> Result<Unpacked, Refused> {
        // Other bytes stand before and behind the column chunk.
        let file = [&[9; 5], chunk, &[9; 500]].concat();
        let most = Unpacked { total: 10 << 30, at_once: 0x7fff_ffff };
        unpacked(&mut Cursor::new(file), 5, chunk.len() as u64, codec, most)
    }

    fn size_or_error(chunk: &[u8], codec: Compression) -> String {
        match sizes(chunk, codec) {
            Ok(sizes) => sizes.total.to_string(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn sizes_are_the_sum_of_pages_and_the_largest_page_with_the_dictionary() {
        let chunk = [dictionary(80, 10), page(100, &[1; 10]), page(50, &[2; 60])].concat();
        let found = sizes(&chunk, Compression::SNAPPY).unwrap();
        assert_eq!(found, Unpacked { total: 230, at_once: 180 });
        let many = page(i32::MAX, &[0; 40]).repeat(3);
        let found = sizes(&many, Compression::ZSTD(Default::default())).unwrap();
        assert_eq!(found, Unpacked { total: 3 * 0x7fff_ffff, at_once: 0x7fff_ffff });
        let many = page(i32::MAX, &[0; 40]).repeat(6);
        assert!(size_or_error(&many, Compression::SNAPPY).contains("too many bytes"));
        let both = [dictionary(80, 10), page(i32::MAX, &[0; 40])].concat();
        assert!(size_or_error(&both, Compression::SNAPPY).contains("too many bytes"));
    }

    #[test]
    fn a_dictionary_that_declares_more_entries_than_fit_is_refused() {
        assert_eq!(size_or_error(&dictionary(80, 10), Compression::UNCOMPRESSED), "80");
        assert!(
            size_or_error(&dictionary(80, i32::MAX), Compression::UNCOMPRESSED)
                .contains("no sense")
        );
    }

    #[test]
    fn gzip_that_unpacks_into_more_than_declared_is_refused() {
        let mut encoder = GzEncoder::new(Vec::new(), flate2::Compression::best());
        encoder.write_all(&vec![0; 50_000_000]).unwrap();
        let packed = encoder.finish().unwrap();
        assert!(packed.len() < 100_000, "{}", packed.len());
        let gzip = Compression::GZIP(Default::default());
        assert_eq!(size_or_error(&page(50_000_000, &packed), gzip), "50000000");
        assert!(size_or_error(&page(49_999_999, &packed), gzip).contains("no sense"));
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
            assert!(size_or_error(&bytes, Compression::SNAPPY).contains(expected), "{length}");
        }
    }

    #[test]
    fn headers_that_make_no_sense_are_refused() {
        let sound = page(100, &[1; 10]);
        for length in 1..sound.len() {
            assert!(
                size_or_error(&sound[..length], Compression::SNAPPY).contains("no sense"),
                "{length}"
            );
        }
        // A size as a text, which a reader that trusts the schema would take for a number.
        let mut other = sound;
        other[2] = 0x18;
        assert!(size_or_error(&other, Compression::SNAPPY).contains("no sense"));
        assert!(size_or_error(&page(-1, &[1; 10]), Compression::SNAPPY).contains("no sense"));
    }
}
