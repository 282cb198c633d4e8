//! Opens regular files and lists folders, without waiting for anybody and without a panic.

use std::ffi::OsString;
use std::fs::{self, File, FileType, OpenOptions};
use std::io::{self, Read as _};
use std::path::Path;
#[cfg(unix)]
use std::time::{Duration, Instant};

/// Opens a regular file for reading. Anything else is an error that says what it is.
///
/// # Errors
/// An error of the system, or an error with the type of a file that is not regular.
pub fn open(path: &Path) -> io::Result<File> {
    // The type is checked before opening too, because opening alone starts some devices.
    expect_regular(fs::metadata(path)?.file_type())?;
    let file = without_waiting(OpenOptions::new().read(true), true).open(path)?;
    expect_regular(file.metadata()?.file_type())?;
    Ok(file)
}

/// Time for which a named pipe may have no writer. Basis: a program that a script starts beside
/// this one opens its pipe within milliseconds. Doubling it doubles the time until a pipe without a
/// writer is refused.
#[cfg(unix)]
const WRITER_WAIT: Duration = Duration::from_secs(2);

/// Time between two attempts to read a pipe without data.
#[cfg(unix)]
const READ_RETRY_INTERVAL: Duration = Duration::from_millis(5);

/// Reads at most `most` bytes of a text file that a user names, or of a pipe, as a shell's `<(...)`
/// and `/dev/stdin` are. A named pipe without a writer is an error after two seconds.
///
/// # Errors
/// An error of the system, or an error with the type of a file that is neither regular nor a pipe.
#[cfg(unix)]
pub fn read_text(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    use std::os::unix::fs::FileTypeExt as _;
    // The parent process passed these descriptors, and has opened the other end of such a pipe
    // before.
    let is_passed_descriptor = path.starts_with("/dev/fd")
        || path.starts_with("/proc/self/fd")
        || path == Path::new("/dev/stdin");
    let file_type = fs::metadata(path)?.file_type();
    if !file_type.is_fifo() && !is_passed_descriptor {
        let mut bytes = Vec::new();
        open(path)?.take(max_bytes).read_to_end(&mut bytes)?;
        return Ok(bytes);
    }
    // Opening a pipe in this way does not wait for a writer, and unblocks writers that wait for a
    // reader.
    let file = without_waiting(OpenOptions::new().read(true), true).open(path)?;
    let start_time = Instant::now();
    let mut bytes = Vec::new();
    while (bytes.len() as u64) < max_bytes {
        let mut buffer = [0; 1 << 16];
        let remaining_bytes = usize::try_from(max_bytes - bytes.len() as u64).unwrap_or(usize::MAX);
        let remaining_bytes = remaining_bytes.min(buffer.len());
        match (&file).read(&mut buffer[..remaining_bytes]) {
            Ok(0) if is_passed_descriptor || !bytes.is_empty() => break,
            Ok(0) if start_time.elapsed() >= WRITER_WAIT => {
                let reason = "it is a FIFO that nobody writes to";
                return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
            }
            Ok(0) => std::thread::sleep(READ_RETRY_INTERVAL),
            Ok(count) => bytes.extend_from_slice(&buffer[..count]),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                std::thread::sleep(READ_RETRY_INTERVAL);
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(bytes)
}

/// Reads at most `most` bytes of a text file that a user names.
///
/// # Errors
/// An error of the system, or an error with the type of a file that is neither regular nor a pipe.
#[cfg(not(unix))]
pub fn read_text(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(max_bytes).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Returns `None` instead of the error "not found".
///
/// # Errors
/// Any other error of the system.
pub fn none_if_missing<T>(result: io::Result<T>) -> io::Result<Option<T>> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        result => result.map(Some),
    }
}

/// Greatest number of bytes of a plan or of a sidecar. Basis: ours have kilobytes, and 16 MiB of
/// JSON may take half a GB. Twice as many may take 1 GB.
pub const MAX_JSON_BYTES: u64 = 16 << 20;

/// Reads the text of a JSON file. A file that is too long to be ours is cut off, so that it no
/// longer parses.
///
/// # Errors
/// An error of the system, or an error with the type of a file that is not regular.
pub fn read_json(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(MAX_JSON_BYTES).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Opens a regular file to read and write. Follows no symbolic link.
pub(crate) fn open_to_write(path: &Path) -> io::Result<File> {
    expect_regular(fs::symlink_metadata(path)?.file_type())?;
    let file = without_waiting(OpenOptions::new().read(true).write(true), false).open(path)?;
    expect_regular(file.metadata()?.file_type())?;
    Ok(file)
}

/// Opens a regular file to read and write, and makes it if there is none. Follows no symbolic link.
///
/// # Errors
/// An error of the system, or an error with the type of a file that is not regular.
pub fn open_or_create(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    match without_waiting(options.read(true).write(true).create_new(true), false).open(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => open_to_write(path),
        created => created,
    }
}

fn expect_regular(file_type: FileType) -> io::Result<()> {
    match describe_file_type(file_type) {
        None => Ok(()),
        Some(description) => Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            format!("it is {description}, not a regular file"),
        )),
    }
}

/// Names the type of a file; `None` for a regular one.
pub(crate) fn describe_file_type(file_type: FileType) -> Option<&'static str> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        if file_type.is_fifo() {
            return Some("a FIFO");
        }
        if file_type.is_socket() {
            return Some("a socket");
        }
        if file_type.is_block_device() || file_type.is_char_device() {
            return Some("a device");
        }
    }
    if file_type.is_dir() {
        Some("a folder")
    } else if file_type.is_symlink() {
        Some("a symbolic link")
    } else {
        None
    }
}

