//! Shards: the division of a run into equal parts, each computed by one process, and their numbers
//! in a scheduler's array.
//!
//! Chunk `c` belongs to shard `c mod N`, so that every shard has chunks in every region of the
//! grid. The first process to start writes `N` and the array number of the first shard to
//! `shards.json`, where they stay. If two lost tasks are submitted again (`--array=3,7`), the
//! scheduler gives a count of 2 and a least number of 3, which are ignored.

use std::collections::{BTreeMap, BTreeSet};
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::plan_file::{format_json, rename_damaged};
use super::{Folder, SHARDS_FILE, StoreError};
use crate::Environment;
use sweep_files::{atomic, regular};

/// The maximum number of shards. Basis: no scheduler's array has more tasks, and loops over shards
/// stay short. Doubling it doubles these loops.
const MAX_SHARDS: u64 = 1_000_000;

/// A shard: one of `count` equal parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// The number of the shard, from 1.
    pub index: u64,
    /// The number of shards.
    pub count: u64,
}

impl Shard {
    /// Returns whether a chunk belongs to this shard.
    pub fn owns_chunk(self, chunk: u64) -> bool {
        chunk % self.count == self.index - 1
    }

    /// Returns the number of chunks that belong to this shard, of a run with `chunks` chunks.
    pub const fn count_chunks(self, chunks: u64) -> u64 {
        chunks.saturating_sub(self.index - 1).div_ceil(self.count)
    }
}

/// A value of `--shard`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShardRequest {
    /// `I/N`.
    Given(Shard),
    /// `auto/N`: the number of shards is given, that of this one is taken from the scheduler.
    Auto {
        /// The number of shards.
        count: u64,
    },
}

impl FromStr for ShardRequest {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected_text =
            || format!("expected I/N with I from 1 to N, or auto/N, such as 3/8; got `{text}`");
        let (index, count) = text.split_once('/').ok_or_else(expected_text)?;
        let count: u64 = count.parse().map_err(|_| expected_text())?;
        if !(1..=MAX_SHARDS).contains(&count) {
            return Err(format!("expected 1 to {MAX_SHARDS} shards; got {count}"));
        }
        if index == "auto" {
            return Ok(Self::Auto { count });
        }
        match index.parse() {
            Ok(index) if (1..=count).contains(&index) => Ok(Self::Given(Shard { index, count })),
            _ => Err(expected_text()),
        }
    }
}

/// The division of a run into shards, the content of `shards.json`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ShardLayout {
    /// The number of shards.
    pub shards: u64,
    /// The number of shard 1 in the scheduler's array.
    pub first_array_id: u64,
}

impl ShardLayout {
    /// Reads the division of a run folder; `None` if no shard has started, or if the file is not
    /// readable. It decides which process computes a chunk, but not its content.
    pub(super) fn read(folder: &Folder) -> Result<Option<Self>, StoreError> {
        let path = folder.file(SHARDS_FILE);
        let text = regular::none_if_missing(regular::read_json(&path));
        let text = text.map_err(StoreError::io("read", &path))?;
        let layout = text.and_then(|text| serde_json::from_slice(&text).ok());
        Ok(layout.filter(|layout: &Self| (1..=MAX_SHARDS).contains(&layout.shards)))
    }

    /// Returns the shards, numbered from 1, of which a chunk is missing.
    pub(super) fn incomplete_shards(
        self,
        chunks: u64,
        complete_chunks: &BTreeSet<u64>,
    ) -> Vec<u64> {
        let mut complete_by_shard: BTreeMap<u64, u64> = BTreeMap::new();
        for chunk in complete_chunks {
            *complete_by_shard.entry(chunk % self.shards + 1).or_default() += 1;
        }
        let is_incomplete = |index: &u64| {
            let own_chunks = Shard { index: *index, count: self.shards }.count_chunks(chunks);
            complete_by_shard.get(index).copied().unwrap_or(0) < own_chunks
        };
        (1..=self.shards).filter(is_incomplete).collect()
    }

