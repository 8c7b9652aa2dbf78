#!/usr/bin/env bash
# Whether scripts/vm.sh does what it says, and its kernel what the testbed needs: netem on a veth pair between two
# namespaces delays a ping by what it was told.
#
#   tests/netns/vm_test.sh [--uml|--icount|--kvm|--tcg]     (without: the machine that vm.sh takes by itself)
#
# Exit codes: 0 it does, 1 it does not, 77 no machine can be had here.
set -euo pipefail
root=$(dirname "$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")")
cd "$root"

fail() { printf 'vm_test: %s\n' "$*" >&2; exit 1; }
near() { awk -v x="$1" -v low="$2" -v high="$3" 'BEGIN { exit !(x != "" && x >= low && x <= high) }'; }

inside() {
  local times
  echo "on stdout"
  echo "on stderr" >&2
  [[ -z ${HIDDEN-} && $SEEN == "a b;c" ]] || fail "environment: HIDDEN='${HIDDEN-}' SEEN='${SEEN-}'"
  touch /usr/vm_test 2>/dev/null && fail "could write to /usr"
  ip netns add vehicle
  ip netns add road
  ip link add nic0 netns vehicle type veth peer name nic1 netns road
  ip -n vehicle address add 10.9.0.2/24 dev nic0
  ip -n road address add 10.9.0.1/24 dev nic1
  ip -n vehicle link set dev nic0 up
  ip -n road link set dev nic1 up
  ip netns exec vehicle ping -q -c 1 -W 5 10.9.0.1 >/dev/null || fail "no ping without netem"
  ip netns exec vehicle tc qdisc add dev nic0 root netem delay 50ms
  # User-mode Linux has real time, which a busy computer takes from it for a while.
  for _ in 1 2 3 4 5; do
    times=$(ip netns exec vehicle ping -c 20 -i 0.1 -W 5 10.9.0.1 | sed -n 's/.*time=\([0-9.]*\) ms/\1/p' | sort -n)
    [[ $(wc -l <<<"$times") == 20 ]] || fail "of 20 pings under netem came back: $(wc -l <<<"$times")"
    if near "$(sed -n 1p <<<"$times")" 50 52 && near "$(sed -n 10p <<<"$times")" 50 60; then break; fi
  done
  near "$(sed -n 1p <<<"$times")" 50 52 || fail "shortest ping under 50 ms of netem: $(sed -n 1p <<<"$times") ms"
  near "$(sed -n 10p <<<"$times")" 50 60 || fail "median ping under 50 ms of netem: $(sed -n 10p <<<"$times") ms"
  echo "median $(sed -n 10p <<<"$times") ms"
  sleep 1000 &
  exit 3
}

if [[ ${1-} == --inside ]]; then inside; fi
machine=("$@")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export SEEN="a b;c" HIDDEN=x
code=0
bash scripts/vm.sh "${machine[@]}" --timeout 120 --env SEEN -- bash tests/netns/vm_test.sh --inside \
  >"$work/out" 2>"$work/err" || code=$?
if [[ $code == 77 ]]; then
  cat "$work/err" >&2
  exit 77
fi
sed 's/^/  /' "$work/out" "$work/err"
[[ $code == 3 ]] || fail "exit code $code instead of 3"
[[ $(head -n 1 "$work/out") == "on stdout" ]] || fail "stdout is not the command's"
[[ $(grep -v '^vm: ' "$work/err") == "on stderr" ]] || fail "stderr is not the command's"
((${#machine[@]} > 0)) || grep -q '^vm: taking --' "$work/err" || fail "did not say which machine it took"
