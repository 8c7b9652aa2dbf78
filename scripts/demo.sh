#!/usr/bin/env bash
# Installs what is missing, builds the program and runs the demo: a vehicle and a roadside unit on this machine, joined by
# two emulated modems, carrying real camera frames. Arguments go to `interneuron demo`.
#
#   scripts/demo.sh [--rounds N] [--seed S] [--out DIR] [--json] ...
#
# Results go to out/demo unless --out says otherwise. Stdout is the program's alone; set-up and build talk on stderr.
# Exit codes: those of the program; 5 also when packages are missing and this is not root.
set -euo pipefail
root=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
program="$root/build/release/interneuron"

out=("--out" "$root/out/demo")
[[ $PWD -ef $root ]] && out=("--out" "out/demo")
for argument in "$@"; do
  case $argument in
    --out | --out=*) out=() ;;
    -h | --help)
      sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "${BASH_SOURCE[0]}"
      if [[ -x $program ]]; then exec "$program" demo --help; fi
      exit 0
      ;;
  esac
done
if [[ -n ${INTERNEURON_DATA:-} && ! -d $INTERNEURON_DATA ]]; then
  printf 'demo: INTERNEURON_DATA names %s, which is no folder; correct or unset it\n' "$INTERNEURON_DATA" >&2
  exit 3
fi

if [[ -e $root/build && ! -w $root/build ]]; then
  printf '%s: cannot write to %s/build, which belongs to %s; remove it or run as that user\n' demo "$root" "$(stat -c %U "$root/build")" >&2
  exit 1
fi
trap 'exit 130' INT

# shellcheck source=scripts/caches.sh
. "$root/scripts/caches.sh"

exec 3>&1 1>&2
bash "$root/scripts/setup.sh"
(
  cd "$root" && cmake --preset release --log-level=WARNING &&
    cmake --build build/release --parallel "$(nproc)" --target interneuron interneuron-offload interneuron-lab libinterneuron.a
) || { echo "demo: the build failed; its message is above" >&2; exit 1; }

if [[ -z ${INTERNEURON_DATA:-} ]]; then
  if [[ -d $root/../shared/data ]]; then
    INTERNEURON_DATA=$(readlink -f "$root/../shared/data")
  else
    INTERNEURON_DATA="$root/build/data"
    bash "$root/scripts/fetch_data.sh" --dest "$INTERNEURON_DATA" ||
      echo "demo: going on with the data that is there; without models the motion ladder runs" >&2
  fi
fi
export INTERNEURON_DATA

exec "$program" demo "${out[@]}" "$@" 1>&3 3>&-
