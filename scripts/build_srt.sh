#!/usr/bin/env bash
# Builds SRT with bonded links for `interneuron bench peers`, which the package of Debian leaves out: fetches the source
# package with apt-get, which verifies it, and leaves a static library and its headers in build/srt. The system's own lists of sources
# are neither used nor changed, and no root is needed. Configure and build anew afterwards.
#
#   scripts/build_srt.sh [--dest DIR]
#
#   --dest DIR   where to; default build/srt, where the build looks for it
#
# Exit codes: 0 it is there, 1 failed, 2 usage, 77 this system cannot (no apt-get, or its archive cannot be reached).
set -euo pipefail
root=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")

say() { printf 'build_srt: %s\n' "$*"; }
fail() { printf 'build_srt: %s\n' "$2" >&2; exit "$1"; }

dest="$root/build/srt"
while (($# > 0)); do
  case $1 in
    --dest) [[ -n ${2:-} ]] || fail 2 "--dest needs a folder"; dest=$2; shift ;;
    --dest=?*) dest=${1#--dest=} ;;
    -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "${BASH_SOURCE[0]}"; exit 0 ;;
    *) fail 2 "unknown argument '$1'; see scripts/build_srt.sh --help" ;;
  esac
  shift
done

if [[ -f $dest/lib/libsrt.a && -f $dest/include/srt/srt.h ]]; then
  say "already there: $dest"
  exit 0
fi
for tool in apt-get apt-cache dpkg-source cmake; do
  command -v "$tool" >/dev/null || fail 77 "needs $tool; on Debian: apt-get install dpkg-dev cmake"
done
codename=$(sed -n 's/^VERSION_CODENAME=//p' /etc/os-release)
[[ -n $codename ]] || fail 77 "this system does not tell its release in /etc/os-release"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
# As root, apt-get gives up its privileges to download, and that user has to get in.
chmod 755 "$work"
mkdir -p "$work/lists/partial" "$work/cache/archives/partial"
printf 'deb-src http://deb.debian.org/%s main\n' "debian $codename" "debian-security $codename-security" >"$work/sources.list"
options=(-q -o "Dir::Etc::SourceList=$work/sources.list" -o Dir::Etc::SourceParts=/dev/null -o "Dir::State::Lists=$work/lists"
  -o "Dir::Cache=$work/cache" -o APT::Sandbox::User=root)

cd "$work"
say "asking Debian's archive for the source package srt"
apt-get "${options[@]}" update >"$work/apt.log" 2>&1 || fail 77 "Debian's archive cannot be reached: $(grep -m1 '^[EW]:' "$work/apt.log" || tail -n 1 "$work/apt.log")"
versions=$(apt-cache "${options[@]}" showsrc srt 2>/dev/null | sed -n 's/^Version: //p' | sort -rV | uniq)
[[ -n $versions ]] || fail 77 "Debian's archive has no source package srt for $codename"
fetched=
for version in $versions; do
  # A version that is listed may be gone from a mirror; the one before it still is there.
  if apt-get "${options[@]}" --download-only source "srt=$version" >>"$work/apt.log" 2>&1; then
    fetched=$version
    break
  fi
done
[[ -n $fetched ]] || fail 77 "no version of srt can be fetched: $(grep -m1 '^E:' "$work/apt.log" || tail -n 1 "$work/apt.log")"
say "building srt $fetched with bonding"
dpkg-source --no-check -x "srt_${fetched#*:}.dsc" source >"$work/source.log" 2>&1 || fail 1 "dpkg-source: $(tail -n 1 "$work/source.log")"
if ! { cmake -S source -B build -DCMAKE_BUILD_TYPE=Release -DENABLE_BONDING=ON -DENABLE_ENCRYPTION=OFF -DENABLE_SHARED=OFF \
         -DENABLE_APPS=OFF -DCMAKE_INSTALL_LIBDIR=lib -DCMAKE_INSTALL_PREFIX="$work/out" &&
       cmake --build build --parallel "$(nproc)" --target install; } >"$work/build.log" 2>&1; then
  fail 1 "the build failed: $(grep -m1 -i error "$work/build.log" || tail -n 1 "$work/build.log")"
fi
mkdir -p "$dest"
cp -r "$work/out/include" "$work/out/lib" "$dest/"
say "$dest: libsrt.a and its headers; now: cmake --preset release && cmake --build --preset release"
