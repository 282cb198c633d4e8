//! Walks structs in Thrift's compact protocol before the Parquet library reads them.
//!
//! Version 60.1 of the library trusts what a file declares (paths in its `src`):
//!
//! * `parquet_thrift.rs:508` counts through a list of booleans without reading a byte, 2^31 times
//!   for each six bytes of a footer or page header: seconds each.
//! * `schema/types.rs:1535` allocates as many columns as a group declares, 16 GB for a few bytes;
//!   line 1539 recurses through groups until the stack is full; and line 1380 copies the names of
//!   all groups around a column for each column.
//! * `file/serialized_reader.rs:457` allocates the unpacked size that a page header declares, up to
//!   2 GB; `compression.rs:313` unpacks gzip to its end, whatever the header declares.
//! * `encodings/decoding.rs:379` allocates as many entries of a dictionary as a page header
//!   declares; lines 989 and 1120 as many lengths of words as the data of a page declare.
//!
//! Lengths of Thrift's lists and of the footer, and compressed sizes, it checks itself.
//!
//! The library assumes the type of every field that it knows, whatever type the file declares
//! (`parquet_macros.rs:389`). So this walk follows the types that the file declares, and refuses a
//! file where these are not the types that the library assumes. The library then reads the file in
//! the same way as this walk. `footer` and `pages` decide by the numbers that the walk finds.

use std::ops::RangeInclusive;

/// Greatest depth of nested structs and lists. Basis: Parquet's own have seven levels. Doubling it
/// accepts deeper files.
const MAX_NESTING: usize = 16;

/// The code of a true boolean, as a file declares the type of a field. This code and those below
/// are Thrift's; Parquet has no other types.
const TYPE_TRUE: u8 = 1;
/// The code of a false boolean.
const TYPE_FALSE: u8 = 2;
/// The code of an integer of one byte.
const TYPE_BYTE: u8 = 3;
/// The code of an integer of 16 bits.
const TYPE_I16: u8 = 4;
/// The code of an integer of 32 bits.
const TYPE_I32: u8 = 5;
/// The code of an integer of 64 bits.
const TYPE_I64: u8 = 6;
/// The code of a float of 64 bits.
const TYPE_DOUBLE: u8 = 7;
/// The code of bytes or a text.
const TYPE_BINARY: u8 = 8;
/// The code of a list.
const TYPE_LIST: u8 = 9;
/// The code of a struct.
const TYPE_STRUCT: u8 = 12;

/// The type as which the library reads a field.
#[derive(Clone, Copy)]
pub(crate) enum ThriftType {
    Bool,
    Byte,
    /// An integer of any width; all widths are encoded alike.
    Number,
    Double,
    Binary,
    List(&'static Self),
    Struct(FieldTypes),
}

/// The types of a struct's fields that the library knows, by field numbers. It skips other fields.
pub(crate) type FieldTypes = &'static [(RangeInclusive<i16>, ThriftType)];

/// An item that a walk reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ThriftItem {
    /// An integer, 1 or 0 for a boolean, or the length of bytes.
    Number(i64),
    /// The end of a struct.
    End,
}

/// Walks the struct at the beginning of some bytes, and returns the bytes behind it. Calls
/// `visit_item` with each number and the path of field numbers that leads to it; elements of a list
/// have the path of the list.
///
/// Returns `None` if the bytes end too early, the fields of a struct are not in order, a declared
/// type is not that in `field_types`, a list holds booleans, or a field is a set, a map or a UUID,
/// which Parquet has not.
pub(crate) fn walk_struct<'a>(
    bytes: &'a [u8],
    field_types: FieldTypes,
    visit_item: &mut dyn FnMut(&[i16], ThriftItem),
) -> Option<&'a [u8]> {
    let mut walk = StructWalk { remaining_bytes: bytes, path: Vec::new(), depth: 0, visit_item };
    walk.walk_fields(Some(field_types))?;
    Some(walk.remaining_bytes)
}

impl ThriftType {
    const fn accepts(self, declared_type: u8) -> bool {
        match self {
            Self::Bool => matches!(declared_type, TYPE_TRUE | TYPE_FALSE),
            Self::Byte => declared_type == TYPE_BYTE,
            Self::Number => matches!(declared_type, TYPE_I16 | TYPE_I32 | TYPE_I64),
            Self::Double => declared_type == TYPE_DOUBLE,
            Self::Binary => declared_type == TYPE_BINARY,
            Self::List(_) => declared_type == TYPE_LIST,
            Self::Struct(_) => declared_type == TYPE_STRUCT,
        }
    }
}

struct StructWalk<'a, 'f> {
    remaining_bytes: &'a [u8],
    path: Vec<i16>,
    depth: usize,
    visit_item: &'f mut dyn FnMut(&[i16], ThriftItem),
}

