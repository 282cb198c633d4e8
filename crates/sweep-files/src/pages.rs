//! Opens the pages of a column, and bounds the memory that the library takes for them.
//!
//! The library asks for the header of a page before it reads the page. Each header is checked at
//! that moment, because the library trusts it; `thrift` says where.

use std::collections::HashMap;
use std::io::{self, Cursor, Read as _};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use bytes::Bytes;
use flate2::read::MultiGzDecoder;
use parquet::basic::{Compression, Encoding, Type};
use parquet::column::reader::{ColumnReader, get_column_reader};
use parquet::errors::ParquetError;
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::reader::{ChunkReader, Length};
use parquet::file::serialized_reader::SerializedPageReader;

use crate::footer::{STATISTICS, refusal_error};
use crate::panics::lock;
use crate::thrift::{self, FieldTypes, ThriftItem, ThriftType};
use ThriftType::{Bool, Number, Struct};

/// Greatest number of bytes that the pages of a row group's columns may unpack into at once. Basis:
/// our pages have 1 MiB, and the library holds a page until it has unpacked the next one, so that
/// twice as many bytes are taken, 2 GB. Doubling it doubles this memory.
const MAX_UNPACKED_BYTES: u64 = 1 << 30;
/// Memory for each unpacked byte of a column of text, in bytes, as it counts towards
/// [`MAX_UNPACKED_BYTES`]. Basis: a word of a dictionary takes [`LIBRARY_BYTE_ARRAY_BYTES`] of the
/// library's memory, but only the 4 bytes of its length in the file if it is empty. Doubling it
/// halves the number of words in the longest file that is read.
const BYTES_PER_WORD_BYTE: u64 = 8;
/// Size of the library's `ByteArray` and `FixedLenByteArray`, in bytes. Basis: their fields.
/// Doubling it allows half as many decimals in a dictionary.
const LIBRARY_BYTE_ARRAY_BYTES: u64 = 32;

/// Lengths of the beginning of a page in which its header is looked for, one after the other, in
/// bytes. Basis: the first holds nearly every header, the last one with long statistics. Doubling
/// the last one accepts longer headers.
const HEADER_SEARCH_BYTES: [u64; 3] = [256, 4 << 10, 64 << 10];

/// The types as which the library reads the fields of `PageHeader`.
const PAGE_HEADER: FieldTypes = &[
    (1..=4, Number),
    (5..=5, Struct(&[(1..=4, Number), (5..=5, Struct(STATISTICS))])),
    (6..=6, Struct(&[])),
    (7..=7, Struct(&[(1..=2, Number), (3..=3, Bool)])),
    (8..=8, Struct(&[(1..=6, Number), (7..=7, Bool), (8..=8, Struct(STATISTICS))])),
];

/// The numbers of bytes that the columns of a row group may still unpack into, for all of them.
pub(crate) type ByteBudget = Arc<AtomicU64>;

/// Returns the budget of a row group.
pub(crate) fn new_budget() -> ByteBudget {
    Arc::new(AtomicU64::new(MAX_UNPACKED_BYTES))
}

/// Opens a column of a row group, whose pages take their bytes from a budget.
///
/// # Errors
/// Fails if the column lies outside the file, or its compression is not supported.
pub(crate) fn open_pages<R: ChunkReader + 'static>(
    file: &Arc<R>,
    column: &ColumnChunkMetaData,
    rows: usize,
    budget: &ByteBudget,
) -> Result<ColumnReader, ParquetError> {
    let column_start = column.dictionary_page_offset().unwrap_or(column.data_page_offset());
    let column_start = u64::try_from(column_start).ok();
    let column_length = u64::try_from(column.compressed_size()).ok();
    let column_end =
        column_start.zip(column_length).and_then(|(start, length)| start.checked_add(length));
    let column_end = column_end.filter(|column_end| *column_end <= file.len());
    let column_end = column_end.ok_or_else(|| refusal_error("a column lies outside of it"))?;
    let page_headers = PageHeaders {
        file: Arc::clone(file),
        end: column_end,
        codec: column.compression(),
        physical_type: column.column_type(),
        entry_bytes: column.column_descr().type_length(),
        bytes_by_encoding: Mutex::default(),
        budget: Arc::clone(budget),
    };
    let pages = SerializedPageReader::new(Arc::new(page_headers), column, rows, None)?;
    Ok(get_column_reader(column.column_descr_ptr(), Box::new(pages)))
}

