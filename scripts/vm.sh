#!/usr/bin/env bash
# Runs a command as root in a small virtual machine whose kernel has netem, for hosts whose kernel lacks it. The machine
# sees this computer's files: the working tree can be written, the rest only read. Output and exit code come back.
#
#   scripts/vm.sh [--uml|--icount|--kvm|--tcg] [OPTIONS] [--] COMMAND [ARGS...]
#
#   --uml            user-mode Linux: real time, boots in 3 to 5 s; NAT by iptables-legacy only, no nftables for IP, no MPTCP
#   --icount         QEMU in virtual time: exact timing on a busy computer too, idle time takes none; for timing, not
#                    for throughput (one slow processor); boots in 10 to 15 s
#   --kvm            QEMU on this processor; needs KVM
#   --tcg            QEMU, emulated, in real time; boots in 8 s
#                    without any of these: the first of --uml, --icount, --tcg that starts on this computer. Each is
#                    tried once by starting it (a few seconds); one line on stderr says which it became, and why
#   --timeout S      seconds on this computer's clock, boot included; default 600, 0 for no end
#   --memory MB      default 1024
#   --env VAR[=X]    pass an environment variable; repeatable. The others stay behind.
#   --share DIR      another folder to write to, under the same path; repeatable
#   --quiet          no word on fetching a kernel and on the machine taken
#
# Inside: the current folder is the same, /tmp, /run and $HOME are empty and vanish, standard input is empty, `lo` is up,
# $INTERNEURON_VM names the kind of machine, and no network leads out. What the command leaves running ends with it.
# Needs no root and installs nothing: kernels come from Debian packages, downloaded and unpacked into
# ${XDG_CACHE_HOME:-~/.cache}/interneuron-vm. All but --uml need qemu-system-x86 (scripts/setup.sh --with-vm).
#
# Exit codes: those of the command, but: 77 not possible on this computer (no kernel to be had, no QEMU, no KVM, nothing
# that starts), 124 out of time, 125 usage, or the machine failed; 130 and 143 interrupted.
# shellcheck disable=SC2317  # shellcheck does not see the calls by way of `trap` and obtain
set -euo pipefail
root=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")

fail() { printf 'vm: %s\n' "$2" >&2; exit "$1"; }
say() { $quiet || printf 'vm: %s\n' "$*" >&2; }
usage() { fail 125 "$1; see scripts/vm.sh --help"; }

