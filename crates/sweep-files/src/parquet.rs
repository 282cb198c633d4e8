//! Opens, checks and reads Parquet files; all of them are read here.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;
use parquet::errors::ParquetError;
use parquet::file::metadata::{FileMetaData, KeyValue, ParquetMetaData};
use serde_json::Value;

use crate::batches::{self, Batches};
use crate::seal::{self, Seal};
use crate::{FileError, footer, key, panics, regular};

/// Beginning of the name by which this program signs its files, before a version.
pub const CREATED_BY: &str = "sweep version ";

/// The beginnings of the names by which other programs sign their files. Some of them copy the
/// digest of a result that they write again, where it no longer fits. A damaged file of ours has
/// none of these names.
const OTHER_WRITERS: [&str; 6] =
    ["parquet-cpp", "Polars", "DuckDB", "fastparquet", "parquet-mr", "parquet-rs"];

/// An open Parquet file, ours or another program's.
#[derive(Debug)]
pub struct ParquetFile {
    path: PathBuf,
    file: File,
    metadata: Arc<ParquetMetaData>,
    schema: SchemaRef,
    seal: Seal,
}

impl ParquetFile {
    /// Opens a file, and checks every byte of one of ours.
    ///
    /// # Errors
    /// [`FileError::Io`], [`FileError::NotParquet`], [`FileError::Damaged`].
    pub fn open(path: &Path) -> Result<Self, FileError> {
        // The folder of an unfinished run is easily taken for its result.
        if path.extension().is_some_and(|ending| ending == "partial") && path.is_dir() {
            let reason = format!(
                "it is the folder of a run that is not finished; its result will be {}, and \
                 `sweep status GRID.toml` says how far it is",
                path.with_extension("").display()
            );
            return Err(FileError::not_parquet(path, reason));
        }
        let mut file = regular::open(path).map_err(FileError::io("open", path))?;
        let seal = seal::check_seal(&mut file).map_err(FileError::io("read", path))?;
        let file = match Self::parse(path, file, seal) {
            Err(_) if seal == Seal::Broken => return Err(FileError::damaged(path)),
            parsed => parsed?,
        };
        if file.is_copy() {
            return Ok(file);
        }
        if seal == Seal::Broken {
            return Err(FileError::damaged(path));
        }
        // This program writes a digest where `seal` finds it. So a file that has one elsewhere, or
        // none but our name, was changed.
        let is_ours =
            file.created_by().is_some_and(|writer_name| writer_name.starts_with(CREATED_BY));
        let has_digest = file.pairs().any(|pair| pair.key == key::DIGEST);
        if seal == Seal::Absent && (is_ours || has_digest) {
            return Err(FileError::damaged(path));
        }
        Ok(file)
    }

    /// Opens a file to find out its kind. Its digest is checked only if it cannot be parsed.
    ///
    /// # Errors
    /// Returns the errors of [`ParquetFile::open`].
    pub fn open_unchecked(path: &Path) -> Result<Self, FileError> {
        let open = || regular::open(path).map_err(FileError::io("open", path));
        let parse_result = Self::parse(path, open()?, Seal::Absent);
        let is_damaged = matches!(parse_result, Err(FileError::NotParquet { .. }))
            && seal::check_seal(&mut open()?).map_err(FileError::io("read", path))? == Seal::Broken;
        if is_damaged { Err(FileError::damaged(path)) } else { parse_result }
    }

    fn parse(path: &Path, file: File, seal: Seal) -> Result<Self, FileError> {
        let load_metadata = || {
            let metadata = footer::read_metadata(&file)?;
            Ok((batches::schema(&metadata), Arc::new(metadata)))
        };
        let (schema, metadata) =
            catch_library_panic(load_metadata).map_err(not_parquet_error(path))?;
        Ok(Self { path: path.to_path_buf(), file, metadata, schema, seal })
    }

    /// Returns the path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether another program has written a result of this program again, with its digest.
    pub fn is_copy(&self) -> bool {
        let is_other_writer = |writer_name: &str| {
            OTHER_WRITERS.iter().any(|known_writer| writer_name.starts_with(known_writer))
        };
        self.created_by().is_some_and(is_other_writer)
            && self.pairs().any(|pair| pair.key == key::DIGEST)
    }

    /// Whether the file has a digest that fits its bytes.
    pub fn is_sealed(&self) -> bool {
        self.seal == Seal::Whole
    }