/// A reader of a column chunk that checks each page header before the library reads it.
struct PageHeaders<R> {
    file: Arc<R>,
    /// The end of the column chunk in the file.
    end: u64,
    codec: Compression,
    physical_type: Type,
    /// The length of each value, if all have the same.
    entry_bytes: i32,
    /// The bytes taken from the budget for the dictionary, and for the largest page so far of each
    /// encoding: the library holds the last page of each.
    bytes_by_encoding: Mutex<HashMap<(bool, [i32; 2]), u64>>,
    budget: ByteBudget,
}

impl<R: ChunkReader> Length for PageHeaders<R> {
    fn len(&self) -> u64 {
        self.file.len()
    }
}

impl<R: ChunkReader> ChunkReader for PageHeaders<R> {
    type T = Cursor<Bytes>;

    /// Returns the page header at `start`, and nothing behind it: the library reads no more here.
    fn get_read(&self, start: u64) -> Result<Self::T, ParquetError> {
        let remaining_bytes = self.end.saturating_sub(start);
        for max_bytes in HEADER_SEARCH_BYTES {
            let bytes = self.file.get_bytes(start, remaining_bytes.min(max_bytes) as usize)?;
            if let Some((header, rest)) = PageHeader::parse(&bytes) {
                let header_length = bytes.len() - rest.len();
                self.check_header(&header, start + header_length as u64)?;
                return Ok(Cursor::new(bytes.slice(..header_length)));
            }
        }
        Err(invalid_header_error())
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        self.file.get_bytes(start, length)
    }
}

impl<R: ChunkReader> PageHeaders<R> {
    /// Checks the header of a page whose bytes begin at `start`, and takes the page's bytes from
    /// the budget.
    fn check_header(&self, header: &PageHeader, start: u64) -> Result<(), ParquetError> {
        let to_size = |declared: i32| u64::try_from(declared).map_err(|_| invalid_header_error());
        let unpacked_bytes = to_size(header.unpacked_bytes)?;
        let packed_bytes = to_size(header.packed_bytes)?;
        let entry_count = to_size(header.dictionary_entries)?;
        // Bytes of an entry in the file, and in the library's memory.
        let (entry_file_bytes, entry_memory_bytes) = match self.physical_type {
            Type::BOOLEAN => (1, 1),
            Type::INT32 | Type::FLOAT => (4, 4),
            Type::INT64 | Type::DOUBLE => (8, 8),
            Type::INT96 => (12, 12),
            Type::BYTE_ARRAY => (4, LIBRARY_BYTE_ARRAY_BYTES),
            Type::FIXED_LEN_BYTE_ARRAY => {
                (to_size(self.entry_bytes)?.max(1), LIBRARY_BYTE_ARRAY_BYTES)
            }
        };
        if entry_count > unpacked_bytes / entry_file_bytes
            || packed_bytes > self.end.saturating_sub(start)
        {
            return Err(invalid_header_error());
        }
        let has_byte_arrays =
            matches!(self.physical_type, Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY);
        if has_byte_arrays && header.encodings.iter().any(|it| COUNTED_ENCODINGS.contains(it)) {
            return Err(refusal_error(
                "a column is encoded by DELTA_LENGTH_BYTE_ARRAY or DELTA_BYTE_ARRAY, which this \
                 program does not read: write it with a dictionary or PLAIN",
            ));
        }
        let budgeted_bytes = match self.physical_type {
            Type::BYTE_ARRAY => BYTES_PER_WORD_BYTE * unpacked_bytes,
            _ => unpacked_bytes + entry_count * entry_memory_bytes,
        };
        let mut bytes_by_encoding = lock(&self.bytes_by_encoding);
        let counted_bytes =
            bytes_by_encoding.entry((header.dictionary_entries > 0, header.encodings)).or_default();
        let additional_bytes = budgeted_bytes.saturating_sub(*counted_bytes);
        *counted_bytes += additional_bytes;
        self.budget
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |remaining_budget| {
                remaining_budget.checked_sub(additional_bytes)
            })
            .map_err(|_| too_long_error())?;
        if matches!(self.codec, Compression::GZIP(_)) && !header.is_uncompressed {
            let level_bytes = to_size(header.level_bytes[0])? + to_size(header.level_bytes[1])?;
            let compressed_length =
                packed_bytes.checked_sub(level_bytes).ok_or_else(invalid_header_error)?;
            let compressed_bytes =
                self.file.get_bytes(start + level_bytes, compressed_length as usize)?;
            if unpacks_beyond(&compressed_bytes, unpacked_bytes.saturating_sub(level_bytes)) {
                return Err(invalid_header_error());
            }
        }
        Ok(())
    }
}

