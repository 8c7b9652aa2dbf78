#!/usr/bin/env bash
# Builds the fuzz targets (preset fuzz: clang, libFuzzer, AddressSanitizer, UBSan) and runs them, one for each processor at a time.
#
#   scripts/fuzz.sh --list
#   scripts/fuzz.sh [--floors] [--no-build] [TARGET...] [SECONDS]
#
#   --list      names the targets, each with the coverage that it has to reach, and ends
#   --floors    from the seeds of the repository alone, and a target that reaches less than tests/fuzz/floors.txt says fails;
#               one that is below when its time is over, as on a busy machine, goes on until it is not, thrice as long at most
#   --no-build  runs what was built before
#   TARGET      which; all (default) or names of --list
#   SECONDS     how long each one runs, 1 to 86400; default 300
#
# A target begins with tests/fuzz/corpus/TARGET and, without --floors, with what earlier runs have found. It leaves in
# build/fuzz/TARGET: log, what libFuzzer said; found, new inputs; findings, the inputs that broke something.
#
# Exit codes: 0 no finding, 1 a finding, too little coverage or a failed build, 2 usage, 5 needs root to install packages.
set -euo pipefail
root=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
# shellcheck source=scripts/phase.sh
. "$root/scripts/phase.sh"

usage() { printf 'fuzz: %s; see scripts/fuzz.sh --help\n' "$1" >&2; exit 2; }

# "TARGET FLOOR" for each target, sorted as the file has them.
floors() { grep -vE '^(#|$)' "$root/tests/fuzz/floors.txt"; }
mapfile -t known < <(floors | cut -d ' ' -f 1)

