//! A file that a command is about to write.

use std::fs;
use std::io::Write as _;
use std::path::Path;

use tempfile::NamedTempFile;

use crate::{FileError, FileKind, atomic, regular};

/// An output file that is not yet finished. Before the command does any work, its path is checked,
/// a missing folder is made, and the temporary file is opened, so that a folder without write
/// permission is reported early.
#[derive(Debug)]
pub struct Output<'a> {
    path: &'a Path,
    kind: FileKind<'a>,
    temporary_file: NamedTempFile,
}

impl<'a> Output<'a> {
    /// Begins a file of this kind. Nothing changes at its path before [`Output::finish`].
    ///
    /// # Errors
    /// [`FileError::Refused`] for what must not be overwritten, [`FileError::Io`].
    pub fn begin(path: &'a Path, kind: FileKind<'a>) -> Result<Self, FileError> {
        check_replaceable(path, kind)?;
        let folder = atomic::parent(path);
        create_folder_without_leftovers(folder)?;
        Ok(Self { path, kind, temporary_file: atomic::create_temporary(folder)? })
    }

    /// Writes the next bytes.
    ///
    /// # Errors
    /// [`FileError::Io`].
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), FileError> {
        self.temporary_file.write_all(bytes).map_err(FileError::io("write", self.path))
    }

    /// Writes the last bytes and publishes the file at its path.
    ///
    /// # Errors
    /// The errors of [`Output::begin`], also for a file that has appeared at the path meanwhile.
    pub fn finish(mut self, bytes: &[u8]) -> Result<(), FileError> {
        self.write(bytes)?;
        check_replaceable(self.path, self.kind)?;
        atomic::publish(self.temporary_file, self.path)
    }
}

/// Writes a file of this kind into a folder of [`create_folder_without_leftovers`].
///
/// # Errors
/// Those of [`Output::begin`].
pub fn write(path: &Path, kind: FileKind<'_>, bytes: &[u8]) -> Result<(), FileError> {
    check_replaceable(path, kind)?;
    let output =
        Output { path, kind, temporary_file: atomic::create_temporary(atomic::parent(path))? };
    output.finish(bytes)
}

/// Makes a folder and its parents, and deletes the temporary files of killed processes in it.
///
/// # Errors
/// [`FileError::Io`].
pub fn create_folder_without_leftovers(folder: &Path) -> Result<(), FileError> {
    fs::create_dir_all(folder).map_err(FileError::io("make the folder", folder))?;
    atomic::clear_leftovers(folder);
    Ok(())
}

