//! A check of a Parquet file's footer, before the library reads it.
//!
//! A footer of a few bytes can make the library count for minutes, recurse until the stack is full,
//! or allocate for columns that are not there.

use std::io::{self, Read, Seek, SeekFrom};

use crate::thrift::{self, Found, Shape, Wire};
use Wire::{Binary, Bool, Byte, Double, List, Number, Struct};

/// Length of a file's end, in bytes: the footer's length (4) and the mark.
const TAIL_BYTES: u64 = 8;
const MARK: &[u8] = b"PAR1";

/// Greatest length of a footer, in bytes. Basis: the library allocates up to 25 bytes per byte of a
/// footer, beside its columns. Doubling it doubles this memory.
pub(crate) const LONGEST_BYTES: u64 = 16 << 20;

/// Greatest number of columns and groups of columns. Basis: the library allocates up to 2 kB for
/// each, even if the name is empty. Doubling it doubles this memory.
pub(crate) const MOST_COLUMNS: u64 = 100_000;

/// Greatest depth of nested groups of columns. Basis: the library recurses through them. Doubling
/// it doubles the stack that is needed.
pub(crate) const DEEPEST: usize = 100;

// The types as which version 60 of the Parquet library reads the fields. The names are those of
// Parquet's format.
const FILE: Shape = &[
    (1..=1, Number),
    (2..=2, List(&Struct(SCHEMA_ELEMENT))),
    (3..=3, Number),
    (4..=4, List(&Struct(ROW_GROUP))),
    (5..=5, List(&Struct(&[(1..=2, Binary)]))),
    (6..=6, Binary),
    (7..=7, List(&Struct(&[(1..=3, EMPTY)]))),
];
const SCHEMA_ELEMENT: Shape =
    &[(1..=3, Number), (4..=4, Binary), (5..=9, Number), (10..=10, Struct(LOGICAL_TYPE))];
const LOGICAL_TYPE: Shape = &[
    (5..=5, Struct(&[(1..=2, Number)])),
    (7..=8, Struct(&[(1..=1, Bool), (2..=2, Struct(&[(1..=3, EMPTY)]))])),
    (10..=10, Struct(&[(1..=1, Byte), (2..=2, Bool)])),
    (16..=16, Struct(&[(1..=1, Byte)])),
    (17..=18, Struct(&[(1..=1, Binary), (2..=2, Number)])),
    (1..=19, EMPTY),
];
const ROW_GROUP: Shape = &[
    (1..=1, List(&Struct(COLUMN_CHUNK))),
    (2..=3, Number),
    (4..=4, List(&Struct(&[(1..=1, Number), (2..=3, Bool)]))),
    (5..=5, Number),
    (7..=7, Number),
];
const COLUMN_CHUNK: Shape =
    &[(1..=1, Binary), (2..=2, Number), (3..=3, Struct(COLUMN_META_DATA)), (4..=7, Number)];
const COLUMN_META_DATA: Shape = &[
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
pub(crate) const STATISTICS: Shape =
    &[(1..=2, Binary), (3..=4, Number), (5..=6, Binary), (7..=8, Bool), (9..=9, Number)];
const EMPTY: Wire = Struct(&[]);

/// The reason why a Parquet file is refused before the library reads it.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// The file cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A footer that cannot be parsed, or declares impossible counts.
    #[error("its footer makes no sense")]
    Footer,
    /// A footer that is longer than any sound file's.
    #[error("its footer is longer than {} MiB", LONGEST_BYTES >> 20)]
    LongFooter,
    /// More columns and groups of columns than any sound file has.
    #[error("it has more than {} columns", MOST_COLUMNS)]
    TooManyColumns,
    /// Groups of columns that are nested more deeply than in any sound file.
    #[error("its columns are nested more than {} deep", DEEPEST)]
    TooDeep,
    /// A page header that cannot be parsed, or declares impossible sizes.
    #[error("the header of a page makes no sense")]
    PageHeader,
    /// Pages that unpack into more bytes than the caller allows.
    #[error("its pages unpack into too many bytes")]
    TooLong,
}

