#!/usr/bin/env bash
# Installs the Debian packages that a build, the tests and the demo need. Names what is missing; installs it as root,
# else prints the line to run. Never removes a package and never calls sudo.
#
#   scripts/setup.sh [--dry-run] [--with-checks] [--with-vm] [--with-peers]
#
#   --dry-run       say what would be done, change nothing
#   --with-checks   also what scripts/check.sh needs
#   --with-vm       also QEMU, which scripts/vm.sh takes where user-mode Linux does not start (scripts/test.sh asks for it)
#   --with-peers    also Fast DDS, which `interneuron bench peers` compares with (SRT: scripts/build_srt.sh)
#
# Exit codes: 0 everything is there, 1 failed, 2 usage, 5 needs root.
set -euo pipefail

packages=(
  g++ cmake ninja-build ccache pkg-config python3                    # to build
  libboost1.81-dev libnl-3-dev libnl-route-3-dev libpcap-dev libxdp-dev libbpf-dev libisal-dev libsodium-dev libnftables-dev zlib1g-dev libjpeg62-turbo-dev libncurses-dev  # libraries
  libopencv-dev libeigen3-dev libcli11-dev libspdlog-dev libtomlplusplus-dev nlohmann-json3-dev
  libgtest-dev libgmock-dev librapidcheck-dev libbenchmark-dev       # tests and benchmarks
  golang-github-flynn-noise-dev python3-dissononce                   # published vectors and another implementation of Noise
  iproute2 iputils-ping gnuplot-nox                                  # testbed and plots
  iperf3 tcpdump fping                                               # testbed verify, tests of the measurements
  python3-cryptography                                               # attacks on sealed packets
  tshark                                                             # test of the Wireshark dissector
  curl ca-certificates                                               # scripts/fetch_data.sh
)
check_packages=(git clang libclang-rt-14-dev clang-format-14 shellcheck universal-ctags)  # scripts/check.sh
vm_packages=(qemu-system-x86)                                        # scripts/vm.sh --icount, --tcg, --kvm
peer_packages=(libfastrtps-dev dpkg-dev)                             # bench peers, scripts/build_srt.sh

say() { printf 'setup: %s\n' "$*"; }
fail() { printf 'setup: %s\n' "$2" >&2; exit "$1"; }

dry_run=false
for argument in "$@"; do
  case $argument in
    --dry-run) dry_run=true ;;
    --with-checks) packages+=("${check_packages[@]}") ;;
    --with-vm) packages+=("${vm_packages[@]}") ;;
    --with-peers) packages+=("${peer_packages[@]}") ;;
    -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "${BASH_SOURCE[0]}"; exit 0 ;;
    *) fail 2 "unknown argument '$argument'; see scripts/setup.sh --help" ;;
  esac
done

if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
  fail 1 "this system has no apt-get. Install by hand: g++ >= 12, CMake >= 3.25, Ninja, Python 3, Boost >= 1.81 (headers), \
libnl-3 and libnl-route-3 >= 3.7, libpcap >= 1.10, libxdp >= 1.2, libbpf >= 1.0, ISA-L >= 2.30, libsodium, libnftables, ncurses, OpenCV >= 4.6, Eigen >= 3.4, CLI11 >= 2.1, spdlog, toml++ >= 3.3, nlohmann-json, zlib, libjpeg-turbo >= 2.1, GoogleTest with \
gMock, rapidcheck, Google Benchmark, iproute2, ping, fping, iperf3, tcpdump, tshark, gnuplot, curl. Then: cmake --preset release && cmake --build --preset release"
fi

# Any Boost from 1.81 on will do; newer distributions have it under another name.
boost_is_there() {
  local version
  version=$(sed -n 's/^#define BOOST_VERSION \([0-9]*\).*/\1/p' /usr/include/boost/version.hpp 2>/dev/null) || return 1
  [[ -n $version ]] && ((version >= 108100))
}

find_missing() {
  local installed package
  installed=$(dpkg-query -W -f '${db:Status-Abbrev} ${Package}\n' "${packages[@]}" 2>/dev/null |
    sed -n 's/^.i *//p' || true)
  missing=()
  for package in "${packages[@]}"; do
    [[ $'\n'$installed$'\n' == *$'\n'$package$'\n'* ]] && continue
    [[ $package == libboost1.81-dev ]] && boost_is_there && continue
    missing+=("$package")
  done
}

find_missing
if ((${#missing[@]} == 0)); then
  say "all ${#packages[@]} packages are there"
  exit 0
fi
say "missing: ${missing[*]}"

# What apt would do, as anyone may ask; with the lists refreshed once if it does not know a package.
simulate() { simulation=$(LC_ALL=C apt-get -s install --no-install-recommends "${missing[@]}" 2>&1); }
simulated=true
if ! simulate; then
  simulated=false
  if ((EUID == 0)) && ! $dry_run; then
    say "refreshing the package lists"
    apt-get -q update || fail 1 "'apt-get update' failed; see its message above, then run this again"
    simulate && simulated=true
  fi
fi
removed=$(sed -n 's/^Remv \([^ ]*\).*/\1/p' <<<"$simulation" | paste -sd' ')

if ((EUID == 0)); then as_root=""; else as_root="sudo "; fi
if [[ -n $removed ]]; then
  # Only the user may agree to a removal, by running this line.
  agree="${as_root}apt-get install --no-install-recommends ${missing[*]}"
  say "installing these would remove: $removed"
  ((EUID == 0)) || $dry_run || fail 5 "needs root. If you agree to the removal, run: $agree"
  fail 1 "nothing was changed. If you agree to the removal, run: $agree"
fi

if ((EUID != 0)); then
  say "to install them, run: sudo apt-get update && sudo apt-get install -y --no-install-recommends --no-remove ${missing[*]}"
  $dry_run && exit 0
  exit 5
fi

if ! $simulated && ! $dry_run; then
  unknown=()
  for package in "${missing[@]}"; do
    [[ -n $(apt-cache show --no-all-versions "$package" 2>/dev/null) ]] || unknown+=("$package")
  done
  ((${#unknown[@]} == 0)) || fail 1 "apt knows no package ${unknown[*]}; the package names are those of Debian 12"
  printf '%s\n' "$simulation" >&2
  fail 1 "apt cannot install them; its message is above"
fi

if $dry_run; then
  say "would run: apt-get install -y --no-install-recommends --no-remove ${missing[*]}"
  exit 0
fi

install() {
  DEBIAN_FRONTEND=noninteractive apt-get -q -o Dpkg::Use-Pty=0 -o DPkg::Lock::Timeout=300 \
    install -y --no-install-recommends --no-remove "${missing[@]}" </dev/null
}
if ! install; then
  say "trying again with fresh package lists"
  { apt-get -q update && install; } || fail 1 "installing failed; apt's message is above"
fi
find_missing
((${#missing[@]} == 0)) || fail 1 "still missing after installing: ${missing[*]}"
say "installed; all ${#packages[@]} packages are there"