/// Checks that a file of this kind may be written at a path, over the file that is there.
///
/// # Errors
/// [`FileError::Refused`] for what must not be overwritten, [`FileError::Io`],
/// [`FileError::Damaged`].
pub fn check_replaceable(path: &Path, kind: FileKind<'_>) -> Result<(), FileError> {
    let refusal = |reason: &str, help| {
        Err(FileError::Refused { path: path.to_path_buf(), reason: reason.to_owned(), help })
    };
    // Advice about a path that cannot be a file's.
    const NAME_ADVICE: &str = "give the name of a file, such as results/x.parquet";
    if path.file_name().is_none() {
        return refusal("it has no file name", NAME_ADVICE);
    }
    let text = path.to_string_lossy();
    let ends_in_separator = |text: &str| text.ends_with(std::path::is_separator);
    if ends_in_separator(&text) || text.strip_suffix('.').is_some_and(ends_in_separator) {
        return refusal("it is the name of a folder", NAME_ADVICE);
    }
    if let Some(ending) = kind.other_format(path) {
        return refusal(
            &format!("it ends in .{ending}, and the file would be Parquet"),
            "give a name that ends in .parquet; `sweep export` makes CSV or Excel of the file, and \
             `sweep plot` pictures",
        );
    }
    let metadata = regular::none_if_missing(fs::symlink_metadata(path));
    let Some(metadata) = metadata.map_err(FileError::io("look at", path))? else { return Ok(()) };
    if metadata.is_symlink() {
        return refusal(
            "it is a symbolic link",
            "give the name of the file that the link leads to, or remove the link",
        );
    }
    if let Some(description) = regular::describe_file_type(metadata.file_type()) {
        return refusal(&format!("it is {description}, not a regular file"), NAME_ADVICE);
    }
    if metadata.len() == 0 {
        return Ok(());
    }
    match kind.objection(path)? {
        None => Ok(()),
        Some(reason) => refusal(&reason, "give another name, or move that file away first"),
    }
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;
    use std::io::Cursor;
    use std::path::PathBuf;
    use std::sync::Arc;

    use arrow_array::{ArrayRef, Float64Array, RecordBatch};
    use parquet::file::metadata::KeyValue;
    use serde_json::json;

    use super::*;
    use crate::{Writer, key, seal};

    const PARQUET_KINDS: [FileKind<'_>; 9] = [
        FileKind::Map,
        FileKind::Trace,
        FileKind::Modes,
        FileKind::Boundary,
        FileKind::Stability,
        FileKind::Dwell,
        FileKind::Optimise,
        FileKind::Fit,
        FileKind::Differences,
    ];

    /// Returns the bytes of a file of this kind, as the commands write it.
    fn example_file(kind: FileKind<'_>) -> Vec<u8> {
        let columns = match kind {
            FileKind::Map => key::PLAN,
            FileKind::Trace => key::TRACE,
            FileKind::Modes => key::MODES,
            FileKind::Boundary => key::BOUNDARY,
            FileKind::Stability => key::STABILITY,
            FileKind::Dwell => key::DWELL,
            FileKind::Optimise => key::OPTIMISE,
            FileKind::Fit => key::FIT,
            FileKind::ModelFile => return format!("{}x\n", crate::MODEL_FILE_START).into_bytes(),
            FileKind::Differences => key::DIFFERENCES,
            FileKind::Exported { ending: "csv" } => {
                return format!("{}x\n", crate::EXPORTED_CSV).into_bytes();
            }
            FileKind::Exported { .. } => return b"PK\x03\x04...".to_vec(),
            FileKind::Sidecar { result_name } => {
                return json!({ "file": result_name.to_str(), "plan_hash": "00" })
                    .to_string()
                    .into_bytes();
            }
            FileKind::Svg => {
                return b"<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1\"/>".to_vec();
            }
            FileKind::Pdf => return crate::PDF_START.to_vec(),
            FileKind::Png => return b"\x89PNG\r\n\x1a\n...".to_vec(),
            FileKind::Html => return b"<!doctype html>\n<title>x</title>".to_vec(),
            FileKind::ManPage => return b".ie \\n(.g .ds Aq \\(aq\n".to_vec(),
        };
        sealed_file(&[key::PLAN, columns])
    }

    /// Makes a Parquet file of one number, with a digest and with these keys in its metadata.
    fn sealed_file(keys: &[&str]) -> Vec<u8> {
        let numbers: ArrayRef = Arc::new(Float64Array::from(vec![1.0]));
        let batch = RecordBatch::try_from_iter([("x", numbers)]).unwrap();
        let mut writer = Writer::new(Vec::new(), &batch.schema(), Default::default()).unwrap();
        writer.write(&batch).unwrap();
        let mut writer = writer.end().unwrap();
        for key in keys {
            let empty_json = "{}".to_owned();
            writer.append_key_value_metadata(KeyValue::new((*key).to_owned(), empty_json));
        }
        writer.append_key_value_metadata(seal::blank_digest());
        let mut file = Cursor::new(writer.into_inner().unwrap());
        seal::seal(&mut file).unwrap();
        file.into_inner()
    }

    fn all_kinds() -> impl Iterator<Item = FileKind<'static>> {
        let sidecar = FileKind::Sidecar { result_name: OsStr::new("x.parquet") };
        PARQUET_KINDS.into_iter().chain([
            sidecar,
            FileKind::ModelFile,
            FileKind::Svg,
            FileKind::Pdf,
            FileKind::Png,
            FileKind::Html,
            FileKind::ManPage,
            FileKind::Exported { ending: "csv" },
            FileKind::Exported { ending: "xlsx" },
        ])
    }

    fn refusal_message(path: &Path, kind: FileKind<'_>) -> String {
        let error = Output::begin(path, kind).unwrap_err();
        assert!(error.is_refusal(), "{error}");
        let text = error.to_string();
        assert!(text.contains("cannot be an output") && text.contains("= help: give"), "{text}");
        text
    }

    fn file_names(folder: &Path) -> Vec<String> {
        let names = regular::file_names(folder).unwrap();
        names.into_iter().map(|name| name.into_string().unwrap()).collect()
    }

    #[test]
    fn a_file_is_written_over_its_own_kind_and_no_other() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("file");
        for kind in all_kinds() {
            for other in all_kinds() {
                let original_bytes = example_file(other);
                fs::write(&path, &original_bytes).unwrap();
                if kind == other {
                    Output::begin(&path, kind).unwrap().finish(b"new").unwrap();
                    assert_eq!(fs::read(&path).unwrap(), b"new");
                } else {
                    let message = refusal_message(&path, kind);
                    assert!(message.contains(kind.name()), "{message}");
                    assert!(fs::read(&path).unwrap() == original_bytes);
                }
            }
            for mine in ["my thesis", "PAR1", "{}"] {
                fs::write(&path, mine).unwrap();
                refusal_message(&path, kind);
                assert_eq!(fs::read_to_string(&path).unwrap(), mine);
            }
            fs::write(&path, "").unwrap();
            Output::begin(&path, kind).unwrap().finish(b"over an empty file").unwrap();
        }
        assert_eq!(file_names(directory.path()), ["file"]);
    }

    #[test]
    fn results_with_different_names_have_sidecars_with_different_names() {
        let svg_path = |output| crate::path_beside(Path::new(output), "svg");
        assert_eq!(svg_path("maps/x.parquet"), Path::new("maps/x.svg"));
        assert_eq!(svg_path("v1.0"), Path::new("v1.0.svg"));
        assert_eq!(svg_path("v1.5.parquet"), Path::new("v1.5.svg"));
    }

    #[test]
    fn an_output_changes_nothing_before_it_is_finished() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("made/for/it/x.svg");
        let output = Output::begin(&path, FileKind::Svg).unwrap();
        assert!(!path.exists());
        drop(output);
        assert!(file_names(path.parent().unwrap()).is_empty());

        let output = Output::begin(&path, FileKind::Svg).unwrap();
        fs::write(&path, "came meanwhile").unwrap();
        assert!(output.finish(b"new").unwrap_err().is_refusal());
        assert_eq!(fs::read_to_string(&path).unwrap(), "came meanwhile");
        assert_eq!(file_names(path.parent().unwrap()), ["x.svg"]);
    }

    #[test]
    fn names_of_folders_are_refused() {
        let directory = tempfile::tempdir().unwrap();
        let message = refusal_message(directory.path(), FileKind::Map);
        assert!(message.contains("it is a folder"), "{message}");
        for (name, expected) in [
            ("new/", "it is the name of a folder"),
            ("new/.", "it is the name of a folder"),
            ("new/..", "it has no file name"),
        ] {
            let message = refusal_message(
                &PathBuf::from(format!("{}/{name}", directory.path().display())),
                FileKind::Map,
            );
            assert!(message.contains(expected), "{name}: {message}");
        }
        refusal_message(Path::new("/"), FileKind::Map);
        refusal_message(Path::new(""), FileKind::Map);
        assert!(file_names(directory.path()).is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn links_and_devices_are_refused_and_the_targets_of_links_stay() {
        let directory = tempfile::tempdir().unwrap();
        let [fifo, target, link, dangling] =
            ["fifo", "target", "link", "dangling"].map(|name| directory.path().join(name));
        rustix::fs::mkfifoat(rustix::fs::CWD, &fifo, rustix::fs::Mode::RUSR).unwrap();
        for kind in all_kinds() {
            let _ = fs::remove_file(&link);
            let _ = fs::remove_file(&dangling);
            fs::write(&target, example_file(kind)).unwrap();
            std::os::unix::fs::symlink(&target, &link).unwrap();
            std::os::unix::fs::symlink("nowhere", &dangling).unwrap();
            for (path, expected) in [
                (&fifo, "it is a FIFO"),
                (&link, "it is a symbolic link"),
                (&dangling, "it is a symbolic link"),
                (&PathBuf::from("/dev/null"), "it is a device"),
            ] {
                let message = refusal_message(path, kind);
                assert!(message.contains(expected), "{message}");
            }
            assert!(fs::read(&target).unwrap() == example_file(kind));
        }
    }
}
