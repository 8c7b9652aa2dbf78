#!/usr/bin/env bash
# Runs the tests of tc-netem where the kernel has none: in a machine of scripts/vm.sh, whose kernel has it. Where this
# kernel has it, the ordinary run of the same tests covers them.
#
#   tests/netns/netem_conformance.sh TEST_PROGRAM [GTEST_FILTER [--uml|--icount|--kvm|--tcg]]
#
# Exit codes: 0 passed, 1 failed, 77 skipped: covered already, no such test, or no machine can be had.
set -euo pipefail
root=$(dirname "$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")")
program=$(readlink -f "${1:?}")
filter=${2:-*Netem*}
machine=("${@:3}")
cd "$root"

skip() { printf 'netem_conformance: skipped: %s\n' "$*"; exit 77; }

"$program" --gtest_list_tests --gtest_filter="$filter" | grep -q '^  ' || skip "no test matches $filter"
as_root=()
((EUID == 0)) || as_root=(unshare -r)
if "${as_root[@]}" unshare -n tc qdisc add dev lo root netem delay 1ms 2>/dev/null; then
  skip "this kernel has netem, so the ordinary tests have tried it"
fi

output=$(mktemp)
trap 'rm -f "$output"' EXIT
code=0
bash scripts/vm.sh "${machine[@]}" --timeout 900 --share "$(dirname "$program")" -- "$program" --gtest_filter="$filter" 2>&1 |
  tee "$output" || code=${PIPESTATUS[0]}
[[ $code == 0 ]] || exit "$code"
# Skipped throughout would be no proof: here the kernel has all it takes.
grep -Eq '^\[  PASSED  \] [1-9][0-9]* test' "$output" || { echo "netem_conformance: no test ran through" >&2; exit 1; }