/// Sets the options so that opening does not wait, and follows symbolic links only if asked to. On
/// systems other than Unix, paths of users lead to neither pipes nor links.
#[cfg_attr(not(unix), allow(unused_variables))]
fn without_waiting(options: &mut OpenOptions, follows_links: bool) -> &mut OpenOptions {
    #[cfg(unix)]
    {
        use rustix::fs::OFlags;
        use std::os::unix::fs::OpenOptionsExt as _;
        let link_flag = if follows_links { OFlags::empty() } else { OFlags::NOFOLLOW };
        // The bits of flags that fit the system's own type; the sign means nothing.
        options.custom_flags((OFlags::NONBLOCK | link_flag).bits().cast_signed());
    }
    options
}

/// Lists the names in a folder, sorted.
///
/// # Errors
/// An error of the system.
pub fn file_names(folder: &Path) -> io::Result<Vec<OsString>> {
    let mut names = unsorted_names(folder)?;
    names.sort_unstable();
    Ok(names)
}

/// Lists the names in a folder without the standard library, which panics when a folder cannot be
/// closed.
#[cfg(unix)]
fn unsorted_names(folder: &Path) -> io::Result<Vec<OsString>> {
    use rustix::fs::{Dir, Mode, OFlags, open};
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt as _;

    let folder = open(folder, OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC, Mode::empty())?;
    let mut names = Vec::new();
    for entry in Dir::new(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_bytes();
        if name != b"." && name != b".." {
            names.push(OsStr::from_bytes(name).to_owned());
        }
    }
    Ok(names)
}

#[cfg(not(unix))]
fn unsorted_names(folder: &Path) -> io::Result<Vec<OsString>> {
    fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.file_name())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b", "a", ".hidden"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        fs::create_dir(folder.path().join("c")).unwrap();
        assert_eq!(file_names(folder.path()).unwrap(), [".hidden", "a", "b", "c"]);
        assert_eq!(
            file_names(&folder.path().join("d")).unwrap_err().kind(),
            io::ErrorKind::NotFound
        );
    }

    #[cfg(unix)]
    #[test]
    fn errors_name_the_type_of_a_file_that_is_not_regular() {
        let folder = tempfile::tempdir().unwrap();
        let fifo = folder.path().join("fifo");
        rustix::fs::mkfifoat(rustix::fs::CWD, &fifo, rustix::fs::Mode::RUSR).unwrap();
        let error_text = |path: &Path| open(path).unwrap_err().to_string();
        assert_eq!(error_text(&fifo), "it is a FIFO, not a regular file");
        assert_eq!(error_text(folder.path()), "it is a folder, not a regular file");
        assert_eq!(error_text(Path::new("/dev/null")), "it is a device, not a regular file");

        let target = folder.path().join("target");
        let link = folder.path().join("link");
        fs::write(&target, "mine").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        assert_eq!(read_json(&link).unwrap(), b"mine");
        let error = open_or_create(&link).unwrap_err();
        assert_eq!(error.to_string(), "it is a symbolic link, not a regular file");
        open_or_create(&target).unwrap();
        assert_eq!(read_json(&target).unwrap(), b"mine");
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_read_to_its_end_and_one_without_a_writer_is_refused() {
        use std::io::Write as _;
        use std::os::fd::AsRawFd as _;

        let folder = tempfile::tempdir().unwrap();
        let fifo = folder.path().join("fifo");
        let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mkfifoat(rustix::fs::CWD, &fifo, mode).unwrap();
        let error = read_text(&fifo, 1000).unwrap_err();
        assert_eq!(error.to_string(), "it is a FIFO that nobody writes to");

        // A writer that comes late and writes slowly.
        let writer = std::thread::spawn({
            let fifo = fifo.clone();
            move || {
                std::thread::sleep(Duration::from_millis(100));
                let mut pipe = OpenOptions::new().write(true).open(fifo).unwrap();
                for part in ["name = ", "\"a\"\n"] {
                    std::thread::sleep(Duration::from_millis(100));
                    pipe.write_all(part.as_bytes()).unwrap();
                }
            }
        });
        assert_eq!(read_text(&fifo, 1000).unwrap(), b"name = \"a\"\n");
        writer.join().unwrap();

        // A pipe as a shell's `<(...)` passes it: the writer is done before this end is opened.
        let (reader, mut writer) = io::pipe().unwrap();
        writer.write_all(b"name").unwrap();
        drop(writer);
        let descriptor_path = format!("/dev/fd/{}", reader.as_raw_fd());
        assert_eq!(read_text(Path::new(&descriptor_path), 1000).unwrap(), b"name");
        assert_eq!(read_text(Path::new(&descriptor_path), 1000).unwrap(), b"");
        assert!(read_text(folder.path(), 1000).is_err());
        let device = read_text(Path::new("/dev/zero"), 1000).unwrap_err();
        assert_eq!(device.to_string(), "it is a device, not a regular file");
    }

    #[test]
    fn json_is_read_up_to_the_greatest_length() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.json");
        File::create(&path).unwrap().set_len(1 << 40).unwrap();
        assert_eq!(read_json(&path).unwrap().len() as u64, MAX_JSON_BYTES);
    }
}
