# Sourced by the scripts that .ci/run calls: says where the time goes.
#
#   phase NAME COMMAND [ARGS...]   runs the command; where $INTERNEURON_PHASES names a file, appends a line with the
#                                  seconds that went by, the processor's seconds, and NAME
# shellcheck shell=bash

phase() {
  local name=$1 code=0 times TIMEFORMAT='%R %U %S'
  shift
  if [[ -z ${INTERNEURON_PHASES-} ]]; then
    "$@"
    return
  fi
  exec {said}>&1 {complained}>&2
  # What `time` says goes to $times, what the command says where it went before.
  times=$({ time "$@" 1>&"$said" 2>&"$complained"; } 2>&1) || code=$?
  exec {said}>&- {complained}>&-
  awk -v name="$name" '{ printf "%.0f\t%.0f\t%s\n", $1, $2 + $3, name }' <<<"$times" >>"$INTERNEURON_PHASES"
  return "$code"
}
