#!/usr/bin/env bash
# The checks beyond the release tests. Without arguments all of them, in this order; each is announced with the time it took.
#
#   scripts/check.sh [STEP...] [--all]
#
#   format   clang-format 14 over every .h and .cc
#   shell    shellcheck over the scripts
#   layers   the checkers' own tests, then every #include against ARCHITECTURE.md, and every namespace against its folder
#   citations  the checker's own test, then that what code and documents cite is in the repository
#   docs     the checker's own test, then the form of the documents: length of lines, of the README, indices
#   sizes    the checker's own test, then the lengths of files, headers, functions and classes, nesting, and how many headers a
#            single file includes
#   alone    the checker's own test, then each .cc file compiled alone, and that those of a folder do not call each other in a
#            circle: the folders whose day it is (scripts/check_alone.py deals them out over four weeks), with --all every folder
#   tsan     the tests of node under ThreadSanitizer
#   asan     the tests of what handles the bytes of others, compiled with clang, under AddressSanitizer and UBSan: the core,
#            sockets and the loop, perception. `scripts/test.sh asan` is every test, for an hour.
#   fuzz     each fuzz target for 20 s, which must find nothing and reach its floor (scripts/fuzz.sh); it goes on with the
#            build of asan
#
# Exit codes: 0 all passed, 1 a step failed, 2 usage, 5 needs root to install packages.
set -euo pipefail
root=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
cd "$root"
# shellcheck source=scripts/phase.sh
. scripts/phase.sh

all_steps=(format shell layers citations docs sizes alone tsan asan fuzz)
steps=()
folders_alone=()  # of the day
for argument in "$@"; do
  case $argument in
    -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "${BASH_SOURCE[0]}"; exit 0 ;;
    --all) folders_alone=(--all) ;;
    *)
      [[ " ${all_steps[*]} " == *" $argument "* ]] || { printf "check: no step '%s'; see scripts/check.sh --help\n" "$argument" >&2; exit 2; }
      steps+=("$argument")
      ;;
  esac
