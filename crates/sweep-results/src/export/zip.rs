//! A zip archive, after PKWARE's APPNOTE: what a workbook needs of it, and no more.

use std::io::{self, Write as _};

use flate2::{Compression, Crc, write::DeflateEncoder};

/// 1 January 1980 as archives write it: the same parts give the same bytes, whenever it is.
const DATE: u16 = 1 << 5 | 1;
/// "Deflated".
const METHOD: u16 = 8;
/// The version of the format that unpacks such a part: 2.0.
const VERSION: u16 = 20;

/// An archive of deflated parts.
#[derive(Default)]
pub(super) struct Archive {
    bytes: Vec<u8>,
    directory: Vec<u8>,
    parts: u16,
}

impl Archive {
    /// Adds a part. Sizes are those of an archive without the 64-bit extension.
    ///
    /// # Errors
    /// A part, or an archive, of 4 GiB or more.
    pub(super) fn add(&mut self, name: &str, content: &[u8]) -> io::Result<()> {
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(content)?;
        let packed = encoder.finish()?;
        let mut sum = Crc::new();
        sum.update(content);
        let size = |bytes: usize| u32::try_from(bytes).map_err(io::Error::other);
        let offset = size(self.bytes.len())?;
        let mut about = Vec::new();
        for field in [VERSION, 0, METHOD, 0, DATE] {
            about.extend(field.to_le_bytes());
        }
        for field in [sum.sum(), size(packed.len())?, size(content.len())?] {
            about.extend(field.to_le_bytes());
        }
        let length = u16::try_from(name.len()).map_err(io::Error::other)?;
        about.extend(length.to_le_bytes());
        about.extend(0_u16.to_le_bytes());

        self.bytes.extend(b"PK\x03\x04");
        self.bytes.extend(&about);
        self.bytes.extend(name.as_bytes());
        self.bytes.extend(&packed);

        self.directory.extend(b"PK\x01\x02");
        self.directory.extend(VERSION.to_le_bytes());
        self.directory.extend(&about);
        // No comment, the first disk, no attributes.
        self.directory.extend([0; 10]);
        self.directory.extend(offset.to_le_bytes());
        self.directory.extend(name.as_bytes());
        self.parts += 1;
        Ok(())
    }

    /// The archive.
    ///
    /// # Errors
    /// An archive of 4 GiB or more.
    pub(super) fn finish(mut self) -> io::Result<Vec<u8>> {
        let size = |bytes: usize| u32::try_from(bytes).map_err(io::Error::other);
        let (at, length) = (size(self.bytes.len())?, size(self.directory.len())?);
        self.bytes.extend(&self.directory);
        self.bytes.extend(b"PK\x05\x06");
        self.bytes.extend([0; 4]);
        self.bytes.extend(self.parts.to_le_bytes());
        self.bytes.extend(self.parts.to_le_bytes());
        self.bytes.extend(length.to_le_bytes());
        self.bytes.extend(at.to_le_bytes());
        self.bytes.extend([0; 2]);
        Ok(self.bytes)
    }
}