fn invalid_header_error() -> ParquetError {
    refusal_error("the header of a page makes no sense")
}

fn too_long_error() -> ParquetError {
    let [max_mebibytes, max_word_mebibytes] =
        [1, BYTES_PER_WORD_BYTE].map(|weight| (MAX_UNPACKED_BYTES / weight) >> 20);
    let limits = format!("{max_mebibytes} MiB at once, or into {max_word_mebibytes} MiB of words");
    refusal_error(format!("its pages unpack into more than {limits}"))
}

/// Whether gzip unpacks into more than `max_bytes` bytes. The library unpacks gzip, and no other
/// codec, to its end, even beyond the size in the header; it reports bytes that are not gzip.
fn unpacks_beyond(packed_bytes: &[u8], max_bytes: u64) -> bool {
    let mut decoder = MultiGzDecoder::new(packed_bytes).take(max_bytes + 1);
    io::copy(&mut decoder, &mut io::sink()).is_ok_and(|byte_count| byte_count > max_bytes)
}

/// The encodings of words and decimals whose data begin with a count, for which the library
/// allocates whatever it is.
const COUNTED_ENCODINGS: [i32; 2] =
    [Encoding::DELTA_LENGTH_BYTE_ARRAY as i32, Encoding::DELTA_BYTE_ARRAY as i32];

/// The fields of a page header that are used here.
#[derive(Default)]
struct PageHeader {
    /// The page's sizes without and with compression (bytes).
    unpacked_bytes: i32,
    packed_bytes: i32,
    /// The number of entries, if the page is a dictionary.
    dictionary_entries: i32,
    /// The encodings that the headers of data pages of versions 1 and 2 declare.
    encodings: [i32; 2],
    /// The sizes of the two parts before the compressed one, in data pages of version 2 (bytes).
    level_bytes: [i32; 2],
    is_uncompressed: bool,
}

