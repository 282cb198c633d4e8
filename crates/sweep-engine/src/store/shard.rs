//! The part of a run that this process computes, and its number in a scheduler's array.
//!
//! Chunk `c` belongs to shard `c mod N`, so every shard gets its share of every region of the grid.
//! `N`, and the array number of the first shard, are frozen in `shards.json` by the first shard to
//! start: when two lost tasks are submitted again (`--array=3,7`), the scheduler's own count says 2
//! and its smallest number 3, and neither matters.

use std::collections::{BTreeMap, BTreeSet};
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::plan_file::{pretty, set_aside};
use super::{Folder, SHARDS, StoreError};
use crate::Environment;
use sweep_files::{atomic, regular};

/// More parts than any scheduler's array has tasks; a bound for loops over them.
const MAX_SHARDS: u64 = 1_000_000;

/// One of `of` equal parts; `index` counts from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which part, from 1.
    pub index: u64,
    /// How many parts.
    pub of: u64,
}

impl Shard {
    /// Whether a chunk is this shard's to compute.
    pub fn owns(self, chunk: u64) -> bool {
        chunk % self.of == self.index - 1
    }

    /// How many of a run's chunks are its own.
    pub const fn chunks(self, chunks: u64) -> u64 {
        chunks.saturating_sub(self.index - 1).div_ceil(self.of)
    }
}

/// What `--shard` said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShardRequest {
    /// `I/N`.
    Given(Shard),
    /// `auto/N`: the number of parts given, this one's place from the scheduler.
    Auto {
        /// How many parts.
        of: u64,
    },
}

impl FromStr for ShardRequest {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected =
            || format!("expected I/N with I from 1 to N, or auto/N, such as 3/8; got `{text}`");
        let (index, of) = text.split_once('/').ok_or_else(expected)?;
        let of: u64 = of.parse().map_err(|_| expected())?;
        if !(1..=MAX_SHARDS).contains(&of) {
            return Err(format!("expected 1 to {MAX_SHARDS} shards; got {of}"));
        }
        if index == "auto" {
            return Ok(Self::Auto { of });
        }
        match index.parse() {
            Ok(index) if (1..=of).contains(&index) => Ok(Self::Given(Shard { index, of })),
            _ => Err(expected()),
        }
    }
}

/// What the first shard froze.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ShardLayout {
    /// How many parts.
    pub shards: u64,
    /// The scheduler's number of shard 1.
    pub first_array_id: u64,
}

impl ShardLayout {
    /// The number of shards of a run folder, if any shard has started. An unreadable file counts as
    /// none: it only says who computes a chunk, never what is in it.
    pub(super) fn read(folder: &Folder) -> Result<Option<Self>, StoreError> {
        let path = folder.file(SHARDS);
        let text = regular::if_there(regular::read_json(&path));
        let text = text.map_err(StoreError::io("read", &path))?;
        let dealing = text.and_then(|text| serde_json::from_slice(&text).ok());
        Ok(dealing.filter(|dealing: &Self| (1..=MAX_SHARDS).contains(&dealing.shards)))
    }

    /// The shards, counted from 1, that lack a chunk.
    pub(super) fn incomplete(self, chunks: u64, present: &BTreeSet<u64>) -> Vec<u64> {
        let mut done: BTreeMap<u64, u64> = BTreeMap::new();
        for chunk in present {
            *done.entry(chunk % self.shards + 1).or_default() += 1;
        }
        let lacks = |index: &u64| {
            let own = Shard { index: *index, of: self.shards }.chunks(chunks);
            done.get(index).copied().unwrap_or(0) < own
        };
        (1..=self.shards).filter(lacks).collect()
    }

    /// Writes the dealing unless another shard was first, and says what holds.
    pub(super) fn freeze(self, folder: &Folder) -> Result<Self, StoreError> {
        let text = pretty(&json!(self));
        let path = folder.file(SHARDS);
        if atomic::create(&folder.path, &path, &text)? {
            return Ok(self);
        }
        if let Some(frozen) = Self::read(folder)? {
            return Ok(frozen);
        }
        // Not ours, or not as it was written.
        set_aside(&path)?;
        atomic::write(&folder.path, &path, &text)?;
        Ok(self)
    }
}

