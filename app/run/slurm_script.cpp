#include "app/run/slurm_script.hpp"

#include <fmt/format.h>

namespace ringlock::app {

std::string shell_quoted(const std::string& word) {
    constexpr std::string_view plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=:,./@%";
    if (!word.empty() && word.find_first_not_of(plain) == std::string::npos) return word;
    std::string quoted = "'";
    for (const char c : word) {
        if (c == '\'') {
            quoted += "'\\''";
        } else {
            quoted += c;
        }
    }
    return quoted + "'";
}

std::string slurm_script(const SlurmJobs& jobs) {
    std::string options;
    for (const std::string& option : jobs.options) options += " " + shell_quoted(option);
    std::string script = "#!/bin/bash\n";
    script += fmt::format("# {}\n", jobs.note);
    script += R"(#
#   bash THIS_SCRIPT      submits the shards, and the merge that waits for them
#
# The merge looks for shards that have failed, and submits these and itself again. A shard that Slurm ends or starts
# anew goes on from its checkpoints.
set -euo pipefail

)";
    script += fmt::format("ringlock={}\nscenario={}\nresult={}\n", shell_quoted(jobs.program),
                          shell_quoted(jobs.scenario), shell_quoted(jobs.result));
    script += fmt::format("shards={}\ntries={}\nrun_options=({})\n", jobs.shards, slurm_tries,
                          options.empty() ? options : options.substr(1));
    script += fmt::format("shard_job=(--cpus-per-task={} --mem={}M --time={})\n", jobs.threads, jobs.memory_mb,
                          jobs.shard_limit_min);
    script += fmt::format("merge_job=(--cpus-per-task={} --mem={}M --time={})\n", jobs.threads, jobs.memory_mb,
                          jobs.merge_limit_min);
    script += R"(
# Inside a job this is a copy that Slurm has made: the script of that name is handed on.
role=${1:-submit}
this=${2:-$(realpath "$0")}
try=${3:-1}
name=$(basename "$result")

# submit SHARDS TRY: these shards as an array, and a merge after them.
submit() {
    local array
    array=$(sbatch --parsable --job-name="$name" --array="$1" --output="$result.slurm-%A_%a.log" \
        "${shard_job[@]}" "$this" shard "$this")
    array=${array%%;*}
    sbatch --job-name="$name-merge" --dependency="afterany:$array" --output="$result.slurm-%j.log" \
        "${merge_job[@]}" "$this" merge "$this" "$2"
}

case $role in
submit)
    submit "1-$shards" 1
    ;;
shard)
    exec "$ringlock" run "$scenario" -o "$result" "${run_options[@]}" --threads "$SLURM_CPUS_PER_TASK" \
        --shard "$SLURM_ARRAY_TASK_ID/$shards" --resume --quiet
    ;;
merge)
    if compgen -G "$result.shard-*-of-$shards" >/dev/null; then
        missing=$("$ringlock" merge "$result" --missing | sed 's|/.*||' | paste -sd, -)
    else
        missing=1-$shards
    fi
    if [[ -z $missing ]]; then
        exec "$ringlock" merge "$result" --threads "$SLURM_CPUS_PER_TASK"
    fi
    if ((try >= tries)); then
        echo "shards $missing of $shards have failed $tries times; their logs are $result.slurm-*.log" >&2
        exit 1
    fi
    echo "submitting shards $missing of $shards again" >&2
    submit "$missing" $((try + 1))
    ;;
*)
    echo "usage: bash $0" >&2
    exit 2
    ;;
esac
)";
    return script;
}

}  // namespace ringlock::app