    /// Writes the division, unless another shard has written one. Returns the division in the file.
    pub(super) fn write_if_absent(self, folder: &Folder) -> Result<Self, StoreError> {
        let text = format_json(&json!(self));
        let path = folder.file(SHARDS_FILE);
        if atomic::create(&folder.path, &path, &text)? {
            return Ok(self);
        }
        if let Some(stored_layout) = Self::read(folder)? {
            return Ok(stored_layout);
        }
        // The file belongs to another program, or is damaged.
        rename_damaged(&path)?;
        atomic::write(&folder.path, &path, &text)?;
        Ok(self)
    }
}

/// Returns the shard of this process and the division into shards; `None` for the whole run. The
/// shard is that of the request, or else that of a Slurm array or a Kubernetes Indexed Job.
/// `stored_layout` is the division that an earlier process has written, if there is one.
///
/// # Errors
/// [`StoreError::Refused`] if the request, the scheduler and the stored division contradict each
/// other.
pub(super) fn resolve_shard(
    shard_request: Option<ShardRequest>,
    environment: Environment<'_>,
    stored_layout: Option<ShardLayout>,
) -> Result<Option<(Shard, ShardLayout)>, StoreError> {
    let refuse = |text: String| Err(StoreError::Refused(text));
    let refuse_count = |shards: u64, requested_count: u64, help: String| {
        refuse(format!(
            "this run was divided into {shards} shards by the first to start, not \
             {requested_count}\n  = help: use --shard {help}"
        ))
    };
    if let Some(ShardRequest::Given(shard)) = shard_request {
        let layout =
            stored_layout.unwrap_or(ShardLayout { shards: shard.count, first_array_id: 1 });
        let shards = layout.shards;
        if shards != shard.count {
            let help = format!("I/{shards}, or run it whole without --shard");
            return refuse_count(shards, shard.count, help);
        }
        return Ok(Some((shard, layout)));
    }
    let requested_count = shard_request
        .map(|(ShardRequest::Auto { count } | ShardRequest::Given(Shard { count, .. }))| count);
    let Some(scheduler) = SchedulerTask::read(environment)? else {
        return match requested_count {
            None => Ok(None),
            Some(count) => refuse(format!(
                "--shard auto/{count} takes its number from SLURM_ARRAY_TASK_ID or \
                 JOB_COMPLETION_INDEX, and neither is set\n  = help: give it as --shard I/{count}"
            )),
        };
    };
    let layout = match (stored_layout, requested_count.or(scheduler.task_count)) {
        (Some(ShardLayout { shards, .. }), Some(count))
            if requested_count.is_some() && count != shards =>
        {
            return refuse_count(shards, count, format!("auto/{shards}"));
        }
        (Some(layout), _) => layout,
        (None, Some(shards)) => ShardLayout { shards, first_array_id: scheduler.first_task_id },
        (None, None) => {
            return refuse(format!(
                "{} is set, but not how many shards there are\n  = help: give --shard auto/N, or \
                 --shard 1/1 to run it whole",
                scheduler.variable
            ));
        }
    };
    match scheduler.task_id.checked_sub(layout.first_array_id) {
        Some(offset) if offset < layout.shards => {
            Ok(Some((Shard { index: offset + 1, count: layout.shards }, layout)))
        }
        _ => refuse(format!(
            "{} is {}, but this run's {} shards are numbered {} to {}\n  = help: submit those \
             numbers, or give --shard I/N",
            scheduler.variable,
            scheduler.task_id,
            layout.shards,
            layout.first_array_id,
            layout.first_array_id.saturating_add(layout.shards - 1)
        )),
    }
}

/// The environment variables of a scheduler about this task.
struct SchedulerTask {
    /// The name of the variable with the task's number.
    variable: &'static str,
    /// The task's number in the array.
    task_id: u64,
    /// The least number of the array.
    first_task_id: u64,
    /// The number of tasks, if the scheduler gives it.
    task_count: Option<u64>,
}

