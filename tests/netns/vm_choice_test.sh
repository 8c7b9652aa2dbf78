#!/usr/bin/env bash
# Which machine scripts/vm.sh takes where it is told none: the next one where user-mode Linux does not start, and none,
# with exit code 77 and the reasons, where nothing starts. The machines here are scripts that start or die as they are
# told, so the test needs no network and takes a second.
#
#   tests/netns/vm_choice_test.sh
#
# Exit codes: 0 it chooses as it should, 1 it does not, 77 there is no folder in memory for user-mode Linux.
set -euo pipefail
root=$(dirname "$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")")
cd "$root"

fail() { printf 'vm_choice_test: %s\n' "$*" >&2; cat "$work/err" >&2; exit 1; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export XDG_CACHE_HOME="$work/cache" PATH="$work/bin:$PATH"
store="$XDG_CACHE_HOME/interneuron-vm/1"
mkdir -p "$work/bin" "$store"/{busybox/bin,uml/usr/bin,uml/lib/modules,qemu/lib/modules}
touch "$store/busybox/bin/busybox" "$store/qemu/vmlinuz" "$store/qemu/initrd"

# program FILE BODY: a script instead of a virtual machine.
program() {
  printf '#!/bin/bash\n%s\n' "$2" >"$1"
  chmod 755 "$1"
}
# `runs` does what the first process of a machine does at its end: stores the command's exit code beside itself.
# shellcheck disable=SC2016  # expanded by the scripts that are written here
runs='guest=$(grep -o "[^\" ]*interneuron-vm[.][^/\"]*/guest" <<<"$*" | head -n 1); touch "${guest%/*}/started"; echo 0 >"${guest%/*}/code"'
dies='echo "put_fp_registers failed"; kill -SEGV $$'

# take CODE: runs vm.sh without naming a machine; its exit code must be CODE.
take() {
  local code=0
  bash scripts/vm.sh --timeout 20 -- true >"$work/out" 2>"$work/err" || code=$?
  [[ $code == "$1" ]] || fail "exit code $code instead of $1"
}
says() { grep -qE -- "$1" "$work/err" || fail "did not say: $1"; }

program "$store/uml/usr/bin/linux.uml" "$runs"
program "$work/bin/qemu-system-x86_64" "$dies"
code=0
bash scripts/vm.sh --uml -- true || code=$?
[[ $code != 77 ]] || exit 77
take 0
says '^vm: taking --uml, because it starts here$'
rm "$XDG_CACHE_HOME"/interneuron-vm/starts-*

program "$store/uml/usr/bin/linux.uml" "$dies"
take 77
says '^vm: no machine starts here: --uml does not .*; --icount does not .*; --tcg does not '
grep -q 'put_fp_registers failed' "$XDG_CACHE_HOME"/interneuron-vm/starts-uml-* || fail "its last words were not kept"

# What did not start is not tried again while its verdict is kept.
program "$store/uml/usr/bin/linux.uml" "$runs"
take 77
rm "$XDG_CACHE_HOME"/interneuron-vm/starts-*
program "$store/uml/usr/bin/linux.uml" "$dies"

# shellcheck disable=SC2016
program "$work/bin/qemu-system-x86_64" "if [[ \" \$* \" == *' -icount '* ]]; then $runs; else $dies; fi"
take 0
says '^vm: taking --icount, because --uml does not start on this computer'
rm "$XDG_CACHE_HOME"/interneuron-vm/starts-*

program "$work/bin/qemu-system-x86_64" "if [[ \" \$* \" == *' -icount '* ]]; then $dies; else $runs; fi"
take 0
says '^vm: taking --tcg, because --uml does not .*; --icount does not '
rm "$XDG_CACHE_HOME"/interneuron-vm/starts-*

# What kept us from trying says nothing of the machine, and is no verdict.
TMPDIR="$work/none" take 77
says 'cannot make a folder in .*/none'
if compgen -G "$XDG_CACHE_HOME/interneuron-vm/starts-*" >/dev/null; then fail "a verdict was kept of a machine that was not tried"; fi