    /// Reads the bytes of the file, and checks again that a file of ours is unchanged.
    ///
    /// # Errors
    /// [`FileError::Io`]; [`FileError::Damaged`] if it has been written over.
    pub fn bytes(&self) -> Result<Vec<u8>, FileError> {
        let mut bytes = Vec::new();
        let mut file = &self.file;
        let result = file.seek(SeekFrom::Start(0)).and_then(|_| file.read_to_end(&mut bytes));
        result.map_err(FileError::io("read", &self.path))?;
        let seal = seal::check_seal(&mut io::Cursor::new(&bytes));
        if seal.map_err(FileError::io("read", &self.path))? != self.seal {
            return Err(FileError::damaged(&self.path));
        }
        Ok(bytes)
    }

    fn file_metadata(&self) -> &FileMetaData {
        self.metadata.file_metadata()
    }

    /// Returns the columns: names, types, and the metadata of each.
    pub fn schema(&self) -> &SchemaRef {
        &self.schema
    }

    /// Returns the number of rows by the metadata.
    pub fn rows(&self) -> u64 {
        u64::try_from(self.file_metadata().num_rows()).unwrap_or(0)
    }

    /// Returns the program that wrote it.
    pub fn created_by(&self) -> Option<&str> {
        self.file_metadata().created_by()
    }

    /// Returns the file's own key-value metadata.
    pub fn pairs(&self) -> impl Iterator<Item = &KeyValue> {
        self.file_metadata().key_value_metadata().into_iter().flatten()
    }

    /// Returns the value of a key of the metadata.
    pub fn value(&self, key: &str) -> Option<&str> {
        self.pairs().find(|pair| pair.key == key)?.value.as_deref()
    }

    /// Returns the value of a key of the metadata, which is JSON.
    pub fn json(&self, key: &str) -> Option<Value> {
        serde_json::from_str(self.value(key)?).ok()
    }

    /// Reads the rows of the columns with these indices, batch by batch. The iterator ends after an
    /// error.
    ///
    /// # Errors
    /// [`FileError::Io`], [`FileError::NotParquet`].
    pub fn batches(
        &self,
        field_indices: Vec<usize>,
    ) -> Result<impl Iterator<Item = Result<RecordBatch, FileError>> + use<'_>, FileError> {
        let file = self.file.try_clone().map_err(FileError::io("open", &self.path))?;
        let batches = Batches::new(file, Arc::clone(&self.metadata), &self.schema, field_indices);
        let mut batches = Some(batches.map_err(not_parquet_error(&self.path))?);
        Ok(std::iter::from_fn(move || {
            let reader = batches.as_mut()?;
            let batch = catch_library_panic(|| reader.read_batch()).transpose();
            if !matches!(batch, Some(Ok(_))) {
                // After an error or a panic the reader is not used again.
                batches = None;
            }
            batch.map(|batch| batch.map_err(not_parquet_error(&self.path)))
        }))
    }
}

/// Calls the library, and turns a panic into an error.
fn catch_library_panic<T>(
    read: impl FnOnce() -> Result<T, ParquetError>,
) -> Result<T, ParquetError> {
    panics::catch_in_parquet("it makes no sense inside", read)
}

/// Returns a function that makes a file's error from one of the library: [`FileError::Io`] if the
/// system reported it.
fn not_parquet_error(path: &Path) -> impl FnOnce(ParquetError) -> FileError {
    move |error| match error {
        ParquetError::External(inner) => match inner.downcast::<io::Error>() {
            // Decompressors report their own failures as `io::Error` too, but without the system's
            // number.
            Ok(source) if source.raw_os_error().is_some() => FileError::io("read", path)(*source),
            Ok(inner) => FileError::not_parquet(path, inner.to_string()),
            Err(inner) => FileError::not_parquet(path, inner.to_string()),
        },
        error => {
            let text = error.to_string();
            let reason = text.strip_prefix("Parquet error: ").unwrap_or(&text).trim();
            let reason = match path.extension().is_some_and(|ending| ending == "toml") {
                true => "a grid or machine file is no result; `sweep run GRID.toml` writes one",
                false => reason,
            };
            FileError::not_parquet(path, reason)
        }
    }
}

#[cfg(test)]
mod tests {
    use arrow_array::cast::AsArray;
    use arrow_array::types::Int32Type;
    use arrow_array::{Array as _, DictionaryArray, Float64Array};
    use parquet::column::writer::ColumnWriter;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;

