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
const TRUE: u8 = 1;
/// The code of a false boolean.
const FALSE: u8 = 2;
/// The code of an integer of one byte.
const BYTE: u8 = 3;
/// The code of an integer of 16 bits.
const I16: u8 = 4;
/// The code of an integer of 32 bits.
const I32: u8 = 5;
/// The code of an integer of 64 bits.
const I64: u8 = 6;
/// The code of a float of 64 bits.
const DOUBLE: u8 = 7;
/// The code of bytes or a text.
const BINARY: u8 = 8;
/// The code of a list.
const LIST: u8 = 9;
/// The code of a struct.
const STRUCT: u8 = 12;

/// The type as which the library reads a field.
#[derive(Clone, Copy)]
pub(crate) enum Wire {
    Bool,
    Byte,
    /// An integer of any width; all widths are encoded alike.
    Number,
    Double,
    Binary,
    List(&'static Self),
    Struct(Shape),
}

/// The types of a struct's fields that the library knows, by field numbers. It skips other fields.
pub(crate) type Shape = &'static [(RangeInclusive<i16>, Wire)];

/// An item that a walk reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Found {
    /// An integer, 1 or 0 for a boolean, or the length of bytes.
    Number(i64),
    /// The end of a struct.
    End,
}

/// Walks the struct at the beginning of some bytes, and returns the bytes behind it. Calls `found`
/// with each number and the path of field numbers that leads to it; elements of a list have the
/// path of the list.
///
/// Returns `None` if the bytes end too early, the fields of a struct are not in order, a declared
/// type is not that in `shape`, a list holds booleans, or a field is a set, a map or a UUID, which
/// Parquet has not.
pub(crate) fn walk<'a>(
    bytes: &'a [u8],
    shape: Shape,
    found: &mut dyn FnMut(&[i16], Found),
) -> Option<&'a [u8]> {
    let mut walk = Walk { rest: bytes, path: Vec::new(), depth: 0, found };
    walk.fields(Some(shape))?;
    Some(walk.rest)
}

impl Wire {
    const fn is(self, declared: u8) -> bool {
        match self {
            Self::Bool => matches!(declared, TRUE | FALSE),
            Self::Byte => declared == BYTE,
            Self::Number => matches!(declared, I16 | I32 | I64),
            Self::Double => declared == DOUBLE,
            Self::Binary => declared == BINARY,
            Self::List(_) => declared == LIST,
            Self::Struct(_) => declared == STRUCT,
        }
    }
}

struct Walk<'a, 'f> {
    rest: &'a [u8],
    path: Vec<i16>,
    depth: usize,
    found: &'f mut dyn FnMut(&[i16], Found),
}

impl Walk<'_, '_> {
    fn fields(&mut self, shape: Option<Shape>) -> Option<()> {
        let mut field = 0_i16;
        loop {
            let header_byte = self.byte()?;
            let step = header_byte >> 4;
            let declared = header_byte & 0xf;
            if declared == 0 {
                (self.found)(&self.path, Found::End);
                return Some(());
            }
            let last_field = field;
            field = match step {
                // The library truncates field numbers to this type too.
                0 => self.number()? as i16,
                step => field.checked_add(i16::from(step))?,
            };
            if field <= last_field {
                return None;
            }
            let known_type =
                shape.and_then(|shape| shape.iter().find(|(at, _)| at.contains(&field)));
            let known_type = known_type.map(|(_, kind)| *kind);
            self.path.push(field);
            if matches!(declared, TRUE | FALSE) {
                // Only a boolean has its value in the byte of its type.
                if !known_type.is_none_or(|kind| kind.is(declared)) {
                    return None;
                }
                (self.found)(&self.path, Found::Number(i64::from(declared == TRUE)));
            } else {
                self.value(declared, known_type)?;
            }
            self.path.pop();
        }
    }

    fn value(&mut self, declared: u8, known: Option<Wire>) -> Option<()> {
        if !known.is_none_or(|kind| kind.is(declared)) || self.depth == MAX_NESTING {
            return None;
        }
        self.depth += 1;
        match declared {
            BYTE => self.skip(1)?,
            I16 | I32 | I64 => {
                let number = self.number()?;
                (self.found)(&self.path, Found::Number(number));
            }
            DOUBLE => self.skip(8)?,
            BINARY => {
                let length = self.varint()?;
                (self.found)(&self.path, Found::Number(i64::try_from(length).ok()?));
                self.skip(length)?;
            }
            LIST => {
                let header_byte = self.byte()?;
                let length = if header_byte >> 4 == 0xf {
                    self.varint()?
                } else {
                    u64::from(header_byte >> 4)
                };
                let element = if let Some(Wire::List(kind)) = known { Some(*kind) } else { None };
                for _ in 0..length {
                    self.value(header_byte & 0xf, element)?;
                }
            }
            STRUCT => {
                let shape = if let Some(Wire::Struct(shape)) = known { Some(shape) } else { None };
                self.fields(shape)?;
            }
            // Among these are booleans in a list, which take no bytes by the library's reading.
            _ => return None,
        }
        self.depth -= 1;
        Some(())
    }

    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(*first)
    }

    fn skip(&mut self, length: u64) -> Option<()> {
        self.rest = self.rest.get(usize::try_from(length).ok()?..)?;
        Some(())
    }

    /// Reads an unsigned number in groups of seven bits, the lowest group first.
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

    /// Reads a signed number, whose lowest bit is the sign.
    fn number(&mut self) -> Option<i64> {
        let number = self.varint()?;
        Some((number >> 1) as i64 ^ -((number & 1) as i64))
    }
}

