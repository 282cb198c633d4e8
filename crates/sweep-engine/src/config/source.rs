//! The texts that a user wrote (files and command-line arguments), and locations in them.

use std::io;
use std::ops::Range;
use std::path::Path;

use sweep_files::regular;

/// Maximum size of a file of text, bytes. Basis: the longest spin table fits, and a result file
/// that is passed by mistake does not. Doubling it doubles the peak memory: two bytes may become a
/// table of 1 kB, so that a grid and its machine take up to 1 GB.
pub const MAX_TEXT_BYTES: u64 = 896 << 10;

/// Resolves a path in a file, relative to the file's folder.
pub fn resolve_beside(file: &Path, relative_path: &str) -> std::path::PathBuf {
    file.parent().unwrap_or(Path::new("")).join(relative_path)
}

/// Returns whether a text has nothing but white space and a byte order mark.
pub fn is_blank(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').trim().is_empty()
}

/// The index of a text in [`Sources`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SourceId(usize);

/// A range of bytes in a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// The text.
    pub source: SourceId,
    /// The byte range.
    pub span: Range<usize>,
}

/// A value with its location.
#[derive(Clone, Debug)]
pub struct Located<T> {
    /// The value.
    pub value: T,
    /// The location at which it was written.
    pub location: Location,
}

/// The texts that were read, in order.
#[derive(Debug, Default)]
pub struct Sources(Vec<SourceText>);

#[derive(Debug)]
struct SourceText {
    name: String,
    text: String,
}

/// Reads a file of text of bounded length. Pipes that have a writer work as well as plain files.
///
/// # Errors
/// The system's error, or the reason why the file is no text.
pub fn read_text_file(path: &Path) -> io::Result<String> {
    let bytes = regular::read_text(path, MAX_TEXT_BYTES + 1)?;
    let refuse_content = |reason: String| Err(io::Error::other(reason));
    if bytes.starts_with(b"PAR1") {
        return refuse_content("it is a Parquet file, not text: `sweep show` reads it".to_owned());
    }
    if bytes.len() as u64 > MAX_TEXT_BYTES {
        return refuse_content(format!(
            "it is longer than {} KiB: give values as a range, or points as a list in a file of \
             their own",
            MAX_TEXT_BYTES >> 10
        ));
    }
    String::from_utf8(bytes).or_else(|error| match error.as_bytes() {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => {
            refuse_content("it is UTF-16, not UTF-8: save it as UTF-8".to_owned())
        }
        _ => {
            let byte = error.utf8_error().valid_up_to() + 1;
            refuse_content(format!("it is not UTF-8 text: the first bad byte is number {byte}"))
        }
    })
}

impl Sources {
    /// Adds a text under the name that messages show.
    pub fn add(&mut self, name: impl Into<String>, text: impl Into<String>) -> SourceId {
        self.0.push(SourceText { name: name.into(), text: text.into() });
        SourceId(self.0.len() - 1)
    }

    /// Sets the text of a source that was added without one.
    pub fn set_text(&mut self, id: SourceId, text: String) {
        self.0[id.0].text = text;
    }

    /// Returns the name that messages show.
    pub fn name(&self, id: SourceId) -> &str {
        &self.0[id.0].name
    }

    /// Returns the text.
    pub fn text(&self, id: SourceId) -> &str {
        &self.0[id.0].text
    }

    /// Returns the line in which a location begins, and the part of the location on that line.
    pub fn line(&self, location: &Location) -> SourceLine<'_> {
        let text = self.text(location.source);
        let start = floor_char_boundary(text, location.span.start);
        let line_start = text[..start].rfind('\n').map_or(0, |newline| newline + 1);
        let line_end = text[start..].find('\n').map_or(text.len(), |newline| start + newline);
        let line = text[line_start..line_end].trim_end_matches('\r');
        let end = floor_char_boundary(text, location.span.end).min(line_start + line.len());
        let start = (start - line_start).min(line.len());
        let end = (end.max(line_start) - line_start).max(start);
        // Newline bytes are counted instead of characters, because each mistake in a long list
        // counts the lines before it.
        let line_number =
            text.as_bytes()[..line_start].iter().filter(|&&byte| byte == b'\n').count() + 1;
        SourceLine { text: line, number: line_number, span: start..end }
    }
}

/// A line of a text.
pub struct SourceLine<'a> {
    /// The text without its end.
    pub text: &'a str,
    /// The number, from 1.
    pub number: usize,
    /// The location in bytes of the line.
    pub span: Range<usize>,
}

/// Returns the nearest character boundary at or before `index`.
pub fn floor_char_boundary(text: &str, index: usize) -> usize {
    let mut index = index.min(text.len());
    while !text.is_char_boundary(index) {
        index -= 1;
    }
    index
}

impl Location {
    /// Returns a range of bytes in a text.
    pub fn new(source: SourceId, span: Range<usize>) -> Self {
        Self { source, span }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn find_line(text: &str, span: Range<usize>) -> (String, usize, Range<usize>) {
        let mut sources = Sources::default();
        let id = sources.add("x", text);
        let line = sources.line(&Location::new(id, span));
        (line.text.to_owned(), line.number, line.span)
    }

    #[test]
    fn a_location_is_cut_to_its_first_line() {
        assert_eq!(find_line("a = 1\nbc = [\n 2]\n", 11..16), ("bc = [".to_owned(), 2, 5..6));
        assert_eq!(find_line("a = 1\r\nb = 2\r\n", 0..5), ("a = 1".to_owned(), 1, 0..5));
        assert_eq!(find_line("a", 7..9), ("a".to_owned(), 1, 1..1));
        assert_eq!(find_line("", 0..0), (String::new(), 1, 0..0));
        assert_eq!(find_line("a\n", 2..2), (String::new(), 2, 0..0));
        // The middle of a character is moved back to its beginning.
        assert_eq!(find_line("é = 1", 1..3), ("é = 1".to_owned(), 1, 0..3));
    }

    #[test]
    fn files_that_are_no_text_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let read_bytes = |bytes: &[u8]| {
            let path = folder.path().join("file");
            std::fs::write(&path, bytes).unwrap();
            read_text_file(&path)
        };
        assert_eq!(read_bytes(b"name = 1").unwrap(), "name = 1");
        let read_error = |bytes: &[u8]| read_bytes(bytes).unwrap_err().to_string();
        assert!(read_error(b"ab\xffc").ends_with("the first bad byte is number 3"));
        assert!(read_error(b"\xff\xfen\0").starts_with("it is UTF-16"));
        assert!(read_error(b"PAR1\xff").starts_with("it is a Parquet file"));
        let largest_text = vec![b' '; MAX_TEXT_BYTES as usize];
        assert!(
            read_error(&[&largest_text[..], b" "].concat())
                .starts_with("it is longer than 896 KiB")
        );
        assert!(read_bytes(&largest_text).is_ok());
        assert!(read_text_file(folder.path()).is_err());
    }
}
