//! Checks a Parquet file's footer before the library reads it, because the library trusts the
//! counts and sizes in it. The module `thrift` names the places where it does.

use bytes::Bytes;
use parquet::errors::ParquetError;
use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader};
use parquet::file::reader::{ChunkReader, Length};

use crate::thrift::{self, FieldTypes, ThriftItem, ThriftType};
use ThriftType::{Binary, Bool, Byte, Double, List, Number, Struct};

/// Greatest length of a footer, in bytes. Basis: the library takes up to 25 bytes per byte of a
/// footer, beside its columns. Doubling it doubles this memory.
const MAX_FOOTER_BYTES: usize = 16 << 20;

/// Greatest number of columns and groups of columns. Basis: the library takes up to 2 kB for each,
/// even if the name is empty. Doubling it doubles this memory.
const MAX_COLUMNS: u64 = 100_000;

/// Greatest depth of nested groups of columns. Basis: the library recurses through them, and C++
/// Parquet has this limit too. Doubling it doubles the stack that is needed.
const MAX_DEPTH: usize = 100;

/// Greatest total length of the columns' paths, in bytes. Basis: a thousand columns in groups with
/// names of 64 kB, more than any sound file has. Doubling it doubles the memory of the copies of
/// names that the library makes.
const MAX_PATH_BYTES: u64 = 64 << 20;

/// The types as which the library reads the fields of `FileMetaData` in Parquet's format. The
/// constants below have the names of the format's structs.
const FILE_META_DATA: FieldTypes = &[
    (1..=1, Number),
    (2..=2, List(&Struct(SCHEMA_ELEMENT))),
    (3..=3, Number),
    (4..=4, List(&Struct(ROW_GROUP))),
    (5..=5, List(&Struct(&[(1..=2, Binary)]))),
    (6..=6, Binary),
    (7..=7, List(&Struct(&[(1..=3, EMPTY_STRUCT)]))),
];
/// The fields of `SchemaElement`.
const SCHEMA_ELEMENT: FieldTypes =
    &[(1..=3, Number), (4..=4, Binary), (5..=9, Number), (10..=10, Struct(LOGICAL_TYPE))];
/// The fields of `LogicalType`.
const LOGICAL_TYPE: FieldTypes = &[
    (5..=5, Struct(&[(1..=2, Number)])),
    (7..=8, Struct(&[(1..=1, Bool), (2..=2, Struct(&[(1..=3, EMPTY_STRUCT)]))])),
    (10..=10, Struct(&[(1..=1, Byte), (2..=2, Bool)])),
    (16..=16, Struct(&[(1..=1, Byte)])),
    (17..=18, Struct(&[(1..=1, Binary), (2..=2, Number)])),
    (1..=19, EMPTY_STRUCT),
];
/// The fields of `RowGroup`.
const ROW_GROUP: FieldTypes = &[
    (1..=1, List(&Struct(COLUMN_CHUNK))),
    (2..=3, Number),
    (4..=4, List(&Struct(&[(1..=1, Number), (2..=3, Bool)]))),
    (5..=5, Number),
    (7..=7, Number),
];
/// The fields of `ColumnChunk`.
const COLUMN_CHUNK: FieldTypes =
    &[(1..=1, Binary), (2..=2, Number), (3..=3, Struct(COLUMN_META_DATA)), (4..=7, Number)];
/// The fields of `ColumnMetaData`.
const COLUMN_META_DATA: FieldTypes = &[
    (1..=1, Number),
    (2..=2, List(&Number)),
    (4..=7, Number),
    (9..=11, Number),
    (12..=12, Struct(STATISTICS)),
    (13..=13, List(&Struct(&[(1..=3, Number)]))),
    (14..=15, Number),
    (16..=16, Struct(&[(1..=1, Number), (2..=3, List(&Number))])),
    (17..=17, Struct(&[(1..=1, Struct(&[(1..=8, Double)])), (2..=2, List(&Number))])),
];
/// The fields of `Statistics`.
pub(crate) const STATISTICS: FieldTypes =
    &[(1..=2, Binary), (3..=4, Number), (5..=6, Binary), (7..=8, Bool), (9..=9, Number)];
/// A struct without fields, such as a union's empty case.
const EMPTY_STRUCT: ThriftType = Struct(&[]);