    use super::*;
    use crate::{Writer, cells};

    /// The bytes of a file that this program has written, with its digest.
    fn own_file_bytes() -> Vec<u8> {
        let mut bytes = io::Cursor::new(bytes_with_blank_digest(&format!("{CREATED_BY}0.0.0")));
        seal::seal(&mut bytes).unwrap();
        bytes.into_inner()
    }

    /// The bytes of a file that bears this name, with a digest that does not fit.
    fn bytes_with_blank_digest(created_by: &str) -> Vec<u8> {
        let values: Float64Array = (0..300).map(f64::from).collect();
        let batch = RecordBatch::try_from_iter([("x", Arc::new(values) as _)]).unwrap();
        let properties = WriterProperties::builder().set_created_by(created_by.to_owned()).build();
        let mut writer = Writer::new(Vec::new(), &batch.schema(), properties).unwrap();
        writer.write(&batch).unwrap();
        let mut writer = writer.end().unwrap();
        writer.append_key_value_metadata(seal::blank_digest());
        writer.into_inner().unwrap()
    }

    #[test]
    fn a_result_that_another_program_wrote_again_is_a_copy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.parquet");
        for (writer, is_copy) in [
            ("parquet-cpp-arrow version 21.0.0", true),
            ("Polars", true),
            ("sweep version 0.0.0", false),
            ("sweeq version 0.0.0", false),
        ] {
            std::fs::write(&path, bytes_with_blank_digest(writer)).unwrap();
            let open_result = ParquetFile::open(&path);
            assert_eq!(open_result.is_ok(), is_copy, "{writer}");
            if let Ok(file) = open_result {
                assert!(file.is_copy() && !file.is_sealed(), "{writer}");
                assert!(file.bytes().is_ok(), "{writer}");
            } else {
                assert!(matches!(open_result, Err(FileError::Damaged { .. })), "{writer}");
            }
        }
    }

    #[test]
    fn a_result_with_any_bit_flipped_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.parquet");
        let undamaged_bytes = own_file_bytes();
        std::fs::write(&path, &undamaged_bytes).unwrap();
        assert!(ParquetFile::open(&path).unwrap().is_sealed());
        for bit in 0..8 * undamaged_bytes.len() {
            let mut bytes = undamaged_bytes.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            std::fs::write(&path, &bytes).unwrap();
            assert!(ParquetFile::open(&path).is_err(), "bit {bit}");
        }
    }

    #[test]
    fn bytes_of_an_open_file_that_has_changed_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.parquet");
        let undamaged_bytes = own_file_bytes();
        std::fs::write(&path, &undamaged_bytes).unwrap();
        let file = ParquetFile::open(&path).unwrap();
        assert_eq!(file.bytes().unwrap(), undamaged_bytes);
        let other_path = folder.path().join("y.parquet");
        std::fs::write(&other_path, b"another file").unwrap();
        std::fs::rename(&other_path, &path).unwrap();
        assert_eq!(
            file.bytes().unwrap(),
            undamaged_bytes,
            "a file that took its place is another one"
        );
        std::fs::write(&path, &undamaged_bytes).unwrap();
        let file = ParquetFile::open(&path).unwrap();
        let mut changed_bytes = undamaged_bytes;
        changed_bytes[20] ^= 1;
        std::fs::write(&path, &changed_bytes).unwrap();
        assert!(matches!(file.bytes(), Err(FileError::Damaged { .. })));
    }

    #[test]
    fn a_word_that_many_rows_have_is_read_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.parquet");
        // Reading the word for each row would take 3 GB, more than Arrow's offsets can count.
        let long_word = "a".repeat(1 << 20);
        let words: DictionaryArray<Int32Type> = [long_word.as_str(); 3].into_iter().collect();
        let batch = RecordBatch::try_from_iter([("status", Arc::new(words) as _)]).unwrap();
        let file = File::create(&path).unwrap();
        let properties =
            WriterProperties::builder().set_dictionary_page_size_limit(4 << 20).build();
        let mut writer = Writer::new(file, &batch.schema(), properties).unwrap();
        for _ in 0..1000 {
            writer.write(&batch).unwrap();
        }
        writer.end().unwrap().close().unwrap();
        let file = ParquetFile::open(&path).unwrap();
        let batches = file.batches(vec![0]).unwrap();
        let batches: Vec<RecordBatch> = batches.collect::<Result<_, _>>().unwrap();
        assert_eq!(batches.iter().map(RecordBatch::num_rows).sum::<usize>(), 3000);
        assert!(batches.iter().all(|batch| batch.get_array_memory_size() < 8 << 20));
    }

    #[test]
    fn words_without_a_dictionary_are_refused_beyond_128_mebibytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.parquet");
        let properties = WriterProperties::builder()
            .set_dictionary_enabled(false)
            .set_data_page_size_limit(1 << 30)
            .set_write_batch_size(1 << 20)
            .set_compression(parquet::basic::Compression::ZSTD(Default::default()));
        let write_words = |mebibytes: usize| {
            let long_word = "a".repeat(1 << 20);
            let words: DictionaryArray<Int32Type> =
                vec![long_word.as_str(); mebibytes].into_iter().collect();
            let batch = RecordBatch::try_from_iter([("status", Arc::new(words) as _)]).unwrap();
            let file = File::create(&path).unwrap();
            let properties = properties.clone().build();
            let mut writer = Writer::new(file, &batch.schema(), properties).unwrap();
            writer.write(&batch).unwrap();
            writer.end().unwrap().close().unwrap();
            ParquetFile::open(&path).and_then(|file| Ok(read_batches(&file)?[0].num_rows()))
        };
        assert_eq!(write_words(10).unwrap(), 10);
        let message = write_words(130).unwrap_err().to_string();
        assert!(message.contains("into 128 MiB of words"), "{message}");
    }

    #[test]
    fn errors_about_mistyped_names_and_grid_files_say_what_to_do() {
        let folder = tempfile::tempdir().unwrap();
        let result = folder.path().join("results/tol60.parquet");
        std::fs::create_dir(folder.path().join("results")).unwrap();
        std::fs::write(&result, own_file_bytes()).unwrap();
        std::fs::write(folder.path().join("g.toml"), "name = \"tol60\"\n").unwrap();
        let message =
            |name: &str| ParquetFile::open(&folder.path().join(name)).unwrap_err().to_string();
        for name in ["tol60.parquet", "tol60", "results/tol60"] {
            assert!(message(name).contains(&format!("{} is there", result.display())), "{name}");
        }
        assert!(message("none.parquet").contains("check the name"), "{}", message("none.parquet"));
        assert!(message("g.toml").contains("`sweep run GRID.toml`"), "{}", message("g.toml"));
    }

    #[test]
    fn a_dictionary_of_too_many_entries_is_refused_before_it_is_allocated() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.parquet");
        let values: Float64Array = (0..3000).map(|k| f64::from(k % 1500)).collect();
        let batch = RecordBatch::try_from_iter([("x", Arc::new(values) as _)]).unwrap();
        let properties = WriterProperties::builder().build();
        let mut writer = Writer::new(Vec::new(), &batch.schema(), properties).unwrap();
        writer.write(&batch).unwrap();
        let undamaged_bytes = writer.end().unwrap().into_inner().unwrap();
        std::fs::write(&path, &undamaged_bytes).unwrap();
        let read_rows = || ParquetFile::open(&path).and_then(|file| read_batches(&file));
        assert_eq!(read_rows().unwrap().iter().map(RecordBatch::num_rows).sum::<usize>(), 3000);
        // The header's number of entries, 1500, becomes 8191; the library believes any.
        let declared_count = [0x4c, 0x15, 0xb8, 0x17];
        let count_offset =
            undamaged_bytes.windows(4).position(|bytes| bytes == declared_count).unwrap();
        let mut damaged_bytes = undamaged_bytes;
        damaged_bytes[count_offset + 2..count_offset + 4].copy_from_slice(&[0xfe, 0x7f]);
        std::fs::write(&path, &damaged_bytes).unwrap();
        let message = read_rows().unwrap_err().to_string();
        assert!(message.contains("the header of a page makes no sense"), "{message}");
    }

    #[test]
    fn a_file_of_97_bytes_that_declares_many_lengths_of_words_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.parquet");
        let bytes = include_bytes!("../../../fuzz/corpus-result/words_counted.parquet");
        assert_eq!(bytes.len(), 97);
        std::fs::write(&path, bytes).unwrap();
        let message = read_batches(&ParquetFile::open(&path).unwrap()).unwrap_err().to_string();
        assert!(message.contains("encoded by DELTA_LENGTH_BYTE_ARRAY"), "{message}");
    }

    /// Opens a file of two rows with columns of these types. The second row is null in columns that
    /// may be.
    fn foreign_file(schema: &str) -> ParquetFile {
        let schema = parse_message_type(schema).unwrap();
        let mut writer =
            SerializedFileWriter::new(Vec::new(), schema.into(), Default::default()).unwrap();
        let mut row_group = writer.next_row_group().unwrap();
        while let Some(mut column) = row_group.next_column().unwrap() {
            macro_rules! write {
                ($column:expr, $value:expr) => {{
                    let max_level = $column.get_descriptor().max_def_level();
                    let values = vec![$value; if max_level > 0 { 1 } else { 2 }];
                    $column.write_batch(&values, Some(&[max_level, 0]), Some(&[0, 0])).unwrap()
                }};
            }
            match column.untyped() {
                ColumnWriter::BoolColumnWriter(column) => write!(column, true),
                ColumnWriter::Int32ColumnWriter(column) => write!(column, -2),
                ColumnWriter::Int64ColumnWriter(column) => write!(column, -2),
                ColumnWriter::FloatColumnWriter(column) => write!(column, 0.5),
                ColumnWriter::DoubleColumnWriter(column) => write!(column, 0.5),
                ColumnWriter::ByteArrayColumnWriter(column) => write!(column, "word".into()),
                ColumnWriter::FixedLenByteArrayColumnWriter(column) => {
                    let length = column.get_descriptor().type_length() as usize;
                    write!(column, vec![1; length].into())
                }
                _ => unreachable!(),
            };
            column.close().unwrap();
        }
        row_group.close().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.parquet");
        std::fs::write(&path, writer.into_inner().unwrap()).unwrap();
        // The open file outlives its name.
        ParquetFile::open(&path).unwrap()
    }

    fn read_batches(file: &ParquetFile) -> Result<Vec<RecordBatch>, FileError> {
        file.batches((0..file.schema().fields().len()).collect())?.collect()
    }

    #[test]
    fn numbers_flags_and_words_of_other_programs_are_read() {
        let file = foreign_file(
            "message x {
                optional int32 a (INTEGER(8, true));
                required int32 b (INT_16);
                optional int32 c;
                required int64 d;
                optional int64 e (INTEGER(64, true));
                optional float f;
                required double g;
                optional int32 h (INTEGER(32, false));
                required int64 i (UINT_64);
                optional boolean j;
                optional binary k (STRING);
                required binary l (UTF8);
                required fixed_len_byte_array(2) m (DECIMAL(4, 1));
            }",
        );
        let batches = read_batches(&file).unwrap();
        let [batch] = batches.as_slice() else { panic!("{batches:?}") };
        let numbers = [-2.0, -2.0, -2.0, -2.0, -2.0, 0.5, 0.5, 4294967294.0, u64::MAX as f64];
        for (column, number) in batch.columns().iter().zip(numbers) {
            let second_number = (!column.is_nullable()).then_some(number);
            assert_eq!(cells::numbers(column).unwrap(), [Some(number), second_number]);
        }
        assert_eq!(batch.column(9).as_boolean().iter().collect::<Vec<_>>(), [Some(true), None]);
        let words = |k: usize| {
            let words = cells::words(batch.column(k)).unwrap();
            (words.values().len(), words.into_iter().collect::<Vec<_>>())
        };
        assert_eq!(words(10), (1, vec![Some("word"), None]));
        assert_eq!(words(11), (1, vec![Some("word"); 2]));
        assert_eq!(cells::numbers(batch.column(12)).unwrap(), [Some(25.7); 2]);
    }

    #[test]
    fn columns_of_other_types_are_refused_by_name() {
        for column in [
            "optional int32 x (DATE);",
            "optional int64 x (TIMESTAMP(NANOS, true));",
            "optional fixed_len_byte_array(17) x (DECIMAL(40, 2));",
            "optional int64 x (TIME(MICROS, true));",
            "optional binary x;",
            "repeated int64 x;",
            "optional group x (LIST) { repeated group list { optional int64 element; } }",
        ] {
            let file = foreign_file(&format!("message m {{ required double y; {column} }}"));
            let message = read_batches(&file).unwrap_err().to_string();
            assert!(message.contains("`x` is of a type that is not read"), "{column}: {message}");
        }
    }
}