impl StructWalk<'_, '_> {
    fn walk_fields(&mut self, field_types: Option<FieldTypes>) -> Option<()> {
        let mut field = 0_i16;
        loop {
            let header_byte = self.read_byte()?;
            let field_step = header_byte >> 4;
            let declared_type = header_byte & 0xf;
            if declared_type == 0 {
                (self.visit_item)(&self.path, ThriftItem::End);
                return Some(());
            }
            let last_field = field;
            field = match field_step {
                // The library truncates field numbers to this type too.
                0 => self.read_number()? as i16,
                field_step => field.checked_add(i16::from(field_step))?,
            };
            if field <= last_field {
                return None;
            }
            let expected_type = field_types
                .and_then(|field_types| field_types.iter().find(|(at, _)| at.contains(&field)));
            let expected_type = expected_type.map(|(_, thrift_type)| *thrift_type);
            self.path.push(field);
            if matches!(declared_type, TYPE_TRUE | TYPE_FALSE) {
                // Only a boolean has its value in the byte of its type.
                if !expected_type.is_none_or(|thrift_type| thrift_type.accepts(declared_type)) {
                    return None;
                }
                (self.visit_item)(
                    &self.path,
                    ThriftItem::Number(i64::from(declared_type == TYPE_TRUE)),
                );
            } else {
                self.walk_value(declared_type, expected_type)?;
            }
            self.path.pop();
        }
    }

    fn walk_value(&mut self, declared_type: u8, expected_type: Option<ThriftType>) -> Option<()> {
        if !expected_type.is_none_or(|kind| kind.accepts(declared_type))
            || self.depth == MAX_NESTING
        {
            return None;
        }
        self.depth += 1;
        match declared_type {
            TYPE_BYTE => self.skip(1)?,
            TYPE_I16 | TYPE_I32 | TYPE_I64 => {
                let number = self.read_number()?;
                (self.visit_item)(&self.path, ThriftItem::Number(number));
            }
            TYPE_DOUBLE => self.skip(8)?,
            TYPE_BINARY => {
                let byte_length = self.read_varint()?;
                (self.visit_item)(&self.path, ThriftItem::Number(i64::try_from(byte_length).ok()?));
                self.skip(byte_length)?;
            }
            TYPE_LIST => {
                let header_byte = self.read_byte()?;
                let element_count = if header_byte >> 4 == 0xf {
                    self.read_varint()?
                } else {
                    u64::from(header_byte >> 4)
                };
                let element_type = if let Some(ThriftType::List(kind)) = expected_type {
                    Some(*kind)
                } else {
                    None
                };
                for _ in 0..element_count {
                    self.walk_value(header_byte & 0xf, element_type)?;
                }
            }
            TYPE_STRUCT => {
                let field_types = if let Some(ThriftType::Struct(field_types)) = expected_type {
                    Some(field_types)
                } else {
                    None
                };
                self.walk_fields(field_types)?;
            }
            // Among these are booleans in a list, which take no bytes by the library's reading.
            _ => return None,
        }
        self.depth -= 1;
        Some(())
    }

    fn read_byte(&mut self) -> Option<u8> {
        let (first, remaining_bytes) = self.remaining_bytes.split_first()?;
        self.remaining_bytes = remaining_bytes;
        Some(*first)
    }

    fn skip(&mut self, length: u64) -> Option<()> {
        self.remaining_bytes = self.remaining_bytes.get(usize::try_from(length).ok()?..)?;
        Some(())
    }

    /// Reads an unsigned number in groups of seven bits, the lowest group first.
    fn read_varint(&mut self) -> Option<u64> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.read_byte()?;
            number |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
        None
    }

    /// Reads a signed number, whose lowest bit is the sign.
    fn read_number(&mut self) -> Option<i64> {
        let unsigned_number = self.read_varint()?;
        Some((unsigned_number >> 1) as i64 ^ -((unsigned_number & 1) as i64))
    }
}

/// Encodes numbers as a file has them, for tests.
#[cfg(test)]
pub(crate) mod encode {
    /// Encodes an unsigned number in groups of seven bits, the lowest group first.
    pub(crate) fn encode_varint(mut rest: u64) -> Vec<u8> {
        let mut bytes = Vec::new();
        while rest >= 0x80 {
            bytes.push(rest as u8 | 0x80);
            rest >>= 7;
        }
        bytes.push(rest as u8);
        bytes
    }

