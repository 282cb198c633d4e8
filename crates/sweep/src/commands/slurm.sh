#!/bin/sh
# Submits the sweep {name}: {shards} shards as one array, and their merge once all have ended.
# Run it where sbatch is. Arguments go to the array's sbatch: `sh THIS_SCRIPT --array=3,7` submits
# the shards again that `sweep status` misses, and the merge after them. Slurm queues a task again
# that loses its node; the task goes on from its finished chunks.
set -eu
cd {folder}
mkdir -p {results}

array=$(sbatch --parsable --job-name={name} --array=1-{shards} --requeue --open-mode=append \
    --nodes=1 --ntasks=1 --cpus-per-task={cpus} --output={array_log}{common} "$@" <<'END'
#!/bin/sh
exec {run} --shard "$SLURM_ARRAY_TASK_ID/{shards}"
END
)
array=${{array%%;*}}

# Whatever became of the tasks: a merge that finds a chunk missing names its shard, and leaves
# everything in place.
merge=$(sbatch --parsable --job-name={name}-merge --dependency="afterany:$array" --requeue \
    --open-mode=append --nodes=1 --ntasks=1 --output={merge_log}{common} <<'END'
#!/bin/sh
exec {merge}
END
)
echo "array $array, merge ${{merge%%;*}}"
