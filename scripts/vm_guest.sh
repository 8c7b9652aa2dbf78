#!/bin/bash
# First process of a machine of scripts/vm.sh, which starts it with a file `settings` beside it: mounts what can be written,
# loads modules, runs the command, stores its output and exit code beside itself, and switches the machine off.
set -uo pipefail
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
kind='' modules='' busybox='' folder='' merged='' buffers=0
shares=() command=() environment=()
# shellcheck source=/dev/null
. "${BASH_SOURCE[0]%/*}/settings"

warn() { printf 'vm: %s\n' "$*" >>/run/vm/0/err; }

# The host's own /proc and /sys show through the root of user-mode Linux.
if [[ $kind == uml ]]; then
  mount -t proc proc /proc
  mount -t sysfs sys /sys
  grep -q ' /dev devtmpfs' /proc/mounts || mount -t devtmpfs dev /dev
fi
mount -t tmpfs -o mode=755 tmpfs /run
mkdir -p /run/vm/{home,modules/{lib/modules,proc,bin}} /run/{netns,lock}

for i in "${!shares[@]}"; do
  mkdir "/run/vm/$i"
  if [[ $kind == uml ]]; then
    mount -t hostfs -o "${shares[i]}" none "/run/vm/$i"
  else
    mount -t 9p -o trans=virtio,version=9p2000.L,msize=512000,cache=mmap "vm$i" "/run/vm/$i"
  fi || warn "cannot mount ${shares[i]}"
done
out=/run/vm/0

# Modules, also those that the kernel asks for later.
mount --bind "$modules" /run/vm/modules/lib/modules
mount --bind /proc /run/vm/modules/proc
cp "$busybox" /run/vm/modules/bin/busybox
busybox=/run/vm/modules/bin/busybox
# shellcheck disable=SC2016  # to be expanded by what is written here
printf '#!/bin/sh\nexec %s chroot /run/vm/modules /bin/busybox modprobe -q "$@"\n' "$busybox" >/run/vm/modprobe
chmod 755 /run/vm/modprobe
echo /run/vm/modprobe >/proc/sys/kernel/modprobe
for module in ipv6 veth tun vrf bridge 8021q sch_netem sch_tbf sch_htb sch_prio sch_fq sch_fq_codel sch_ingress \
  cls_u32 cls_matchall act_mirred nf_tables nft_chain_nat nft_nat nft_masq nft_ct nf_conntrack nf_nat iptable_nat \
  ip6table_nat xt_MASQUERADE; do
  echo "$module"
done | xargs "$busybox" chroot /run/vm/modules /bin/busybox modprobe -q -a 2>/dev/null
/run/vm/modprobe ifb numifbs=0
/run/vm/modprobe dummy numdummies=0

mkdir -p /dev/shm /dev/pts /dev/net
for place in /tmp /var/tmp /dev/shm; do mount -t tmpfs -o mode=1777 tmpfs "$place"; done
mount -t devpts devpts /dev/pts
[[ -c /dev/net/tun ]] || mknod -m 666 /dev/net/tun c 10 200
[[ -e /dev/fd ]] || ln -s /proc/self/fd /dev/fd
mountpoint -q /sys/fs/cgroup || mount -t cgroup2 none /sys/fs/cgroup
for i in "${!shares[@]}"; do
  mkdir -p "${shares[i]}" 2>/dev/null
  mount --bind "/run/vm/$i" "${shares[i]}" || warn "cannot mount ${shares[i]} in its place"
done

ip link set lo up
hostname interneuron-vm
ulimit -Hn 65536 && ulimit -Sn 65536
for limit in rmem_max wmem_max; do
  (("$(<"/proc/sys/net/core/$limit")" >= buffers)) || echo "$buffers" >"/proc/sys/net/core/$limit"
done
# A guest that the host makes wait sends what has piled up meanwhile in one burst; the usual 1,000 packets between two NICs
# would be loss that no test asked for.
echo 20000 >/proc/sys/net/core/netdev_max_backlog
# Output written to files of the host shows there soon.
echo 10 >/proc/sys/vm/dirty_writeback_centisecs
echo 10 >/proc/sys/vm/dirty_expire_centisecs

mkfifo /run/vm/out /run/vm/err
cat /run/vm/out >>"$out/out" &
pumps=($!)
if ! $merged; then
  cat /run/vm/err >>"$out/err" &
  pumps+=($!)
fi
: >"$out/started"
(
  exec </dev/null >/run/vm/out
  if $merged; then exec 2>&1; else exec 2>/run/vm/err; fi
  cd "$folder" || exit 125
  exec env -i PATH="$PATH" HOME=/run/vm/home LANG=C.UTF-8 TERM=dumb INTERNEURON_VM="$kind" "${environment[@]}" "${command[@]}"
)
code=$?

# End what the command left running, or its output would never end; kernel threads have no program.
for process in /proc/[0-9]*; do
  id=${process#/proc/}
  [[ $id != 1 && " ${pumps[*]} " != *" $id "* && -e $process/exe ]] && kill -KILL "$id" 2>/dev/null
done
wait "${pumps[@]}"
sync
echo "$code" >"$out/code.new"
mv "$out/code.new" "$out/code"
sync
"$busybox" poweroff -f
sleep 10