/// Path of field numbers to a group's number of children.
const CHILDREN: &[i16] = &[2, 5];

/// Checks that the library can safely read a file's footer. A file without a footer passes: the
/// library reports it.
///
/// # Errors
/// [`Refused::Io`], [`Refused::Footer`], [`Refused::LongFooter`], [`Refused::TooManyColumns`],
/// [`Refused::TooDeep`].
pub fn check(file: &mut (impl Read + Seek)) -> Result<(), Refused> {
    let length = file.seek(SeekFrom::End(0))?;
    let Some(end) = length.checked_sub(TAIL_BYTES) else { return Ok(()) };
    file.seek(SeekFrom::Start(end))?;
    let mut tail = [0; TAIL_BYTES as usize];
    file.read_exact(&mut tail)?;
    let [a, b, c, d, mark @ ..] = tail;
    let length = u64::from(u32::from_le_bytes([a, b, c, d]));
    let Some(start) = end.checked_sub(length) else { return Ok(()) };
    if mark != MARK {
        return Ok(());
    }
    if length > LONGEST_BYTES {
        return Err(Refused::LongFooter);
    }
    file.seek(SeekFrom::Start(start))?;
    let mut footer = Vec::new();
    file.take(length).read_to_end(&mut footer)?;
    check_footer(&footer)
}

fn check_footer(footer: &[u8]) -> Result<(), Refused> {
    let (mut elements, mut declared, mut children) = (0_u64, 0_u64, 0);
    let mut tree = Tree::default();
    let rest = thrift::walk(footer, FILE, &mut |path, found| match (path, found) {
        (CHILDREN, Found::Number(number)) => children = u64::try_from(number).unwrap_or(0),
        ([2], Found::End) => {
            elements += 1;
            declared = declared.saturating_add(children);
            tree.add(children);
            children = 0;
        }
        _ => {}
    });
    // The library allocates as many columns as a group declares.
    if rest.is_none() || declared >= elements.max(1) {
        return Err(Refused::Footer);
    }
    if elements > MOST_COLUMNS {
        return Err(Refused::TooManyColumns);
    }
    if tree.depth > DEEPEST { Err(Refused::TooDeep) } else { Ok(()) }
}

/// The nesting of columns and groups; each group comes before its children.
#[derive(Default)]
struct Tree {
    /// The number of children that are still to come, for each open group.
    open: Vec<u64>,
    /// The greatest depth so far.
    depth: usize,
}