/// The part this process is to compute and the dealing it assumes: from the request, else from a
/// Slurm array or a Kubernetes Indexed Job, read against what is already frozen. `None` means the
/// whole run.
///
/// # Errors
/// [`StoreError::Refused`] when the request, the scheduler and the frozen dealing do not fit
/// together.
pub(super) fn resolve(
    request: Option<ShardRequest>,
    environment: Environment<'_>,
    frozen: Option<ShardLayout>,
) -> Result<Option<(Shard, ShardLayout)>, StoreError> {
    let refuse = |text: String| Err(StoreError::Refused(text));
    let other = |shards: u64, asked: u64, help: String| {
        refuse(format!(
            "this run was dealt into {shards} shards by the first to start, not {asked}\n  = help: \
             use --shard {help}"
        ))
    };
    if let Some(ShardRequest::Given(shard)) = request {
        let dealing = frozen.unwrap_or(ShardLayout { shards: shard.of, first_array_id: 1 });
        let shards = dealing.shards;
        if shards != shard.of {
            let help = format!("I/{shards}, or run it whole without --shard");
            return other(shards, shard.of, help);
        }
        return Ok(Some((shard, dealing)));
    }
    let asked =
        request.map(|(ShardRequest::Auto { of } | ShardRequest::Given(Shard { of, .. }))| of);
    let Some(scheduler) = Scheduler::read(environment)? else {
        return match asked {
            None => Ok(None),
            Some(of) => refuse(format!(
                "--shard auto/{of} takes its place from SLURM_ARRAY_TASK_ID or \
                 JOB_COMPLETION_INDEX, and neither is set\n  = help: give it as --shard I/{of}"
            )),
        };
    };
    let dealing = match (frozen, asked.or(scheduler.count)) {
        (Some(ShardLayout { shards, .. }), Some(of)) if asked.is_some() && of != shards => {
            return other(shards, of, format!("auto/{shards}"));
        }
        (Some(dealing), _) => dealing,
        (None, Some(shards)) => ShardLayout { shards, first_array_id: scheduler.first },
        (None, None) => {
            return refuse(format!(
                "{} is set, but not how many shards there are\n  = help: give --shard auto/N, or \
                 --shard 1/1 to run it whole",
                scheduler.name
            ));
        }
    };
    match scheduler.id.checked_sub(dealing.first_array_id) {
        Some(place) if place < dealing.shards => {
            Ok(Some((Shard { index: place + 1, of: dealing.shards }, dealing)))
        }
        _ => refuse(format!(
            "{} is {}, but this run's {} shards are numbered {} to {}\n  = help: submit those \
             numbers, or give --shard I/N",
            scheduler.name,
            scheduler.id,
            dealing.shards,
            dealing.first_array_id,
            dealing.first_array_id.saturating_add(dealing.shards - 1)
        )),
    }
}

/// What a scheduler says of this task.
struct Scheduler {
    name: &'static str,
    id: u64,
    first: u64,
    count: Option<u64>,
}

impl Scheduler {
    fn read(environment: Environment<'_>) -> Result<Option<Self>, StoreError> {
        let number = |name: &'static str| match environment(name) {
            None => Ok(None),
            Some(text) => text.parse::<u64>().map(Some).map_err(|_| {
                StoreError::Refused(format!("{name} is `{text}`, which is not a number"))
            }),
        };
        if let Some(id) = number("SLURM_ARRAY_TASK_ID")? {
            let first = number("SLURM_ARRAY_TASK_MIN")?.unwrap_or(id);
            let count =
                number("SLURM_ARRAY_TASK_COUNT")?.filter(|count| (1..=MAX_SHARDS).contains(count));
            return Ok(Some(Self { name: "SLURM_ARRAY_TASK_ID", id, first, count }));
        }
        let place = number("JOB_COMPLETION_INDEX")?;
        Ok(place.map(|id| Self { name: "JOB_COMPLETION_INDEX", id, first: 0, count: None }))
    }
}

