#!/usr/bin/env bash
# Installs what is missing, builds a preset and runs every test.
#
#   scripts/test.sh [--full] [PRESET]
#
#   --full    also the tests that take minutes: the testbed's delays over half an hour, in virtual time
#   PRESET    release (default), debug, asan, tsan or clang; see CMakePresets.json
#
# Exit codes: 0 every test passed, 1 a build or test failed, 2 usage, 5 needs root to install packages.
set -euo pipefail
root=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
# shellcheck source=scripts/phase.sh
. "$root/scripts/phase.sh"

preset=
selection=()
for argument in "$@"; do
  case $argument in
    -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "${BASH_SOURCE[0]}"; exit 0 ;;
    --full) selection=(-C full) ;;
    -*) printf "test: unknown option '%s'; see scripts/test.sh --help\n" "$argument" >&2; exit 2 ;;
    *)
      [[ -z $preset ]] || { echo "test: one preset at a time" >&2; exit 2; }
      preset=$argument
      ;;
  esac
done
preset=${preset:-release}
case $preset in
  release | debug | asan | tsan | clang) ;;
  *) printf "test: no preset '%s'; there are release, debug, asan, tsan, clang\n" "$preset" >&2; exit 2 ;;
esac

if [[ -e $root/build && ! -w $root/build ]]; then
  printf '%s: cannot write to %s/build, which belongs to %s; remove it or run as that user\n' test "$root" "$(stat -c %U "$root/build")" >&2
  exit 1
fi
trap 'exit 130' INT

# shellcheck source=scripts/caches.sh
. "$root/scripts/caches.sh"
jobs=$(nproc)

# The tests of tc-netem boot a virtual machine where the kernel has none; clang comes with what the checks need.
packages=(--with-vm)
case $preset in asan | clang) packages+=(--with-checks) ;; esac
phase "install packages" bash "$root/scripts/setup.sh" "${packages[@]}"
cd "$root"
phase "$preset: configure" cmake --preset "$preset" --log-level=WARNING || exit 1
phase "$preset: build" cmake --build "build/$preset" --parallel "$jobs" || exit 1

if [[ $preset == asan ]]; then
  mapfile -t unsanitized < <(grep -vE '^(#|$)' tests/unsanitized.txt)
  for line in "${unsanitized[@]}"; do
    if [[ $(ctest --test-dir "build/$preset" -N -R "$line") == *"Total Tests: 0" ]]; then
      printf "test: '%s' in tests/unsanitized.txt names no test\n" "$line" >&2
      exit 1
    fi
  done
  selection+=(-E "$(IFS='|'; echo "${unsanitized[*]}")")
fi

# The sanitizers of these compilers expect the usual memory layout.
runner=()
case $preset in
  asan | tsan) if setarch -R true 2>/dev/null; then runner=(setarch -R); fi ;;
esac
export ASAN_OPTIONS="${ASAN_OPTIONS:-detect_stack_use_after_return=1:strict_string_checks=1}"
export UBSAN_OPTIONS="${UBSAN_OPTIONS:-print_stacktrace=1}"
export TSAN_OPTIONS="${TSAN_OPTIONS:-second_deadlock_stack=1}"
# Two tests for each processor, as half of them wait more than they compute; those that compute take two places
# (cmake/modules.cmake, interneuron_test), the longest begin first.
phase "$preset: tests" "${runner[@]}" ctest --test-dir "build/$preset" --output-on-failure --no-tests=error --timeout 300 \
  -j $((2 * jobs)) \
  "${selection[@]}" || exit 1