/// Path of field numbers to the name of a column or group.
const NAME_PATH: &[i16] = &[2, 4];
/// Path of field numbers to a group's number of children.
const CHILD_COUNT_PATH: &[i16] = &[2, 5];
/// Path of field numbers to a column or group.
const ELEMENT_PATH: &[i16] = &[2];

/// Reads a file's metadata.
///
/// # Errors
/// Returns the library's errors, and an error for a footer that it could not read safely.
pub fn read_metadata<R: ChunkReader>(file: &R) -> Result<ParquetMetaData, ParquetError> {
    ParquetMetaDataReader::new().parse_and_finish(&Footer(file))
}

/// Returns the error for a file that is refused.
pub(crate) fn refusal_error(reason: impl Into<String>) -> ParquetError {
    ParquetError::General(reason.into())
}

/// A reader of a file that checks the footer before the library reads it.
struct Footer<'a, R>(&'a R);

impl<R: ChunkReader> Length for Footer<'_, R> {
    fn len(&self) -> u64 {
        self.0.len()
    }
}

impl<R: ChunkReader> ChunkReader for Footer<'_, R> {
    type T = R::T;

    fn get_read(&self, start: u64) -> Result<R::T, ParquetError> {
        self.0.get_read(start)
    }

    /// Returns the footer, the only bytes that the library takes here.
    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        if length > MAX_FOOTER_BYTES {
            let max_mebibytes = MAX_FOOTER_BYTES >> 20;
            return Err(refusal_error(format!("its footer is longer than {max_mebibytes} MiB")));
        }
        let footer_bytes = self.0.get_bytes(start, length)?;
        check_footer(&footer_bytes)?;
        Ok(footer_bytes)
    }
}

fn check_footer(footer: &[u8]) -> Result<(), ParquetError> {
    let mut column_tree = ColumnTree::default();
    let mut name_length = 0;
    let mut child_count = 0;
    let remaining_bytes =
        thrift::walk_struct(footer, FILE_META_DATA, &mut |path, found| match (path, found) {
            (NAME_PATH, ThriftItem::Number(length)) => {
                name_length = u64::try_from(length).unwrap_or(0)
            }
            (CHILD_COUNT_PATH, ThriftItem::Number(number)) => {
                child_count = u64::try_from(number).unwrap_or(0)
            }
            (ELEMENT_PATH, ThriftItem::End) => {
                column_tree.add(name_length, child_count);
                name_length = 0;
                child_count = 0;
            }
            _ => {}
        });
    // The library allocates as many columns as a group declares.
    if remaining_bytes.is_none() || column_tree.declared_count >= column_tree.element_count.max(1) {
        return Err(refusal_error("its footer makes no sense"));
    }
    if column_tree.element_count > MAX_COLUMNS {
        return Err(refusal_error(format!("it has more than {MAX_COLUMNS} columns")));
    }
    if column_tree.depth > MAX_DEPTH {
        return Err(refusal_error(format!("its columns are nested more than {MAX_DEPTH} deep")));
    }
    if column_tree.path_bytes > MAX_PATH_BYTES {
        let max_mebibytes = MAX_PATH_BYTES >> 20;
        return Err(refusal_error(format!(
            "the paths of its columns are longer than {max_mebibytes} MiB"
        )));
    }
    Ok(())
}

/// The nesting of columns and groups; each group comes before its children.
#[derive(Default)]
struct ColumnTree {
    /// The number of columns and groups.
    element_count: u64,
    /// The number of children that all groups declare.
    declared_count: u64,
    /// The number of children that are still to come, and the length of the path, for each open
    /// group.
    open_groups: Vec<(u64, u64)>,
    /// The greatest depth so far.
    depth: usize,
    /// The total length of the columns' paths.
    path_bytes: u64,
}

