//! Files on disk: one rule for writing, one gate for reading.
//!
//! Writing ([`Output`]):
//!
//! * A command writes a new file, or over an empty file, or over a regular file of the [`FileKind`]
//!   that it writes. Anything else is refused before any work: folders, symbolic links, FIFOs,
//!   devices, and every other file. A grid file, a machine file, a list and a plotted file are of
//!   none of these kinds, so no input is ever overwritten, whatever path leads to it.
//! * The bytes go into a temporary file beside it, which is synced and renamed; then the folder is
//!   synced. A full disk, a signal or a power cut leaves the old file or the new one, never a part.
//! * A temporary file is locked while its process lives. Those of killed processes are removed by
//!   whoever writes to the folder next.
//!
//! Reading: `regular` opens regular files only, so that a FIFO cannot hold a command up;
//! `ParquetFile` checks the digest that our files carry (`seal`), and turns every failure of the
//! library, panics included, into an error with the file's name. Rows are read in batches
//! (`batches`). The library trusts what a file declares (`thrift` says where), so that the footer
//! (`footer`) and each page header (`pages`) are checked before it reads them.

pub mod atomic;
pub mod batches;
pub mod cells;
mod columns;
mod error;
pub mod footer;
pub mod key;
mod kind;
mod leaves;
mod output;
mod pages;
pub mod panics;
mod parquet;
pub mod regular;
mod rows;
pub mod seal;
mod thrift;
mod writer;

pub use columns::{CellKind, Column, ColumnMetadata, columns};
pub use error::FileError;
pub use kind::{EXPORTED_CSV, FileKind, MODEL_FILE_START, PDF_START, path_beside};
pub use leaves::{Step, dotted_path, visit_leaves};
pub use output::{Output, check_replaceable, create_folder_without_leftovers, write};
pub use parquet::{CREATED_BY, ParquetFile};
pub use rows::{Cell, ResultTable, Row, Rows, ratio_limits};
pub use writer::Writer;