targets=()
seconds=300
build=1 check_floors=0
for argument in "$@"; do
  case $argument in
    -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "${BASH_SOURCE[0]}"; exit 0 ;;
    --list) floors; exit 0 ;;
    --floors) check_floors=1 ;;
    --no-build) build=0 ;;
    -*) usage "unknown option '$argument'" ;;
    [0-9]*)
      if [[ ! $argument =~ ^[0-9]{1,5}$ ]] || ((10#$argument < 1 || 10#$argument > 86400)); then
        usage "'$argument' is not 1 to 86400 seconds"
      fi
      seconds=$((10#$argument))
      ;;
    all) targets+=("${known[@]}") ;;
    *)
      [[ " ${known[*]} " == *" $argument "* ]] || usage "no target '$argument'; there are ${known[*]}"
      targets+=("$argument")
      ;;
  esac
done
((${#targets[@]} > 0)) || targets=("${known[@]}")

if [[ -e $root/build && ! -w $root/build ]]; then
  printf '%s: cannot write to %s/build, which belongs to %s; remove it or run as that user\n' fuzz "$root" "$(stat -c %U "$root/build")" >&2
  exit 1
fi

# shellcheck source=scripts/caches.sh
. "$root/scripts/caches.sh"
export ASAN_OPTIONS="${ASAN_OPTIONS:-strict_string_checks=1}"
export UBSAN_OPTIONS="${UBSAN_OPTIONS:-print_stacktrace=1}"
jobs=$(nproc)
cd "$root"

if ((build)); then
  phase "install packages for checks" bash scripts/setup.sh --with-checks
  phase "fuzz: configure" cmake --preset fuzz --log-level=WARNING || exit 1
  names=("${targets[@]/%/_fuzz}")
  phase "fuzz: build" cmake --build build/asan --parallel "$jobs" --target "${names[@]}" || exit 1
fi

# The sanitizers of these compilers expect the usual memory layout.
runner=()
if setarch -R true 2>/dev/null; then runner=(setarch -R); fi

work=$root/build/fuzz
declare -A pids=()
stop() {
  local pid
  for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
}

# What its targets find in an input that takes so long is a hang; those with a bound of time have a much smaller one.
hang_s=20
memory_mb=2048
# The longest that a target runs.
longest=$((check_floors ? 3 * seconds : seconds))
declare -A since=()
start() {
  local target=$1 folder=$work/$1 seeds=$root/tests/fuzz/corpus/$1
  ((!check_floors)) || rm -rf "$folder/found"
  rm -rf "$folder/scratch"
  mkdir -p "$folder/found" "$folder/findings" "$folder/scratch"
  TMPDIR=$folder/scratch "${runner[@]}" "$root/build/asan/tests/fuzz/${target}_fuzz" "$folder/found" "$seeds" \
    -max_total_time="$longest" -timeout="$hang_s" -rss_limit_mb="$memory_mb" -print_final_stats=1 \
    -artifact_prefix="$folder/findings/" >"$folder/log" 2>&1 &
  pids[$target]=$!
  since[$target]=$SECONDS
}

# Whether it has had its time and covers what it has to. Then SIGUSR1 ends it, after which libFuzzer's exit code is 0.
has_enough() {
  ((check_floors && SECONDS - since[$1] >= seconds)) && (($(figure "$1" cov:) >= $(floor_of "$1")))
}

# The newest figure behind a word ("cov:", "exec/s:") in a log, 0 where there is none.
figure() { grep -aoE "$2 [0-9]+" "$work/$1/log" | tail -n 1 | grep -oE '[0-9]+$' || echo 0; }
runs_of() { grep -aoE '^#[0-9]+|number_of_executed_units: [0-9]+' "$work/$1/log" | tail -n 1 | grep -oE '[0-9]+$' || echo 0; }
floor_of() { floors | awk -v name="$1" '$1 == name { print $2 }'; }

failed=()
rows=()
finish() {
  local target=$1 code=$2 verdict=fine runs covered floor
  runs=$(runs_of "$target")
  covered=$(figure "$target" cov:)
  floor=$(floor_of "$target")
  if ((code == 72)); then
    verdict=interrupted  # libFuzzer's code after a signal from outside
  elif ((code != 0)); then
    verdict=FINDING
  elif ((check_floors && covered < floor)); then
    verdict="covers less than $floor"
  fi
  rows+=("$(printf '%-11s %12s %8s %9s %7s  %s' "$target" "$runs" "$((runs / (SECONDS - since[$target] + 1)))" "$covered" "$floor" "$verdict")")
  rm -rf "$work/$target/scratch"
  if [[ $verdict == fine ]]; then return; fi
  failed+=("$target")
  printf 'fuzz: %s: %s\n' "$target" "$verdict"
  if [[ $verdict == FINDING ]]; then
    grep -aE '^finding:|ERROR:|runtime error:|SUMMARY:|Test unit written' "$work/$target/log" | head -n 8 || true
    printf 'fuzz: again: build/asan/tests/fuzz/%s_fuzz build/fuzz/%s/findings/FILE; all of it: build/fuzz/%s/log\n' "$target" "$target" "$target"
  fi
}

tell() {
  local target
  for target in "${!pids[@]}"; do
    printf 'fuzz: %s: %s runs, coverage %s\n' "$target" "$(runs_of "$target")" "$(figure "$target" cov:)"
  done
}

# In a function with all that it changes, because phase may run it in a shell of its own.
run_all() {
  local target told=$SECONDS code
  trap 'stop; exit 130' INT TERM
  local waiting=("${targets[@]}")
  while ((${#waiting[@]} + ${#pids[@]} > 0)); do
    while ((${#pids[@]} < jobs && ${#waiting[@]} > 0)); do
      printf 'fuzz: %s for %d s\n' "${waiting[0]}" "$seconds"
      start "${waiting[0]}"
      waiting=("${waiting[@]:1}")
    done
    sleep 0.5
    for target in "${!pids[@]}"; do
      if kill -0 "${pids[$target]}" 2>/dev/null; then
        ! has_enough "$target" || kill -USR1 "${pids[$target]}" 2>/dev/null || true
        continue
      fi
      code=0
      wait "${pids[$target]}" || code=$?
      unset "pids[$target]"
      finish "$target" "$code"
    done
    if ((SECONDS - told >= 30)); then
      told=$SECONDS
      tell
    fi
  done
  printf '\n%-11s %12s %8s %9s %7s\n' target runs per-s coverage floor
  printf '%s\n' "${rows[@]}"
  ((${#failed[@]} == 0)) || { printf 'fuzz: failed: %s\n' "${failed[*]}" >&2; return 1; }
}

phase "fuzz: run" run_all