kind='' timeout=600 memory=1024 quiet=false
environment=() shares=("$root")
while (($# > 0)); do
  case $1 in
    --uml | --icount | --kvm | --tcg) kind=${1#--} ;;
    --timeout | --memory | --env | --share)
      (($# > 1)) || usage "$1 needs a value"
      set -- "$1=$2" "${@:3}"
      continue
      ;;
    --timeout=* | --memory=*)
      [[ ${1#*=} =~ ^[0-9]{1,7}$ ]] || usage "${1%%=*} takes a whole number, not '${1#*=}'"
      if [[ $1 == --timeout=* ]]; then timeout=$((10#${1#*=})); else memory=$((10#${1#*=})); fi
      ;;
    --env=*)
      variable=${1#--env=}
      name=${variable%%=*}
      [[ $name =~ ^[A-Za-z_][A-Za-z_0-9]*$ ]] || usage "--env takes VAR or VAR=VALUE, not '$variable'"
      if [[ $variable == *=* ]]; then environment+=("$variable"); elif [[ -v $name ]]; then environment+=("$name=${!name}"); fi
      ;;
    --share=*)
      [[ -d ${1#--share=} ]] || usage "--share: no folder ${1#--share=}"
      shares+=("$(readlink -f "${1#--share=}")")
      ;;
    --quiet) quiet=true ;;
    -h | --help) sed -n '2,/^set /{/^set /d;/^# shellcheck /d;s/^# \{0,1\}//;p}' "${BASH_SOURCE[0]}"; exit 0 ;;
    --) shift; break ;;
    -*) usage "unknown option '$1'" ;;
    *) break ;;
  esac
  shift
done
(($# > 0)) || usage "no command given"
((memory >= 64)) || usage "--memory: $memory MB is too little; 64 at least"
command=("$@")

has_kvm() { [[ -w /dev/kvm && (-d /sys/module/kvm_intel || -d /sys/module/kvm_amd) ]]; }
qemu=$(command -v qemu-system-x86_64 || true)
[[ $(uname -sm) == "Linux x86_64" ]] || fail 77 "the machines are for Linux on x86-64, not for $(uname -sm)"

# Kernels, one folder each. The number changes with the layout.
cache="${XDG_CACHE_HOME:-${HOME:-/tmp}/.cache}/interneuron-vm"
store="$cache/1"
{ mkdir -p "$store" && [[ -w $store ]]; } 2>/dev/null || fail 125 "cannot write to $cache; set XDG_CACHE_HOME to another folder"
store=$(readlink -f "$store")

# How the message of a machine that died itself ends.
died="its last words are above"

# starts KIND: whether such a machine runs a command here, found out by trying. User-mode Linux, for one, dies at once on
# processors with AMX, whose floating-point state is larger than it can restore. A verdict is kept for as long as kernel
# and processor stay the same. It is one of the machine: where that could not be tried (77), or was killed or ran out of time
# (124), it is tried again next time. Leaves in $reason why not.
starts() {
  local verdict code=0 said
  verdict="$cache/starts-$1-$({ uname -r; grep -m 2 -E '^(model name|flags)' /proc/cpuinfo || true; } | cksum | tr ' ' -)"
  if [[ ! -s $verdict ]]; then
    said=$(bash "${BASH_SOURCE[0]}" "--$1" --quiet --timeout 180 -- true 2>&1 </dev/null) || code=$?
    case $code:$said in
      0:*) echo yes >"$verdict" ;;
      125:*"$died"*) printf '%s\n' no "$said" >"$verdict" ;;
      *)
        said=${said##*$'\n'}
        reason="--$1: ${said#vm: }"
        return 1
        ;;
    esac
  fi
  reason="--$1 does not start on this computer (its last words: $verdict)"
  [[ $(head -n 1 "$verdict") == yes ]]
}

if [[ -z $kind ]]; then
  reasons=''
  for candidate in uml icount tcg; do
    if starts "$candidate"; then kind=$candidate; break; fi
    reasons+="${reasons:+; }$reason"
  done
  [[ -n $kind ]] || fail 77 "no machine starts here: $reasons"
  say "taking --$kind, because ${reasons:-it starts here}"
fi
if [[ $kind != uml ]]; then
  [[ -n $qemu ]] || fail 77 "--$kind needs qemu-system-x86_64; install it: scripts/setup.sh --with-vm"
  [[ $kind != kvm ]] || has_kvm || fail 77 "--kvm: this computer has no KVM that you may use; take --uml or --icount"
fi

# A folder of this run's own, locked while it lasts; those of runs that were killed have lost their lock.
find "${TMPDIR:-/tmp}" -maxdepth 1 -type d -name 'interneuron-vm.*' -user "$EUID" -mmin +1 \
  -exec flock -n {} rm -rf {} \; 2>/dev/null || true
work=$(mktemp -d "${TMPDIR:-/tmp}/interneuron-vm.XXXXXX") || fail 125 "cannot make a folder in ${TMPDIR:-/tmp}"
work=$(readlink -f "$work")
exec {held}<"$work"
flock "$held"
machine='' pumps=()
clean_up() {
  trap '' INT TERM HUP
  [[ -z $machine ]] || kill "$machine" 2>/dev/null || true
  ((${#pumps[@]} == 0)) || kill "${pumps[@]}" 2>/dev/null || true
  wait 2>/dev/null || true
  rm -rf "$work"
}
trap clean_up EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
trap 'exit 129' HUP
for path in "$work" "$PWD" "$store" "${shares[@]}"; do
  [[ $path != *[,\"]* && $path != *$'\n'* ]] || fail 125 "a folder's name may hold no comma, quote or newline here: $path"
done

# download PACKAGE: its newest version, into $fresh; the reason for a failure lands in $reason.
download() {
  local options=(-q -o Acquire::Retries=2) private=()
  ((EUID != 0)) || options+=(-o APT::Sandbox::User=root)
  if ! command -v apt-get >/dev/null || ! command -v dpkg-deb >/dev/null; then
    reason="this system has no apt-get"
    return 1
  fi
  say "fetching the package $1"
  if ! reason=$(cd "$fresh" && LC_ALL=C apt-get "${options[@]}" download "$1" 2>&1); then
    # Without package lists, or with old ones: fetch lists of its own, which anyone may.
    private=(-o "Dir::State::Lists=$fresh/lists" -o "Dir::Cache=$fresh/apt")
    mkdir -p "$fresh"/{lists,apt/archives}/partial
    if ! reason=$(cd "$fresh" && LC_ALL=C apt-get "${options[@]}" "${private[@]}" update 2>&1 &&
      LC_ALL=C apt-get "${options[@]}" "${private[@]}" download "$1" 2>&1); then
      reason="apt-get download $1: $(grep '^E:' <<<"$reason" | head -n 1 || true)"
      return 1
    fi
  fi
}

# unpack PACKAGE FOLDER
unpack() {
  local packages=("$fresh/$1"_*.deb)
  dpkg-deb -x "${packages[0]}" "$fresh/$2" && rm -f "${packages[@]}"
}

# keep_modules VERSION_FOLDER: only what networks need, a tenth of all; and their dependencies.
keep_modules() {
  local version=${1##*/} kernel=$1/kernel
  find "$kernel" -mindepth 1 -maxdepth 1 ! -name net ! -name lib ! -name crypto ! -name arch ! -name fs ! -name drivers \
    -exec rm -rf {} +
  find "$kernel/fs" -mindepth 1 -maxdepth 1 ! -name 9p ! -name netfs ! -name fscache ! -name overlayfs -exec rm -rf {} +
  find "$kernel/drivers" -mindepth 1 -maxdepth 1 ! -name net ! -name virtio -exec rm -rf {} +
  find "$kernel/drivers/net" -mindepth 1 -maxdepth 1 -type d ! -name ipvlan ! -name bonding ! -name vxlan \
    ! -name wireguard -exec rm -rf {} +
  find "$1" -mindepth 1 -maxdepth 1 -name 'modules.*' ! -name 'modules.builtin*' ! -name modules.order -delete
  "$store/busybox/bin/busybox" depmod -b "${1%/lib/modules/*}" "$version"
}

make_busybox() {
  download busybox-static && unpack busybox-static tree
}

make_uml() {
  local version
  download user-mode-linux && unpack user-mode-linux tree || return 1
  mkdir -p "$fresh/tree/lib" && mv "$fresh/tree/usr/lib/uml/modules" "$fresh/tree/lib/modules"
  version=("$fresh"/tree/lib/modules/*)
  keep_modules "${version[0]}"
}

make_qemu() {
  local package version base ram="$fresh/ram" busybox="$store/busybox/bin/busybox"
  package=$(LC_ALL=C apt-cache depends linux-image-amd64 2>/dev/null |
    sed -n 's/.*Depends: \(linux-image-[^ ]*\)$/\1/p' | head -n 1)
  if [[ -z $package ]]; then
    download linux-image-amd64 || return 1
    package=$(dpkg-deb -f "$fresh"/linux-image-amd64_*.deb Depends | sed 's/ .*//')
  fi
  download "$package" && unpack "$package" tree || return 1
  version=("$fresh"/tree/lib/modules/*)
  keep_modules "${version[0]}"
  mv "$fresh"/tree/boot/vmlinuz-* "$fresh/tree/vmlinuz" && rm -rf "$fresh/tree/boot" "$fresh/tree/usr"
  # A first file system in memory, with what it takes to mount this computer's.
  base=lib/modules/${version[0]##*/}
  mkdir -p "$ram"/{bin,proc,sys,dev,root,"$base"}
  cp "$busybox" "$ram/bin/"
  (cd "$fresh/tree/$base" &&
    cp -r --parents modules.dep kernel/drivers/virtio kernel/net/9p kernel/fs/{9p,netfs,fscache} "$ram/$base")
  cat >"$ram/init" <<'INIT'
#!/bin/busybox sh
b=/bin/busybox
$b mount -t proc proc /proc; $b mount -t sysfs sys /sys; $b mount -t devtmpfs dev /dev
$b modprobe virtio_pci; $b modprobe 9pnet_virtio; $b modprobe 9p
$b mount -t 9p -o trans=virtio,version=9p2000.L,msize=512000,cache=loose,ro vmroot /root || $b poweroff -f
for d in proc sys dev; do $b mount -o move /$d /root/$d; done
exec $b switch_root /root /bin/bash "$vmguest"
INIT
  chmod 755 "$ram/init"
  (cd "$ram" && find . | "$busybox" cpio -o -H newc 2>/dev/null | gzip -1) >"$fresh/tree/initrd"
}

# obtain NAME: a part of the store, made whole or not at all, by one process at a time.
obtain() {
  [[ -d $store/$1 ]] && return
  exec {lock}>"$cache/lock"
  flock "$lock"
  if [[ ! -d $store/$1 ]]; then
    rm -rf "$cache"/fresh.*
    fresh=$(mktemp -d "$cache/fresh.XXXXXX")
    reason="unpacking failed"
    if ! "make_$1"; then
      rm -rf "$fresh"
      fail 77 "no kernel: ${reason##*$'\n'}; once a package server can be reached, run this again"
    fi
    mv "$fresh/tree" "$store/$1"
    rm -rf "$fresh"
  fi
  exec {lock}>&-
}
if [[ $kind == uml ]]; then kernel="$store/uml"; else kernel="$store/qemu"; fi
obtain busybox
obtain "${kernel##*/}"

# A folder in memory for the memory of user-mode Linux, which maps it executable.
memory_folder() {
  local folder type options available
  for folder in "${TMPDIR:-/dev/shm}" /dev/shm /tmp /run/user/$EUID; do
    read -r type available options < <(findmnt -nbo FSTYPE,AVAIL,OPTIONS -T "$folder" 2>/dev/null) || continue
    [[ $type == tmpfs && ,$options, != *,noexec,* && -w $folder ]] || continue
    ((available >= memory * 1048576)) && echo "$folder" && return
  done
  return 1
}

# What the guest needs to know.
cp "$root/scripts/vm_guest.sh" "$work/guest"
chmod 755 "$work/guest"
shares=("$work" "${shares[@]}")
merged=false
[[ ! /dev/fd/1 -ef /dev/fd/2 ]] || merged=true
{
  printf '%s=%q\n' kind "$kind" modules "$kernel/lib/modules" busybox "$store/busybox/bin/busybox" folder "$PWD" \
    merged "$merged"
  printf 'buffers=%q\n' "$(cat /proc/sys/net/core/rmem_max 2>/dev/null || echo 0)"
  printf 'shares=('; printf ' %q' "${shares[@]}"; printf ' )\n'
  printf 'command=('; printf ' %q' "${command[@]}"; printf ' )\n'
  printf 'environment=('; ((${#environment[@]} == 0)) || printf ' %q' "${environment[@]}"; printf ' )\n'
} >"$work/settings"
: >"$work/out"
: >"$work/err"

if [[ $kind == uml ]]; then
  TMPDIR=$(memory_folder) || fail 77 "no folder in memory has $memory MB free and may hold programs; mount a tmpfs, \
name it in TMPDIR (docker run --tmpfs /dev/shm:exec,size=2g), or take --icount"
  export TMPDIR
  run=("$kernel/usr/bin/linux.uml" "mem=${memory}M" rootfstype=hostfs root=/dev/root ro "hostfs=/" "init=\"$work/guest\""
    con=null "con0=fd:0,fd:1" ssl=null quiet loglevel=3 "uml_dir=$work" umid=vm)
else
  run=("$qemu" -m "$memory" -nodefaults -no-user-config -display none -serial stdio -no-reboot
    -kernel "$kernel/vmlinuz" -initrd "$kernel/initrd"
    -append "console=ttyS0 quiet loglevel=3 panic=-1 mitigations=off tsc=reliable no_timer_check vmguest=\"$work/guest\""
    -fsdev "local,id=vmroot,path=/,security_model=none,readonly=on,multidevs=remap"
    -device "virtio-9p-pci,fsdev=vmroot,mount_tag=vmroot")
  for i in "${!shares[@]}"; do
    run+=(-fsdev "local,id=vm$i,path=${shares[i]},security_model=none,multidevs=remap"
      -device "virtio-9p-pci,fsdev=vm$i,mount_tag=vm$i")
  done
  case $kind in
    kvm) run+=(-M "q35,accel=kvm" -cpu host -smp 2) ;;
    tcg) run+=(-M q35 -cpu max -smp 1 -accel tcg) ;;
    icount) run+=(-M q35 -cpu max -smp 1 -accel "tcg,thread=single" -icount "shift=1,sleep=off"
      -rtc "base=2024-01-01,clock=vm") ;;
  esac
fi

# `timeout` ends the machine when it is itself ended, and both end with this script whatever ends that. Told to stop,
# not killed, user-mode Linux takes its helpers along.
setpriv --pdeathsig TERM timeout --kill-after=3 "$timeout" setpriv --pdeathsig TERM "${run[@]}" \
  </dev/null >"$work/console" 2>&1 &
machine=$!
tail -f -c +1 -s 0.1 --pid="$machine" "$work/out" 2>/dev/null &
pumps=($!)
if ! $merged; then
  tail -f -c +1 -s 0.1 --pid="$machine" "$work/err" >&2 2>/dev/null &
  pumps+=($!)
fi
wait -n "$machine" "${pumps[@]}" 2>/dev/null || true
if [[ ! -s $work/code ]] && kill -0 "$machine" 2>/dev/null; then exit 141; fi  # nobody reads the output any more
ended=0
wait "$machine" 2>/dev/null || ended=$?
machine=''
wait "${pumps[@]}" 2>/dev/null || true
pumps=()

if [[ -s $work/code ]]; then exit "$(<"$work/code")"; fi
if ((ended == 124 || ended == 137)); then fail 124 "out of time after $timeout s; see --timeout"; fi
tail -n 15 "$work/console" | sed 's/\r$//' >&2
if [[ -e $work/started ]]; then fail 125 "the machine stopped before the command ended; $died"; fi
fail 125 "the machine did not start; $died"