done
((${#steps[@]} > 0)) || steps=("${all_steps[@]}")

if [[ -e $root/build && ! -w $root/build ]]; then
  printf '%s: cannot write to %s/build, which belongs to %s; remove it or run as that user\n' check "$root" "$(stat -c %U "$root/build")" >&2
  exit 1
fi
trap 'exit 130' INT

# shellcheck source=scripts/caches.sh
. "$root/scripts/caches.sh"
export PYTHONDONTWRITEBYTECODE=1
jobs=$(nproc)
phase "install packages for checks" bash scripts/setup.sh --with-checks

# Files of the project, tracked or new, ignoring what .gitignore names.
project_files() { git -c "safe.directory=$root" ls-files --cached --others --exclude-standard -- "$@"; }

# The sanitizers of these compilers expect the usual memory layout.
sanitized() {
  if setarch -R true 2>/dev/null; then setarch -R "$@"; else "$@"; fi
}

run_format() {
  local files
  mapfile -t files < <(project_files '*.h' '*.cc')
  ((${#files[@]} > 0)) || { echo "no source files found"; return 1; }
  clang-format-14 --dry-run -Werror "${files[@]}" || {
    echo "to format them: clang-format-14 -i FILE..."
    return 1
  }
  echo "${#files[@]} files"
}

run_shell() {
  local files
  mapfile -t files < <(project_files '*.sh' .ci/run)
  ((${#files[@]} > 0)) || { echo "no scripts found"; return 1; }
  shellcheck "${files[@]}" && echo "${#files[@]} files"
}

# A checker's own test, then the checker.
checked() { python3 "scripts/check_$1_test.py" && python3 "scripts/check_$1.py" "${@:2}"; }

run_layers() { checked layers && checked namespaces; }

run_citations() { checked citations; }

run_sizes() { checked sizes; }

# The preset is configured for its flags, and not built.
run_alone() {
  phase "alone: configure" cmake --preset alone --log-level=WARNING &&
    phase "alone: compile" checked alone --jobs "$jobs" "${folders_alone[@]}"
}

run_docs() { PYTHONDONTWRITEBYTECODE=1 python3 scripts/check_docs_test.py && python3 scripts/check_docs.py; }

run_tsan() {
  phase "tsan: configure" cmake --preset tsan --log-level=WARNING &&
    phase "tsan: build" cmake --build build/tsan --parallel "$jobs" --target node_loop_test &&
    TSAN_OPTIONS="${TSAN_OPTIONS:-second_deadlock_stack=1}" phase "tsan: tests" \
      sanitized ctest --test-dir build/tsan -R '^loop([.]|$)' --output-on-failure --no-tests=error --timeout 600
}

# The folders of tests/ that are run. Those of the simulation are not: they run the same core for hours of virtual time, which
# takes a quarter of an hour here. Nor are those of the programs and the testbed, which are half of all that is compiled.
sanitized_folders=(fuzz core/{base,code,wire,secure,link,cc,plan,flow,guard,endpoint,messages,dispatch,probe} policies node/{io,loop} app/{computing,perception})
# The cases of those folders that are not run: detectors over a whole video, which is OpenCV's code and takes minutes; what counts
# allocations, since AddressSanitizer has an allocator of its own; and packets in such numbers, for a statistic, that every line
# was run by other cases before.
left_out='DemoVideo.*:Allocation.*:Forgery.NoNumberIsSealedTwice:SenderWindow.BurstsOfLosses:SenderWindow.MoreLossMoreSymbols'

run_asan() {
  local folder targets=() names=()
  for folder in "${sanitized_folders[@]}"; do
    targets+=("${folder//\//_}_test")
    names+=("${folder##*/}")
  done
  phase "asan: configure" cmake --preset asan --log-level=WARNING &&
    phase "asan: build" cmake --build build/asan --parallel "$jobs" --target "${targets[@]}" &&
    ASAN_OPTIONS="${ASAN_OPTIONS:-detect_stack_use_after_return=1:strict_string_checks=1}" \
      UBSAN_OPTIONS="${UBSAN_OPTIONS:-print_stacktrace=1}" GTEST_FILTER="-$left_out" phase "asan: tests" \
      sanitized ctest --test-dir build/asan -R "^($(IFS='|'; echo "${names[*]}"))([.][0-9]+)?\$" --output-on-failure \
      --no-tests=error --timeout 900 -j $((2 * jobs))
}

# Every entry point is a target with a floor and seeds, and the other way round: one that nobody runs would pass.
run_fuzz() {
  local entries targets
  entries=$(cd tests/fuzz && printf '%s\n' *_fuzz.cc | sed 's/_fuzz\.cc$//' | sort)
  targets=$(bash scripts/fuzz.sh --list | cut -d ' ' -f 1 | sort)
  if [[ $entries != "$targets" ]]; then
    echo "tests/fuzz has other entry points (*_fuzz.cc) than tests/fuzz/floors.txt has targets:"
    diff <(echo "$entries") <(echo "$targets")
    return 1
  fi
  bash scripts/fuzz.sh --floors all 20
}

failed=()
summary=()
for step in "${steps[@]}"; do
  printf 'check: %s ...\n' "$step"
  began=$SECONDS
  verdict=passed
  case $step in
    alone | tsan | asan | fuzz) "run_$step" ;;  # these tell their parts
    *) phase "check: $step" "run_$step" ;;
  esac || { verdict=FAILED; failed+=("$step"); }
  line=$(printf 'check: %-9s %s in %d s' "$step" "$verdict" $((SECONDS - began)))
  echo "$line"
  summary+=("$line")
done

if ((${#steps[@]} > 1)); then
  echo
  printf '%s\n' "${summary[@]}"
fi
((${#failed[@]} == 0)) || { printf 'check: failed: %s\n' "${failed[*]}" >&2; exit 1; }
