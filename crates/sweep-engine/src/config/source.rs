//! Texts a user wrote (files and command-line arguments), and places in them.

use std::io;
use std::ops::Range;
use std::path::Path;

use sweep_files::regular;

/// Longest file that is read. The longest spin table fits; a result file given by mistake does not.
/// Two bytes may be a table of 1 kB while a file is read: a grid and its machine take up to 1 GB.
pub const LONGEST_BYTES: u64 = 896 << 10;

/// A path in a file, relative to that file's folder.
pub fn beside(file: &Path, named: &str) -> std::path::PathBuf {
    file.parent().unwrap_or(Path::new("")).join(named)
}

/// Nothing but white space and perhaps a byte order mark.
pub fn is_blank(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').trim().is_empty()
}

/// A text among [`Sources`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SourceId(usize);

/// A stretch of bytes in a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// The text.
    pub source: SourceId,
    /// The bytes.
    pub span: Range<usize>,
}

/// A value with the place where it was written.
#[derive(Clone, Debug)]
pub struct Located<T> {
    /// The value.
    pub value: T,
    /// Where it was written.
    pub at: Location,
}

/// Every text read so far, in the order of reading.
#[derive(Debug, Default)]
pub struct Sources(Vec<Source>);

#[derive(Debug)]
struct Source {
    name: String,
    text: String,
}

/// Reads a whole file of text, of bounded length. Pipes that have a writer work as well as plain
/// files.
///
/// # Errors
/// What the system said, or why this is no file of ours.
pub fn read(path: &Path) -> io::Result<String> {
    let bytes = regular::read_text(path, LONGEST_BYTES + 1)?;
    let refused = |why: String| Err(io::Error::other(why));
    if bytes.starts_with(b"PAR1") {
        return refused("it is a Parquet file, not text: `sweep show` reads it".to_owned());
    }
    if bytes.len() as u64 > LONGEST_BYTES {
        return refused(format!(
            "it is longer than {} KiB: give values as a range, or points as a list in a file of \
             their own",
            LONGEST_BYTES >> 10
        ));
    }
    String::from_utf8(bytes).or_else(|error| match error.as_bytes() {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => {
            refused("it is UTF-16, not UTF-8: save it as UTF-8".to_owned())
        }
        _ => {
            let byte = error.utf8_error().valid_up_to() + 1;
            refused(format!("it is not UTF-8 text: the first bad byte is number {byte}"))
        }
    })
}

impl Sources {
    /// Keeps a text under the name that messages show.
    pub fn add(&mut self, name: impl Into<String>, text: impl Into<String>) -> SourceId {
        self.0.push(Source { name: name.into(), text: text.into() });
        SourceId(self.0.len() - 1)
    }

    /// Puts in the text of a source that was kept under its name alone.
    pub fn fill(&mut self, id: SourceId, text: String) {
        self.0[id.0].text = text;
    }

    /// The name that messages show.
    pub fn name(&self, id: SourceId) -> &str {
        &self.0[id.0].name
    }

    /// The text.
    pub fn text(&self, id: SourceId) -> &str {
        &self.0[id.0].text
    }

    /// The line in which a place begins, and the place cut to that line.
    pub fn line(&self, at: &Location) -> Line<'_> {
        let text = self.text(at.source);
        let start = floor_char_boundary(text, at.span.start);
        let line_start = text[..start].rfind('\n').map_or(0, |newline| newline + 1);
        let line_end = text[start..].find('\n').map_or(text.len(), |newline| start + newline);
        let line = text[line_start..line_end].trim_end_matches('\r');
        let end = floor_char_boundary(text, at.span.end).min(line_start + line.len());
        let start = (start - line_start).min(line.len());
        let end = (end.max(line_start) - line_start).max(start);
        // By bytes: a long list's lines are counted for each of its mistakes.
        let number =
            text.as_bytes()[..line_start].iter().filter(|&&byte| byte == b'\n').count() + 1;
        Line { text: line, number, span: start..end }
    }
}

/// One line of a text.
pub struct Line<'a> {
    /// Without its end.
    pub text: &'a str,
    /// From 1.
    pub number: usize,
    /// The place of interest, in bytes of the line.
    pub span: Range<usize>,
}

/// The nearest character boundary at or before `index`.
pub fn floor_char_boundary(text: &str, index: usize) -> usize {
    let mut index = index.min(text.len());
    while !text.is_char_boundary(index) {
        index -= 1;
    }
    index
}

impl Location {
    /// A stretch of a text.
    pub fn new(source: SourceId, span: Range<usize>) -> Self {
        Self { source, span }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line_of(text: &str, span: Range<usize>) -> (String, usize, Range<usize>) {
        let mut sources = Sources::default();
        let id = sources.add("x", text);
        let line = sources.line(&Location::new(id, span));
        (line.text.to_owned(), line.number, line.span)
    }

    #[test]
    fn a_place_is_cut_to_the_line_it_begins_in() {
        assert_eq!(line_of("a = 1\nbc = [\n 2]\n", 11..16), ("bc = [".to_owned(), 2, 5..6));
        assert_eq!(line_of("a = 1\r\nb = 2\r\n", 0..5), ("a = 1".to_owned(), 1, 0..5));
        assert_eq!(line_of("a", 7..9), ("a".to_owned(), 1, 1..1));
        assert_eq!(line_of("", 0..0), (String::new(), 1, 0..0));
        assert_eq!(line_of("a\n", 2..2), (String::new(), 2, 0..0));
        // The middle of a character is pushed back to its beginning.
        assert_eq!(line_of("é = 1", 1..3), ("é = 1".to_owned(), 1, 0..3));
    }

    #[test]
    fn files_that_are_no_text_are_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        let file = |bytes: &[u8]| {
            let path = folder.path().join("file");
            std::fs::write(&path, bytes).unwrap();
            read(&path)
        };
        assert_eq!(file(b"name = 1").unwrap(), "name = 1");
        let refusal = |bytes: &[u8]| file(bytes).unwrap_err().to_string();
        assert!(refusal(b"ab\xffc").ends_with("the first bad byte is number 3"));
        assert!(refusal(b"\xff\xfen\0").starts_with("it is UTF-16"));
        assert!(refusal(b"PAR1\xff").starts_with("it is a Parquet file"));
        let longest = vec![b' '; LONGEST_BYTES as usize];
        assert!(refusal(&[&longest[..], b" "].concat()).starts_with("it is longer than 896 KiB"));
        assert!(file(&longest).is_ok());
        assert!(read(folder.path()).is_err());
    }
}