impl ColumnTree {
    /// Adds the next column or group, with the length of its name and the number of its children.
    fn add(&mut self, name_length: u64, child_count: u64) {
        self.element_count += 1;
        self.declared_count = self.declared_count.saturating_add(child_count);
        while self.open_groups.pop_if(|(remaining_children, _)| *remaining_children == 0).is_some()
        {
        }
        let mut path_length = name_length;
        if let Some((remaining_children, parent_path_length)) = self.open_groups.last_mut() {
            *remaining_children -= 1;
            path_length += *parent_path_length;
        }
        if child_count > 0 {
            self.open_groups.push((child_count, path_length));
            self.depth = self.depth.max(self.open_groups.len());
        } else {
            self.path_bytes = self.path_bytes.saturating_add(path_length);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use parquet::column::writer::ColumnWriter;
    use parquet::data_type::{ByteArray, FixedLenByteArray};
    use parquet::file::metadata::{KeyValue, SortingColumn};
    use parquet::file::properties::{EnabledStatistics, WriterProperties};
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;

    use super::*;
    use crate::thrift::encode::encode_varint;

    /// The mark at either end of a file.
    const MAGIC: &[u8] = b"PAR1";

    /// Encodes a column, or a group if `child_count` is not zero.
    fn encode_element(child_count: u64) -> Vec<u8> {
        match child_count {
            0 => vec![0x15, 10, 0x25, 0, 0x18, 1, b'x', 0],
            _ => encode_group(1, child_count),
        }
    }

    /// Encodes a group with a name of this length.
    fn encode_group(name_length: usize, child_count: u64) -> Vec<u8> {
        let length = encode_varint(name_length as u64);
        let child_count_bytes = encode_varint(2 * child_count);
        [&[0x35, 0, 0x18], &length[..], &vec![b'g'; name_length], &[0x15], &child_count_bytes, &[0]]
            .concat()
    }

    /// Encodes a file without rows that has these groups and columns, given by their numbers of
    /// children, and `more_fields` fields at the footer's end.
    fn encode_file(child_counts: impl IntoIterator<Item = u64>, more_fields: &[u8]) -> Vec<u8> {
        encode_file_from(child_counts.into_iter().map(encode_element).collect(), more_fields)
    }

    /// Encodes a file like [`encode_file`] from its encoded groups and columns.
    fn encode_file_from(elements: Vec<Vec<u8>>, more_fields: &[u8]) -> Vec<u8> {
        let footer = [
            &[0x15, 2, 0x19, 0xfc],
            encode_varint(elements.len() as u64).as_slice(),
            &elements.concat(),
            &[0x16, 0, 0x19, 0x0c],
            more_fields,
            &[0],
        ]
        .concat();
        [MAGIC, &footer, &(footer.len() as u32).to_le_bytes(), MAGIC].concat()
    }

    fn error_message(file: &[u8]) -> String {
        match read_metadata(&Bytes::copy_from_slice(file)) {
            Ok(_) => "fine".to_owned(),
            Err(error) => error.to_string().replace("Parquet error: ", ""),
        }
    }

    #[test]
    fn footers_with_every_type_and_setting_pass() {
        let schema = "message x {
            required double double;
            optional boolean truth;
            optional int32 byte (INTEGER(8, true));
            optional binary text (STRING);
            optional int32 date (DATE);
            optional int64 time (TIME(MICROS, false));
            optional int64 stamp (TIMESTAMP(MILLIS, true));
            optional fixed_len_byte_array(4) decimal (DECIMAL(9, 2));
            optional group list (LIST) { repeated group list { optional int64 element; } }
            optional group map (MAP) {
                repeated group key_value {
                    required binary key (STRING);
                    optional int64 value;
                }
            }
            optional group group { optional float inner; }
        }";
        let schema = Arc::new(parse_message_type(schema).unwrap());
        for statistics in
            [EnabledStatistics::None, EnabledStatistics::Chunk, EnabledStatistics::Page]
        {
            let sorting_column =
                SortingColumn { column_idx: 0, descending: true, nulls_first: false };
            let properties = WriterProperties::builder()
                .set_statistics_enabled(statistics)
                .set_bloom_filter_enabled(true)
                .set_sorting_columns(Some(vec![sorting_column]))
                .set_key_value_metadata(Some(vec![KeyValue::new("k".to_owned(), None)]))
                .build();
            let mut writer =
                SerializedFileWriter::new(Vec::new(), Arc::clone(&schema), properties.into())
                    .unwrap();
            let mut row_group = writer.next_row_group().unwrap();
            while let Some(mut column) = row_group.next_column().unwrap() {
                macro_rules! write {
                    ($column:expr, $value:expr) => {{
                        let max_level = $column.get_descriptor().max_def_level();
                        $column.write_batch(&[$value], Some(&[max_level]), Some(&[0])).unwrap()
                    }};
                }
                match column.untyped() {
                    ColumnWriter::BoolColumnWriter(column) => write!(column, true),
                    ColumnWriter::Int32ColumnWriter(column) => write!(column, 1),
                    ColumnWriter::Int64ColumnWriter(column) => write!(column, 1),
                    ColumnWriter::FloatColumnWriter(column) => write!(column, 1.5),
                    ColumnWriter::DoubleColumnWriter(column) => write!(column, 1.5),
                    ColumnWriter::ByteArrayColumnWriter(column) => {
                        write!(column, ByteArray::from("long".repeat(90).as_str()))
                    }
                    ColumnWriter::FixedLenByteArrayColumnWriter(column) => {
                        write!(column, FixedLenByteArray::from(vec![5; 4]))
                    }
                    ColumnWriter::Int96ColumnWriter(_) => unreachable!(),
                };
                column.close().unwrap();
            }
            row_group.close().unwrap();
            assert_eq!(error_message(&writer.into_inner().unwrap()), "fine");
        }
    }

    #[test]
    fn files_without_a_footer_are_reported_by_the_library() {
        for bytes in [&b""[..], b"PAR1", b"time_s,x\n1,2\n", b"PAR1\xff\0\0\0PAR1", &[0; 100]] {
            let message = error_message(bytes);
            assert!(message != "fine" && !message.contains("its footer"), "{message}");
        }
    }

    #[test]
    fn lists_that_take_no_bytes_are_refused() {
        // Field 9 and those after it: each declares 2^31 - 1 booleans.
        let list_bytes = [0x59, 0xf1, 0xff, 0xff, 0xff, 0xff, 7].repeat(3);
        assert_eq!(error_message(&encode_file([1, 0], &[])), "fine");
        assert_eq!(error_message(&encode_file([1, 0], &list_bytes)), "its footer makes no sense");
    }

    #[test]
    fn groups_that_are_nested_too_deeply_are_refused() {
        // The root counts as one level of nesting.
        let nested_groups = |groups| std::iter::repeat_n(1, groups).chain([0]);
        assert_eq!(error_message(&encode_file(nested_groups(MAX_DEPTH), &[])), "fine");
        let refusal = error_message(&encode_file(nested_groups(MAX_DEPTH + 1), &[]));
        assert_eq!(refusal, "its columns are nested more than 100 deep");
        // Groups side by side are not nested.
        let siblings = [150].into_iter().chain([1, 0].repeat(150));
        assert_eq!(error_message(&encode_file(siblings, &[])), "fine");
        // Each group has a leaf and a further group, so the last child counts to the depth.
        let comb_tree = [2].into_iter().chain([0, 2].repeat(MAX_DEPTH)).chain([0, 0]);
        assert_eq!(
            error_message(&encode_file(comb_tree, &[])),
            "its columns are nested more than 100 deep"
        );
    }

    #[test]
    fn too_many_columns_are_refused() {
        let flat_columns = |columns: u64| std::iter::once(columns).chain((0..columns).map(|_| 0));
        assert_eq!(error_message(&encode_file(flat_columns(MAX_COLUMNS - 1), &[])), "fine");
        assert_eq!(
            error_message(&encode_file(flat_columns(MAX_COLUMNS), &[])),
            "it has more than 100000 columns"
        );
    }

    #[test]
    fn paths_that_are_too_long_together_are_refused() {
        // The library copies the group's name for each of its columns.
        let column_count = 1 << 10;
        let file_with_group_name = |name_length: usize| {
            let elements = [encode_element(1), encode_group(name_length, column_count)];
            encode_file_from(
                elements.into_iter().chain((0..column_count).map(|_| encode_element(0))).collect(),
                &[],
            )
        };
        // The root's name and a column's have a byte each.
        assert_eq!(error_message(&file_with_group_name((1 << 16) - 2)), "fine");
        assert_eq!(
            error_message(&file_with_group_name(1 << 16)),
            "the paths of its columns are longer than 64 MiB"
        );
    }

    #[test]
    fn a_group_that_declares_more_columns_than_there_are_is_refused() {
        assert_eq!(error_message(&encode_file([2, 0, 0], &[])), "fine");
        assert_eq!(error_message(&encode_file([3, 0, 0], &[])), "its footer makes no sense");
        assert_eq!(error_message(&encode_file([0x3fff_ffff, 0], &[])), "its footer makes no sense");
    }

    #[test]
    fn a_footer_that_is_too_long_is_refused() {
        let mut bytes = encode_file([1, 0], &[]);
        let footer_length = MAX_FOOTER_BYTES + 1;
        let footer =
            [vec![0; footer_length], (footer_length as u32).to_le_bytes().to_vec(), MAGIC.to_vec()];
        bytes.extend(footer.concat());
        assert_eq!(error_message(&bytes), "its footer is longer than 16 MiB");
    }
}