impl Tree {
    fn add(&mut self, children: u64) {
        while self.open.pop_if(|left| *left == 0).is_some() {}
        if let Some(left) = self.open.last_mut() {
            *left -= 1;
        }
        if children > 0 {
            self.open.push(children);
            self.depth = self.depth.max(self.open.len());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;
    use std::sync::Arc;

    use parquet::column::writer::ColumnWriter;
    use parquet::data_type::{ByteArray, FixedLenByteArray};
    use parquet::file::metadata::{KeyValue, SortingColumn};
    use parquet::file::properties::{EnabledStatistics, WriterProperties};
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;

    use super::*;
    use crate::thrift::encode::varint;

    /// Encodes a column, or a group if `children` is not zero.
    fn element(children: u64) -> Vec<u8> {
        match children {
            0 => vec![0x15, 10, 0x25, 0, 0x18, 1, b'x', 0],
            _ => [&[0x35, 0, 0x18, 1, b'g', 0x15], varint(2 * children).as_slice(), &[0]].concat(),
        }
    }

    /// Encodes a file without rows that has these groups and columns, given by their numbers of
    /// children, and `more` fields at the footer's end.
    fn file(children: impl IntoIterator<Item = u64>, more: &[u8]) -> Vec<u8> {
        let elements: Vec<_> = children.into_iter().map(element).collect();
        let footer = [
            &[0x15, 2, 0x19, 0xfc],
            varint(elements.len() as u64).as_slice(),
            &elements.concat(),
            &[0x16, 0, 0x19, 0x0c],
            more,
            &[0],
        ]
        .concat();
        [MARK, &footer, &(footer.len() as u32).to_le_bytes(), MARK].concat()
    }

    fn message(file: &[u8]) -> String {
        check(&mut Cursor::new(file)).map_or_else(|error| error.to_string(), |()| "fine".to_owned())
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
            let sorting = SortingColumn { column_idx: 0, descending: true, nulls_first: false };
            let properties = WriterProperties::builder()
                .set_statistics_enabled(statistics)
                .set_bloom_filter_enabled(true)
                .set_sorting_columns(Some(vec![sorting]))
                .set_key_value_metadata(Some(vec![KeyValue::new("k".to_owned(), None)]))
                .build();
            let mut writer =
                SerializedFileWriter::new(Vec::new(), Arc::clone(&schema), properties.into())
                    .unwrap();
            let mut group = writer.next_row_group().unwrap();
            while let Some(mut column) = group.next_column().unwrap() {
                macro_rules! write {
                    ($column:expr, $value:expr) => {{
                        let level = $column.get_descriptor().max_def_level();
                        $column.write_batch(&[$value], Some(&[level]), Some(&[0])).unwrap()
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
            group.close().unwrap();
            assert_eq!(message(&writer.into_inner().unwrap()), "fine");
        }
    }

    #[test]
    fn files_without_a_footer_pass() {
        for bytes in [&b""[..], b"PAR1", b"time_s,x\n1,2\n", b"PAR1\xff\0\0\0PAR1", &[0; 100]] {
            assert_eq!(message(bytes), "fine");
        }
    }

    #[test]
    fn lists_that_take_no_bytes_are_refused() {
        // Field 9 and those after it: each declares 2^31 - 1 booleans.
        let lists = [0x59, 0xf1, 0xff, 0xff, 0xff, 0xff, 7].repeat(3);
        assert_eq!(message(&file([1, 0], &[])), "fine");
        assert_eq!(message(&file([1, 0], &lists)), "its footer makes no sense");
    }

    #[test]
    fn groups_that_are_nested_too_deeply_are_refused() {
        // The root counts as one level of nesting.
        let chain = |groups| std::iter::repeat_n(1, groups).chain([0]);
        assert_eq!(message(&file(chain(DEEPEST), &[])), "fine");
        let refusal = message(&file(chain(DEEPEST + 1), &[]));
        assert_eq!(refusal, "its columns are nested more than 100 deep");
        // Groups side by side are not nested.
        let beside = [150].into_iter().chain([1, 0].repeat(150));
        assert_eq!(message(&file(beside, &[])), "fine");
        // Each group has a leaf and a further group, so the last child counts to the depth.
        let comb = [2].into_iter().chain([0, 2].repeat(DEEPEST)).chain([0, 0]);
        assert_eq!(message(&file(comb, &[])), "its columns are nested more than 100 deep");
    }

    #[test]
    fn too_many_columns_are_refused() {
        let flat = |columns: u64| std::iter::once(columns).chain((0..columns).map(|_| 0));
        assert_eq!(message(&file(flat(MOST_COLUMNS - 1), &[])), "fine");
        assert_eq!(message(&file(flat(MOST_COLUMNS), &[])), "it has more than 100000 columns");
    }

    #[test]
    fn a_group_that_declares_more_columns_than_there_are_is_refused() {
        assert_eq!(message(&file([2, 0, 0], &[])), "fine");
        assert_eq!(message(&file([3, 0, 0], &[])), "its footer makes no sense");
        assert_eq!(message(&file([0x3fff_ffff, 0], &[])), "its footer makes no sense");
    }

    #[test]
    fn a_footer_that_is_too_long_is_refused() {
        let mut bytes = file([1, 0], &[]);
        let length = (LONGEST_BYTES as usize) + 1;
        let footer = [vec![0; length], (length as u32).to_le_bytes().to_vec(), MARK.to_vec()];
        bytes.extend(footer.concat());
        assert_eq!(message(&bytes), "its footer is longer than 16 MiB");
    }
}
