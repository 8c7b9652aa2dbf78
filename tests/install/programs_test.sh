#!/usr/bin/env bash
# The program `interneuron` has nothing of the laboratory or of OpenCV in it: no object of src/lab, netns or bench among what it
# is linked from, and no OpenCV among its libraries.
#
#   programs_test.sh BUILD PROGRAM
#
# Exit codes: 0 it is so, 1 it is not, 77 the build is none of Ninja's.
set -euo pipefail
build=$1 program=$2
[[ -e $build/build.ninja ]] || { echo "needs a build of Ninja"; exit 77; }

inputs=$(ninja -C "$build" -t inputs "$(basename "$program")" | grep -E '\.(o|a|so)$' || true)
[[ $inputs == *src/app/cli/* ]] || { echo "the objects of $program are not told"; exit 1; }
if grep -E '(^|/)(src/lab|netns|bench)/' <<<"$inputs"; then
  echo "$program is linked from the objects above, which are the laboratory's"
  exit 1
fi
if ldd "$program" | grep -i opencv; then
  echo "$program needs the libraries above"
  exit 1
fi