/// Numbers as `sbatch --array=` takes them: `2,5-7`.
pub fn list(numbers: impl IntoIterator<Item = u64>) -> String {
    let numbers: Vec<u64> = numbers.into_iter().collect();
    let ranges = numbers.chunk_by(|number, next| number + 1 == *next).map(|range| match range {
        [first, .., last] => format!("{first}-{last}"),
        _ => range[0].to_string(),
    });
    ranges.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn environment(
        pairs: &'static [(&'static str, &'static str)],
    ) -> impl Fn(&str) -> Option<String> {
        move |name| pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
    }

    fn refusal(result: Result<Option<(Shard, ShardLayout)>, StoreError>) -> String {
        let error = result.unwrap_err();
        assert!(error.is_refusal());
        error.to_string()
    }

    #[test]
    fn requests_read_as_written() {
        assert_eq!("3/8".parse(), Ok(ShardRequest::Given(Shard { index: 3, of: 8 })));
        assert_eq!("auto/8".parse(), Ok(ShardRequest::Auto { of: 8 }));
        for bad in
            ["0/8", "9/8", "1/0", "auto/0", "3", "a/8", "3/", "-1/8", "3/8/2", "", "1/1000001"]
        {
            assert!(bad.parse::<ShardRequest>().unwrap_err().starts_with("expected"), "{bad}");
        }
    }

    #[test]
    fn every_chunk_belongs_to_one_shard() {
        for chunk in 0..100 {
            let owners = (1..=7).filter(|&index| Shard { index, of: 7 }.owns(chunk)).count();
            assert_eq!(owners, 1);
        }
        for chunks in 0..30 {
            for index in 1..=7 {
                let shard = Shard { index, of: 7 };
                assert_eq!(
                    shard.chunks(chunks),
                    (0..chunks).filter(|&chunk| shard.owns(chunk)).count() as u64
                );
            }
        }
    }

    #[test]
    fn nothing_said_means_the_whole_run() {
        assert_eq!(resolve(None, &environment(&[]), None).unwrap(), None);
    }

    #[test]
    fn a_slurm_array_numbers_the_shards_from_its_first_task() {
        let zero_based = environment(&[
            ("SLURM_ARRAY_TASK_ID", "2"),
            ("SLURM_ARRAY_TASK_MIN", "0"),
            ("SLURM_ARRAY_TASK_COUNT", "8"),
        ]);
        let (shard, dealing) = resolve(None, &zero_based, None).unwrap().unwrap();
        assert_eq!(shard, Shard { index: 3, of: 8 });
        assert_eq!(dealing, ShardLayout { shards: 8, first_array_id: 0 });
    }

    #[test]
    fn a_resubmitted_part_of_the_array_keeps_the_frozen_numbers() {
        let resubmitted = environment(&[
            ("SLURM_ARRAY_TASK_ID", "7"),
            ("SLURM_ARRAY_TASK_MIN", "3"),
            ("SLURM_ARRAY_TASK_COUNT", "2"),
        ]);
        let frozen = ShardLayout { shards: 8, first_array_id: 1 };
        let (shard, dealing) = resolve(None, &resubmitted, Some(frozen)).unwrap().unwrap();
        assert_eq!((shard, dealing), (Shard { index: 7, of: 8 }, frozen));
    }

    #[test]
    fn an_array_with_gaps_is_refused_at_its_stray_task() {
        let gaps = environment(&[
            ("SLURM_ARRAY_TASK_ID", "20"),
            ("SLURM_ARRAY_TASK_MIN", "0"),
            ("SLURM_ARRAY_TASK_COUNT", "3"),
        ]);
        assert!(refusal(resolve(None, &gaps, None)).contains("numbered 0 to 2"));
    }

    #[test]
    fn kubernetes_gives_the_place_and_the_user_the_number() {
        let pod = environment(&[("JOB_COMPLETION_INDEX", "0")]);
        let (shard, _) = resolve(Some(ShardRequest::Auto { of: 4 }), &pod, None).unwrap().unwrap();
        assert_eq!(shard, Shard { index: 1, of: 4 });
        assert!(refusal(resolve(None, &pod, None)).contains("auto/N"));
        let nowhere = resolve(Some(ShardRequest::Auto { of: 4 }), &environment(&[]), None);
        assert!(refusal(nowhere).contains("--shard I/4"));
        let garbled = environment(&[("SLURM_ARRAY_TASK_ID", "x")]);
        assert!(refusal(resolve(None, &garbled, None)).contains("not a number"));
    }

    #[test]
    fn another_number_of_shards_than_the_frozen_one_is_refused() {
        let frozen = Some(ShardLayout { shards: 4, first_array_id: 1 });
        let given = Some(ShardRequest::Given(Shard { index: 1, of: 8 }));
        assert!(refusal(resolve(given, &environment(&[]), frozen)).contains("into 4 shards"));
        let pod = environment(&[("JOB_COMPLETION_INDEX", "1")]);
        assert!(
            refusal(resolve(Some(ShardRequest::Auto { of: 8 }), &pod, frozen))
                .contains("into 4 shards")
        );
    }

    #[test]
    fn a_shard_lacks_something_until_its_last_chunk_is_there() {
        let dealing = ShardLayout { shards: 4, first_array_id: 1 };
        assert_eq!(dealing.incomplete(6, &BTreeSet::new()), [1, 2, 3, 4]);
        assert_eq!(dealing.incomplete(6, &BTreeSet::from([0, 1, 3, 4])), [2, 3]);
        assert!(
            dealing.incomplete(2, &BTreeSet::from([0, 1])).is_empty(),
            "shards without a chunk lack nothing"
        );
    }

    #[test]
    fn lists_read_as_sbatch_takes_them() {
        assert_eq!(list([2, 5, 6, 7, 9]), "2,5-7,9");
        assert_eq!(list([]), "");
    }
}