    /// Encodes a signed number, whose lowest bit is the sign.
    pub(crate) fn encode_number(value: i32) -> Vec<u8> {
        encode_varint(((i64::from(value) << 1) ^ (i64::from(value) >> 63)) as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEST_FIELD_TYPES: FieldTypes = &[
        (1..=2, ThriftType::Number),
        (
            3..=3,
            ThriftType::List(&ThriftType::Struct(&[
                (1..=1, ThriftType::Bool),
                (2..=2, ThriftType::Binary),
            ])),
        ),
        (4..=4, ThriftType::List(&ThriftType::Number)),
    ];

    /// Returns the items that a walk reports, and the number of bytes behind the struct.
    fn walk_items(bytes: &[u8]) -> Option<(Vec<(Vec<i16>, ThriftItem)>, usize)> {
        let mut found_fields = Vec::new();
        let remaining_bytes = walk_struct(bytes, TEST_FIELD_TYPES, &mut |path, item| {
            found_fields.push((path.to_vec(), item))
        })?;
        Some((found_fields, remaining_bytes.len()))
    }

    #[test]
    fn numbers_are_reported_with_their_paths() {
        use ThriftItem::{End, Number};
        let bytes = [
            // Field 1 is -3, in groups of seven bits; field 2, its number in full, 300.
            &[0x15, 0x05, 0x06, 0x04, 0xd8, 0x04][..],
            // A list of two structs: true and a text; nothing.
            &[0x19, 0x2c, 0x11, 0x18, 0x02, 7, 7, 0, 0],
            // Three numbers, and unknown fields: a double, a list of texts, and a struct.
            &[0x19, 0x36, 2, 4, 6, 0x17, 1, 2, 3, 4, 5, 6, 7, 8],
            &[0x19, 0x28, 0, 1, 7, 0x1c, 0x15, 8, 0, 0, 99],
        ]
        .concat();
        let expected_items = vec![
            (vec![1], Number(-3)),
            (vec![2], Number(300)),
            (vec![3, 1], Number(1)),
            (vec![3, 2], Number(2)),
            (vec![3], End),
            (vec![3], End),
            (vec![4], Number(1)),
            (vec![4], Number(2)),
            (vec![4], Number(3)),
            (vec![6], Number(0)),
            (vec![6], Number(1)),
            (vec![7, 1], Number(4)),
            (vec![7], End),
            (vec![], End),
        ];
        assert_eq!(walk_items(&bytes), Some((expected_items, 1)));
        for length in 0..bytes.len() - 1 {
            assert_eq!(walk_items(&bytes[..length]), None, "{length}");
        }
    }

    #[test]
    fn a_field_of_another_type_than_the_library_assumes_ends_the_walk() {
        assert!(walk_items(&[0x15, 2, 0]).is_some());
        for other in [0x11, 0x13, 0x17, 0x18, 0x19, 0x1c] {
            assert_eq!(walk_items(&[other, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0]), None, "{other:#x}");
        }
        assert!(walk_items(&[0x39, 0x1c, 0, 0]).is_some());
        assert_eq!(walk_items(&[0x39, 0x15, 0, 0]), None, "elements too");
        assert_eq!(walk_items(&[0x39, 0x1c, 0x15, 0, 0, 0]), None, "fields of elements too");
    }

    #[test]
    fn fields_that_are_repeated_or_out_of_order_end_the_walk() {
        // The library takes the last of them.
        assert!(walk_items(&[0x15, 2, 0x15, 2, 0]).is_some());
        for (field, is_after) in [(3, true), (2, false), (1, false)] {
            let bytes = [0x25, 2, 0x09, 2 * field, 0x0c, 0];
            assert_eq!(walk_items(&bytes).is_some(), is_after, "{field}");
        }
    }

    #[test]
    fn lists_of_booleans_end_the_walk_whatever_length_they_declare() {
        assert!(walk_items(&[0x59, 0x02, 0]).is_some(), "there is none in it");
        for other in [0x5a, 0x5b, 0x5d, 0x5e, 0x5f] {
            assert_eq!(walk_items(&[&[other], [0; 20].as_slice()].concat()), None, "{other:#x}");
        }
        for kind in [1, 2] {
            assert_eq!(walk_items(&[0x59, 0x10 | kind, 1, 0]), None);
            assert_eq!(walk_items(&[0x59, 0xf0 | kind, 0xff, 0xff, 0xff, 0xff, 7, 0]), None);
            assert_eq!(walk_items(&[0x59, 0x19, 0x10 | kind, 1, 0]), None, "in a list");
        }
    }

    #[test]
    fn structs_and_lists_that_are_nested_too_deeply_end_the_walk() {
        let nested_structs = |depth: usize| [vec![0x5c; depth], vec![0; depth + 1]].concat();
        assert!(walk_items(&nested_structs(MAX_NESTING)).is_some());
        assert_eq!(walk_items(&nested_structs(MAX_NESTING + 1)), None);
        assert_eq!(walk_items(&[vec![0x59], vec![0x19; 100_000]].concat()), None);
    }
}