impl SchedulerTask {
    fn read(environment: Environment<'_>) -> Result<Option<Self>, StoreError> {
        let parse_variable = |name: &'static str| match environment(name) {
            None => Ok(None),
            Some(text) => text.parse::<u64>().map(Some).map_err(|_| {
                StoreError::Refused(format!("{name} is `{text}`, which is not a number"))
            }),
        };
        if let Some(task_id) = parse_variable("SLURM_ARRAY_TASK_ID")? {
            let first_task_id = parse_variable("SLURM_ARRAY_TASK_MIN")?.unwrap_or(task_id);
            let task_count = parse_variable("SLURM_ARRAY_TASK_COUNT")?
                .filter(|count| (1..=MAX_SHARDS).contains(count));
            return Ok(Some(Self {
                variable: "SLURM_ARRAY_TASK_ID",
                task_id,
                first_task_id,
                task_count,
            }));
        }
        let index = parse_variable("JOB_COMPLETION_INDEX")?;
        Ok(index.map(|task_id| Self {
            variable: "JOB_COMPLETION_INDEX",
            task_id,
            first_task_id: 0,
            task_count: None,
        }))
    }
}

/// Formats numbers for `sbatch --array=`: `2,5-7`.
pub fn format_numbers(numbers: impl IntoIterator<Item = u64>) -> String {
    let numbers: Vec<u64> = numbers.into_iter().collect();
    let formatted_ranges =
        numbers.chunk_by(|previous, next| previous + 1 == *next).map(|range| match range {
            [first, .., last] => format!("{first}-{last}"),
            _ => range[0].to_string(),
        });
    formatted_ranges.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn environment_of(
        variables: &'static [(&'static str, &'static str)],
    ) -> impl Fn(&str) -> Option<String> {
        move |name| {
            variables.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
        }
    }

    fn refusal_message(result: Result<Option<(Shard, ShardLayout)>, StoreError>) -> String {
        let error = result.unwrap_err();
        assert!(error.is_refusal());
        error.to_string()
    }

    #[test]
    fn values_of_the_shard_option_are_parsed() {
        assert_eq!("3/8".parse(), Ok(ShardRequest::Given(Shard { index: 3, count: 8 })));
        assert_eq!("auto/8".parse(), Ok(ShardRequest::Auto { count: 8 }));
        for invalid_text in
            ["0/8", "9/8", "1/0", "auto/0", "3", "a/8", "3/", "-1/8", "3/8/2", "", "1/1000001"]
        {
            assert!(
                invalid_text.parse::<ShardRequest>().unwrap_err().starts_with("expected"),
                "{invalid_text}"
            );
        }
    }

    #[test]
    fn every_chunk_belongs_to_one_shard() {
        for chunk in 0..100 {
            let owners =
                (1..=7).filter(|&index| Shard { index, count: 7 }.owns_chunk(chunk)).count();
            assert_eq!(owners, 1);
        }
        for chunks in 0..30 {
            for index in 1..=7 {
                let shard = Shard { index, count: 7 };
                assert_eq!(
                    shard.count_chunks(chunks),
                    (0..chunks).filter(|&chunk| shard.owns_chunk(chunk)).count() as u64
                );
            }
        }
    }

    #[test]
    fn without_option_and_scheduler_the_whole_run_is_computed() {
        assert_eq!(resolve_shard(None, &environment_of(&[]), None).unwrap(), None);
    }

    #[test]
    fn a_slurm_array_numbers_the_shards_from_its_first_task() {
        let zero_based_array = environment_of(&[
            ("SLURM_ARRAY_TASK_ID", "2"),
            ("SLURM_ARRAY_TASK_MIN", "0"),
            ("SLURM_ARRAY_TASK_COUNT", "8"),
        ]);
        let (shard, layout) = resolve_shard(None, &zero_based_array, None).unwrap().unwrap();
        assert_eq!(shard, Shard { index: 3, count: 8 });
        assert_eq!(layout, ShardLayout { shards: 8, first_array_id: 0 });
    }

    #[test]
    fn resubmitted_tasks_keep_the_numbers_of_the_first_array() {
        let resubmitted_array = environment_of(&[
            ("SLURM_ARRAY_TASK_ID", "7"),
            ("SLURM_ARRAY_TASK_MIN", "3"),
            ("SLURM_ARRAY_TASK_COUNT", "2"),
        ]);
        let stored_layout = ShardLayout { shards: 8, first_array_id: 1 };
        let (shard, layout) =
            resolve_shard(None, &resubmitted_array, Some(stored_layout)).unwrap().unwrap();
        assert_eq!((shard, layout), (Shard { index: 7, count: 8 }, stored_layout));
    }

    #[test]
    fn a_task_whose_number_is_outside_the_array_is_refused() {
        let array_with_gaps = environment_of(&[
            ("SLURM_ARRAY_TASK_ID", "20"),
            ("SLURM_ARRAY_TASK_MIN", "0"),
            ("SLURM_ARRAY_TASK_COUNT", "3"),
        ]);
        assert!(
            refusal_message(resolve_shard(None, &array_with_gaps, None))
                .contains("numbered 0 to 2")
        );
    }

    #[test]
    fn kubernetes_gives_the_index_and_the_option_the_count() {
        let kubernetes = environment_of(&[("JOB_COMPLETION_INDEX", "0")]);
        let (shard, _) = resolve_shard(Some(ShardRequest::Auto { count: 4 }), &kubernetes, None)
            .unwrap()
            .unwrap();
        assert_eq!(shard, Shard { index: 1, count: 4 });
        assert!(refusal_message(resolve_shard(None, &kubernetes, None)).contains("auto/N"));
        let without_scheduler =
            resolve_shard(Some(ShardRequest::Auto { count: 4 }), &environment_of(&[]), None);
        assert!(refusal_message(without_scheduler).contains("--shard I/4"));
        let invalid_id = environment_of(&[("SLURM_ARRAY_TASK_ID", "x")]);
        assert!(refusal_message(resolve_shard(None, &invalid_id, None)).contains("not a number"));
    }

    #[test]
    fn a_count_of_shards_that_differs_from_the_file_is_refused() {
        let stored_layout = Some(ShardLayout { shards: 4, first_array_id: 1 });
        let requested_shard = Some(ShardRequest::Given(Shard { index: 1, count: 8 }));
        assert!(
            refusal_message(resolve_shard(requested_shard, &environment_of(&[]), stored_layout))
                .contains("into 4 shards")
        );
        let kubernetes = environment_of(&[("JOB_COMPLETION_INDEX", "1")]);
        assert!(
            refusal_message(resolve_shard(
                Some(ShardRequest::Auto { count: 8 }),
                &kubernetes,
                stored_layout
            ))
            .contains("into 4 shards")
        );
    }

    #[test]
    fn a_shard_is_incomplete_until_all_its_chunks_exist() {
        let layout = ShardLayout { shards: 4, first_array_id: 1 };
        assert_eq!(layout.incomplete_shards(6, &BTreeSet::new()), [1, 2, 3, 4]);
        assert_eq!(layout.incomplete_shards(6, &BTreeSet::from([0, 1, 3, 4])), [2, 3]);
        assert!(
            layout.incomplete_shards(2, &BTreeSet::from([0, 1])).is_empty(),
            "shards without a chunk lack nothing"
        );
    }

    #[test]
    fn numbers_are_formatted_for_sbatch() {
        assert_eq!(format_numbers([2, 5, 6, 7, 9]), "2,5-7,9");
        assert_eq!(format_numbers([]), "");
    }
}
