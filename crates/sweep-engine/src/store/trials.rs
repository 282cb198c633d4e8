//! The trials of a search, kept as they come. A search's next trials follow from the answers so
//! far, so after an interruption it repeats them from here and ends in the same bytes.
//!
//! A search on `x.parquet` works in the folder `x.parquet.partial`, under the same lock and with
//! the same frozen plan as a run. Chunks do not fit it: which points it needs is not known
//! beforehand. Its trials are in `trials.bin` instead, in the order in which they came, 40 bytes
//! each:
//!
//! | bytes | what |
//! |---|---|
//! | 24 | the point: three numbers |
//! | 8 | the answer, an `f64`; NaN where there is none |
//! | 8 | of the BLAKE3 hash of the 32 bytes before, keyed by the plan's hash |
//!
//! A record whose hash does not match, because a crash tore it or because it belongs to another
//! plan, is ignored, and its trial is made again. What was written survives the process at once,
//! and a power cut once [`Trials::settle`] has returned.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use super::open::{self, Opened};
use super::plan_file::set_aside;
use super::trial_records::{Key, RECORD_BYTES, decode, encode};
use super::{Folder, Job, Lock, StoreError, TRIALS};
use sweep_files::regular;

/// Trials and their answers.
type Known = BTreeMap<Key, Option<f64>>;

/// The trials of a search that this process has a right to.
#[derive(Debug)]
pub struct Trials {
    folder: Folder,
    lock: Lock,
    file: File,
    path: PathBuf,
    plan: [u8; blake3::OUT_LEN],
    known: Known,
    notes: Vec<String>,
}

impl Trials {
    /// Takes the output for this search, freezes its plan or finds it frozen, and reads its trials.
    /// `fresh` starts over: trials go now, a finished file stays until the new one takes its place.
    ///
    /// # Errors
    /// [`StoreError::Busy`] when another process holds the output, [`StoreError::PlanDiffers`],
    /// [`StoreError::OutputDiffers`] when another result is there already, [`StoreError::File`] for
    /// anything else at the output that is not ours, and for the file system.
    pub fn open(output: &Path, job: &Job<'_>, fresh: bool) -> Result<Opened<(), Self>, StoreError> {
        let folder = Folder::beside(output, job.layout.kind)?;
        let finished = || Ok(open::of_plan(&folder, job)?.map(drop));
        let (lock, mut notes) = match open::claim(&folder, job, fresh, || Ok(None), finished)? {
            Opened::Finished(()) => return Ok(Opened::Finished(())),
            Opened::Open(held) => held,
        };
        let path = folder.file(TRIALS);
        let plan = *job.hash().as_bytes();
        let (mut file, found, known) = contents(&path, &plan)?;
        let length = file.metadata().map_err(StoreError::io("read", &path))?.len();
        if known.is_empty() && length > 0 {
            let aside = set_aside(&path)?;
            let kept = format!("kept as {}, and they are made again", aside.display());
            notes.push(format!("{}: no trial is as it was written; {kept}", path.display()));
            (file, ..) = contents(&path, &plan)?;
        } else {
            if found > known.len() {
                let (path, torn) = (path.display(), found - known.len());
                let told = "trials are not as they were written; they are made again";
                notes.push(format!("{path}: {torn} of {found} {told}"));
            }
            // A torn record goes, so that the next one begins where a record should.
            let whole = found as u64 * RECORD_BYTES as u64;
            let cut = file.set_len(whole).and_then(|()| file.seek(SeekFrom::End(0)));
            cut.map_err(StoreError::io("write", &path))?;
        }
        Ok(Opened::Open(Self { folder, lock, file, path, plan, known, notes }))
    }

    /// How many trials are there.
    pub fn count(&self) -> usize {
        self.known.len()
    }

    /// The answer to a trial that was made before.
    pub fn recall(&self, key: &Key) -> Option<Option<f64>> {
        self.known.get(key).copied()
    }

    /// Keeps an answer.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn keep(&mut self, key: Key, answer: Option<f64>) -> Result<(), StoreError> {
        let record = encode(&self.plan, key, answer);
        self.file.write_all(&record).map_err(StoreError::io("write", &self.path))?;
        self.known.insert(key, answer);
        Ok(())
    }

    /// Makes what was kept outlive a power cut.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn settle(&self) -> Result<(), StoreError> {
        self.file.sync_data().map_err(StoreError::io("sync", &self.path))
    }

    /// Things a user should hear of once.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Removes the folder of a search whose file is in place; a failure is only worth a note.
    pub fn complete(self) -> Option<String> {
        open::remove(&self.folder, self.lock, &blake3::Hash::from_bytes(self.plan))
    }
}