/// Encodes numbers as a file has them, for tests.
#[cfg(test)]
pub(crate) mod encode {
    /// Encodes an unsigned number in groups of seven bits, the lowest group first.
    pub(crate) fn varint(mut rest: u64) -> Vec<u8> {
        let mut bytes = Vec::new();
        while rest >= 0x80 {
            bytes.push(rest as u8 | 0x80);
            rest >>= 7;
        }
        bytes.push(rest as u8);
        bytes
    }

    /// Encodes a signed number, whose lowest bit is the sign.
    pub(crate) fn number(value: i32) -> Vec<u8> {
        varint(((i64::from(value) << 1) ^ (i64::from(value) >> 63)) as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPE: Shape = &[
        (1..=2, Wire::Number),
        (3..=3, Wire::List(&Wire::Struct(&[(1..=1, Wire::Bool), (2..=2, Wire::Binary)]))),
        (4..=4, Wire::List(&Wire::Number)),
    ];

    /// Returns the items that a walk reports, and the number of bytes behind the struct.
    fn walked(bytes: &[u8]) -> Option<(Vec<(Vec<i16>, Found)>, usize)> {
        let mut found_fields = Vec::new();
        let rest =
            walk(bytes, SHAPE, &mut |path, found| found_fields.push((path.to_vec(), found)))?;
        Some((found_fields, rest.len()))
    }

    #[test]
    fn numbers_are_reported_with_their_paths() {
        use Found::{End, Number};
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
        let expected = vec![
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
        assert_eq!(walked(&bytes), Some((expected, 1)));
        for length in 0..bytes.len() - 1 {
            assert_eq!(walked(&bytes[..length]), None, "{length}");
        }
    }

    #[test]
    fn a_field_of_another_type_than_the_library_assumes_ends_the_walk() {
        assert!(walked(&[0x15, 2, 0]).is_some());
        for other in [0x11, 0x13, 0x17, 0x18, 0x19, 0x1c] {
            assert_eq!(walked(&[other, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0]), None, "{other:#x}");
        }
        assert!(walked(&[0x39, 0x1c, 0, 0]).is_some());
        assert_eq!(walked(&[0x39, 0x15, 0, 0]), None, "elements too");
        assert_eq!(walked(&[0x39, 0x1c, 0x15, 0, 0, 0]), None, "fields of elements too");
    }

    #[test]
    fn fields_that_are_repeated_or_out_of_order_end_the_walk() {
        // The library takes the last of them.
        assert!(walked(&[0x15, 2, 0x15, 2, 0]).is_some());
        for (field, is_after) in [(3, true), (2, false), (1, false)] {
            let bytes = [0x25, 2, 0x09, 2 * field, 0x0c, 0];
            assert_eq!(walked(&bytes).is_some(), is_after, "{field}");
        }
    }

    #[test]
    fn lists_of_booleans_end_the_walk_whatever_length_they_declare() {
        assert!(walked(&[0x59, 0x02, 0]).is_some(), "there is none in it");
        for other in [0x5a, 0x5b, 0x5d, 0x5e, 0x5f] {
            assert_eq!(walked(&[&[other], [0; 20].as_slice()].concat()), None, "{other:#x}");
        }
        for kind in [1, 2] {
            assert_eq!(walked(&[0x59, 0x10 | kind, 1, 0]), None);
            assert_eq!(walked(&[0x59, 0xf0 | kind, 0xff, 0xff, 0xff, 0xff, 7, 0]), None);
            assert_eq!(walked(&[0x59, 0x19, 0x10 | kind, 1, 0]), None, "in a list");
        }
    }

    #[test]
    fn structs_and_lists_that_are_nested_too_deeply_end_the_walk() {
        let nested = |depth: usize| [vec![0x5c; depth], vec![0; depth + 1]].concat();
        assert!(walked(&nested(MAX_NESTING)).is_some());
        assert_eq!(walked(&nested(MAX_NESTING + 1)), None);
        assert_eq!(walked(&[vec![0x59], vec![0x19; 100_000]].concat()), None);
    }
}