impl PageHeader {
    /// Parses the header at the beginning of `bytes`, and returns it with the bytes behind it.
    fn parse(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let mut header = Self::default();
        let remaining_bytes = thrift::walk_struct(bytes, PAGE_HEADER, &mut |path, value| {
            let ThriftItem::Number(number) = value else { return };
            // The library truncates numbers to this type too.
            let number = number as i32;
            match path {
                [2] => header.unpacked_bytes = number,
                [3] => header.packed_bytes = number,
                [5, 2] => header.encodings[0] = number,
                [8, 4] => header.encodings[1] = number,
                [7, 1] => header.dictionary_entries = number,
                [8, 5] => header.level_bytes[0] = number,
                [8, 6] => header.level_bytes[1] = number,
                [8, 7] => header.is_uncompressed = number == 0,
                _ => {}
            }
        })?;
        Some((header, remaining_bytes))
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use flate2::write::GzEncoder;

    use super::*;
    use crate::thrift::encode::{encode_number, encode_varint};

    /// Encodes a page of version 1 whose header declares these sizes.
    fn encode_page(unpacked_bytes: i32, packed_bytes: &[u8]) -> Vec<u8> {
        let size_numbers = [
            encode_number(0),
            encode_number(unpacked_bytes),
            encode_number(packed_bytes.len() as i32),
        ];
        let encode_size = |number: &Vec<u8>| [&[0x15], number.as_slice()].concat();
        let mut bytes: Vec<u8> = size_numbers.iter().flat_map(encode_size).collect();
        // Field 5, the data page's header: four numbers.
        bytes.extend([0x2c, 0x15, 2, 0x15, 0, 0x15, 6, 0x15, 6, 0, 0]);
        bytes.extend(packed_bytes);
        bytes
    }

    /// Encodes a dictionary page that declares this number of entries.
    fn encode_dictionary(unpacked_bytes: i32, entry_count: i32) -> Vec<u8> {
        let unpacked_bytes = encode_number(unpacked_bytes);
        let mut bytes =
            [&[0x15, 4, 0x15], unpacked_bytes.as_slice(), &[0x15, 0, 0x4c, 0x15]].concat();
        bytes.extend(encode_number(entry_count));
        bytes.extend([0x15, 0, 0, 0]);
        bytes
    }

    /// Reads the headers of a column chunk as the library does, and returns the number of bytes
    /// that they take from the budget, or an error.
    fn budget_bytes(chunk: &[u8], codec: Compression, physical_type: Type) -> Result<u64, String> {
        // Other bytes stand before and behind the column chunk.
        let file = Arc::new(Bytes::from([&[9; 5], chunk, &[9; 500]].concat()));
        let budget = new_budget();
        let page_headers = PageHeaders {
            file,
            end: 5 + chunk.len() as u64,
            codec,
            physical_type,
            entry_bytes: 2,
            bytes_by_encoding: Mutex::default(),
            budget: Arc::clone(&budget),
        };
        let mut offset = 5;
        while offset < page_headers.end {
            let bytes =
                page_headers.get_read(offset).map_err(|error| error.to_string())?.into_inner();
            let (header, rest) = PageHeader::parse(&bytes).unwrap();
            assert!(rest.is_empty());
            offset += bytes.len() as u64 + header.packed_bytes as u64;
        }
        Ok(MAX_UNPACKED_BYTES - budget.load(Ordering::Relaxed))
    }

    fn budget_bytes_or_error(chunk: &[u8], codec: Compression) -> String {
        budget_bytes(chunk, codec, Type::DOUBLE)
            .map_or_else(|error| error, |bytes| bytes.to_string())
    }

    #[test]
    fn the_dictionary_and_the_largest_page_of_each_encoding_are_counted() {
        let chunk =
            [encode_dictionary(80, 10), encode_page(100, &[1; 10]), encode_page(50, &[2; 60])]
                .concat();
        assert_eq!(budget_bytes(&chunk, Compression::SNAPPY, Type::DOUBLE), Ok(80 + 80 + 100));
        assert_eq!(budget_bytes(&chunk, Compression::SNAPPY, Type::BYTE_ARRAY), Ok(8 * 180));
        let mut page_of_other_encoding = encode_page(70, &[1; 10]);
        let encoding_offset = page_of_other_encoding
            .windows(4)
            .position(|bytes| bytes == [0x15, 2, 0x15, 0])
            .unwrap();
        // DELTA_BINARY_PACKED.
        page_of_other_encoding[encoding_offset + 3] = 10;
        let chunk = [encode_page(100, &[1; 10]), page_of_other_encoding].concat();
        assert_eq!(budget_bytes(&chunk, Compression::SNAPPY, Type::DOUBLE), Ok(170));
        let pages_of_half_budget = encode_page(1 << 29, &[0; 40]).repeat(3);
        let zstd_codec = Compression::ZSTD(Default::default());
        assert_eq!(budget_bytes(&pages_of_half_budget, zstd_codec, Type::DOUBLE), Ok(1 << 29));
        assert!(
            budget_bytes_or_error(&encode_page(i32::MAX, &[0; 40]), zstd_codec)
                .contains("more than 1024 MiB")
        );
        let dictionary_and_page =
            [encode_dictionary(80, 10), encode_page(1 << 30, &[0; 40])].concat();
        assert!(
            budget_bytes_or_error(&dictionary_and_page, zstd_codec).contains("more than 1024 MiB")
        );
    }

    #[test]
    fn a_dictionary_that_declares_more_entries_than_fit_is_refused() {
        let fits_page = |kind, entries| {
            budget_bytes(&encode_dictionary(80, entries), Compression::UNCOMPRESSED, kind).is_ok()
        };
        for (kind, max_entries) in [
            (Type::INT32, 20),
            (Type::INT64, 10),
            (Type::DOUBLE, 10),
            (Type::BYTE_ARRAY, 20),
            (Type::FIXED_LEN_BYTE_ARRAY, 40),
        ] {
            assert!(
                fits_page(kind, max_entries)
                    && !fits_page(kind, max_entries + 1)
                    && !fits_page(kind, i32::MAX),
                "{kind}"
            );
        }
    }

    #[test]
    fn words_in_encodings_whose_counts_the_library_trusts_are_refused() {
        for encoding in COUNTED_ENCODINGS {
            let mut bytes = encode_page(100, &[1; 10]);
            let encoding_offset =
                bytes.windows(4).position(|bytes| bytes == [0x15, 2, 0x15, 0]).unwrap();
            bytes[encoding_offset + 3] = 2 * encoding as u8;
            let codec = Compression::SNAPPY;
            let message = budget_bytes(&bytes, codec, Type::BYTE_ARRAY).unwrap_err();
            assert!(message.contains("DELTA_LENGTH_BYTE_ARRAY or DELTA_BYTE_ARRAY"), "{message}");
            assert!(budget_bytes(&bytes, codec, Type::DOUBLE).is_ok(), "the library reports it");
        }
    }

    #[test]
    fn gzip_that_unpacks_into_more_than_declared_is_refused() {
        let mut encoder = GzEncoder::new(Vec::new(), flate2::Compression::best());
        encoder.write_all(&vec![0; 50_000_000]).unwrap();
        let packed_bytes = encoder.finish().unwrap();
        assert!(packed_bytes.len() < 100_000, "{}", packed_bytes.len());
        let gzip_codec = Compression::GZIP(Default::default());
        assert_eq!(
            budget_bytes_or_error(&encode_page(50_000_000, &packed_bytes), gzip_codec),
            "50000000"
        );
        assert!(
            budget_bytes_or_error(&encode_page(49_999_999, &packed_bytes), gzip_codec)
                .contains("no sense")
        );
    }

    #[test]
    fn headers_with_long_statistics_are_read() {
        for length in [10_usize, 300, 5000, 60_000, 70_000] {
            let mut bytes = [&[0x15, 0, 0x15], encode_number(100).as_slice(), &[0x15, 0]].concat();
            // Statistics, whose first field is a text.
            bytes.extend([0x2c, 0x15, 2, 0x15, 0, 0x15, 6, 0x15, 6, 0x1c, 0x18]);
            bytes.extend(encode_varint(length as u64));
            bytes.extend(vec![7; length]);
            bytes.extend([0, 0, 0]);
            let expected_text = if length < 65_000 { "100" } else { "no sense" };
            assert!(
                budget_bytes_or_error(&bytes, Compression::SNAPPY).contains(expected_text),
                "{length}"
            );
        }
    }

    #[test]
    fn headers_that_make_no_sense_are_refused() {
        let undamaged_page = encode_page(100, &[1; 10]);
        for length in 1..undamaged_page.len() {
            assert!(
                budget_bytes_or_error(&undamaged_page[..length], Compression::SNAPPY)
                    .contains("no sense"),
                "{length}"
            );
        }
        // Lists of 2^31 - 1 booleans, which take no bytes: the library would count for minutes.
        let mut page_of_booleans = undamaged_page[..undamaged_page.len() - 11].to_vec();
        page_of_booleans.extend([0x99, 0xf1, 0xff, 0xff, 0xff, 0xff, 7].repeat(30));
        page_of_booleans.push(0);
        assert!(budget_bytes_or_error(&page_of_booleans, Compression::SNAPPY).contains("no sense"));
        // A size as a text, which a reader that trusts the schema would take for a number.
        let mut damaged_page = undamaged_page;
        damaged_page[2] = 0x18;
        assert!(budget_bytes_or_error(&damaged_page, Compression::SNAPPY).contains("no sense"));
        assert!(
            budget_bytes_or_error(&encode_page(-1, &[1; 10]), Compression::SNAPPY)
                .contains("no sense")
        );
    }
}