/// The file of trials, made if need be; how many records it holds; and the trials in them.
fn contents(path: &Path, plan: &[u8; blake3::OUT_LEN]) -> Result<(File, usize, Known), StoreError> {
    let file = regular::open_or_create(path).map_err(StoreError::io("open or make", path))?;
    let (mut found, mut known) = (0, Known::new());
    // One by one: the file may be long, and somebody else's.
    let mut records = BufReader::new(&file);
    loop {
        let mut record = [0; RECORD_BYTES];
        match records.read_exact(&mut record) {
            Ok(()) => found += 1,
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => break,
            Err(error) => return Err(StoreError::io("read", path)(error)),
        }
        known.extend(decode(plan, &record));
    }
    Ok((file, found, known))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use serde_json::json;

    use super::super::Layout;
    use super::super::synthetic::job;
    use super::*;
    use crate::build::Build;
    use crate::table::Table;
    use sweep_files::{FileKind, key};

    const BUILD: Build = Build { version: "0.0.0-test", numerics: 1 };

    fn open(output: &Path, job: &Job<'_>) -> Trials {
        match Trials::open(output, job, false) {
            Ok(Opened::Open(trials)) => trials,
            other => panic!("expected trials, got {other:?}"),
        }
    }

    #[test]
    fn trials_outlive_their_process_whatever_tears_the_last() {
        let home = tempfile::tempdir().unwrap();
        let (output, job) = (home.path().join("x.parquet"), job(8));
        let mut trials = open(&output, &job);
        for k in 0..5 {
            trials.keep([k, 7, 9], (k != 3).then_some(0.5 * k as f64)).unwrap();
        }
        trials.settle().unwrap();
        let path = trials.path.clone();
        drop(trials);
        let whole = fs::read(&path).unwrap();
        for length in 0..=whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            let mut trials = open(&output, &job);
            assert_eq!(trials.count(), length / RECORD_BYTES);
            // Less than a record is nobody's that could be told.
            let is_set_aside = (1..RECORD_BYTES).contains(&length);
            assert_eq!(trials.take_notes().len(), usize::from(is_set_aside));
            // The next one is found again behind what was torn.
            trials.keep([9, 9, 9], Some(1.0)).unwrap();
            drop(trials);
            assert_eq!(open(&output, &job).recall(&[9, 9, 9]), Some(Some(1.0)));
        }
        fs::write(&path, &whole).unwrap();
        let trials = open(&output, &job);
        assert_eq!(trials.recall(&[2, 7, 9]), Some(Some(1.0)));
        assert_eq!(trials.recall(&[3, 7, 9]), Some(None));
        assert_eq!(trials.recall(&[3, 7, 8]), None);
        let kept = trials.complete().unwrap();
        assert!(kept.contains("trials.bin.damaged, trials.bin.damaged-10"), "{kept}");
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), RECORD_BYTES - 1);
    }

    #[test]
    fn a_record_that_is_not_as_it_was_written_is_none() {
        let home = tempfile::tempdir().unwrap();
        let (output, job) = (home.path().join("x.parquet"), job(8));
        let mut trials = open(&output, &job);
        for k in 0..3 {
            trials.keep([k, 0, 0], Some(1.0)).unwrap();
        }
        let path = trials.path.clone();
        drop(trials);
        let whole = fs::read(&path).unwrap();
        for bit in (8 * RECORD_BYTES..16 * RECORD_BYTES).step_by(7) {
            let mut bytes = whole.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            fs::write(&path, bytes).unwrap();
            let mut trials = open(&output, &job);
            assert_eq!((trials.count(), trials.recall(&[1, 0, 0])), (2, None), "bit {bit}");
            assert!(trials.take_notes()[0].contains("1 of 3 trials"), "bit {bit}");
        }
        // Somebody's file of the same name.
        fs::write(&path, [b'x'; 100]).unwrap();
        let mut trials = open(&output, &job);
        assert!(trials.take_notes()[0].contains("no trial is as it was written"));
        assert_eq!(fs::read(path.with_extension("bin.damaged")).unwrap(), [b'x'; 100]);
    }

    #[test]
    fn another_plan_is_refused_and_starting_over_forgets() {
        let home = tempfile::tempdir().unwrap();
        let output = home.path().join("x.parquet");
        let (ours, other) = (job(8), job(9));
        open(&output, &ours).keep([0; 3], None).unwrap();
        let refused = Trials::open(&output, &other, false);
        assert!(matches!(refused, Err(StoreError::PlanDiffers { .. })), "{refused:?}");
        let Ok(Opened::Open(trials)) = Trials::open(&output, &other, true) else { panic!() };
        assert_eq!(trials.count(), 0);
        let busy = Trials::open(&output, &other, false);
        assert!(matches!(busy, Err(StoreError::Busy { .. })), "{busy:?}");
    }

    #[test]
    fn a_finished_file_is_known_by_its_plan() {
        let home = tempfile::tempdir().unwrap();
        let output = home.path().join("x.parquet");
        let [ours, other] = [8, 9].map(|points| {
            let job = job(points);
            let layout = Layout { kind: FileKind::Boundary, ..job.layout };
            Job { version: BUILD.version, numerics: BUILD.numerics, layout, ..job }
        });
        let mut table = Table::new(BUILD);
        table.metadata(key::PLAN, &ours.plan);
        table.text(key::PLAN_HASH, ours.hash().to_hex().to_string());
        table.metadata(key::BOUNDARY, &json!({}));
        table.counts("points", "", [1]);
        fs::write(&output, table.into_bytes(&output).unwrap()).unwrap();
        let opened = Trials::open(&output, &ours, false);
        assert!(matches!(opened, Ok(Opened::Finished(()))), "{opened:?}");
        let refused = Trials::open(&output, &other, false);
        assert!(matches!(refused, Err(StoreError::OutputDiffers { .. })), "{refused:?}");
        assert!(!home.path().join("x.parquet.partial").exists());
        // A search that died with its file in place has left its folder.
        let Ok(Opened::Open(_)) = Trials::open(&output, &ours, true) else { panic!() };
        fs::remove_file(home.path().join("x.parquet.partial/plan.json")).unwrap();
        let opened = Trials::open(&output, &ours, false);
        assert!(matches!(opened, Ok(Opened::Finished(()))), "{opened:?}");
        assert!(!home.path().join("x.parquet.partial").exists());
    }
}
