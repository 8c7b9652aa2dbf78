#!/usr/bin/env bash
# Fetches the demo's data: the video out of Debian's package opencv-doc (downloaded and unpacked, not installed) and the
# detection models from their public origins. Every file is verified against scripts/data.sha256; a file that is already
# there and right is kept. Needs no root.
#
#   scripts/fetch_data.sh [--dest DIR] [--ground-truth] [--point-clouds] [--traces]
#
#   --dest DIR       where to; default build/data
#   --ground-truth   also the MOTChallenge ground truth of the video, which is licensed CC BY-NC-SA 3.0
#   --point-clouds   also one lidar sweep each of KITTI (CC BY-NC-SA 3.0) and nuScenes (CC BY-NC-SA 4.0)
#   --traces         also measured rates of two LTE networks, which are part of Mahimahi and under the GPL 3
#
# Exit codes: 0 all there, 1 a file could not be had (the others were still fetched), 2 usage.
set -euo pipefail
root=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
sums="$root/scripts/data.sha256"

dest="$root/build/data"
ground_truth=false
point_clouds=false
traces=false
while (($# > 0)); do
  case $1 in
    --dest)
      [[ -n ${2:-} ]] || { echo "fetch_data: --dest needs a folder" >&2; exit 2; }
      dest=$2
      shift
      ;;
    --dest=?*) dest=${1#--dest=} ;;
    --ground-truth) ground_truth=true ;;
    --point-clouds) point_clouds=true ;;
    --traces) traces=true ;;
    -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "${BASH_SOURCE[0]}"; exit 0 ;;
    *) printf "fetch_data: unknown argument '%s'; see scripts/fetch_data.sh --help\n" "$1" >&2; exit 2 ;;
  esac
  shift
done

github=https://raw.githubusercontent.com
yolo_fastest=ModelZoo/yolo-fastest-1.1_coco
# file | places to get it from, tried in turn. Commits are pinned; the sums decide in any case.
sources=(
  "models/yolo-fastest-1.1.cfg|$github/dog-qiuqiu/Yolo-Fastest/99d03d0f26e2555275bdb30f43479d47cc19311f/$yolo_fastest/yolo-fastest-1.1.cfg $github/dog-qiuqiu/Yolo-Fastest/96a2900/$yolo_fastest/yolo-fastest-1.1.cfg"
  "models/yolo-fastest-1.1.weights|$github/dog-qiuqiu/Yolo-Fastest/99d03d0f26e2555275bdb30f43479d47cc19311f/$yolo_fastest/yolo-fastest-1.1.weights $github/dog-qiuqiu/Yolo-Fastest/96a2900/$yolo_fastest/yolo-fastest-1.1.weights"
  "models/yolo-fastest-1.1-xl.cfg|$github/dog-qiuqiu/Yolo-Fastest/9c62b1c50e024fb73d29a651133b1d63548e63a1/$yolo_fastest/yolo-fastest-1.1-xl.cfg $github/dog-qiuqiu/Yolo-Fastest/96a2900/$yolo_fastest/yolo-fastest-1.1-xl.cfg"
  "models/yolo-fastest-1.1-xl.weights|$github/dog-qiuqiu/Yolo-Fastest/9c62b1c50e024fb73d29a651133b1d63548e63a1/$yolo_fastest/yolo-fastest-1.1-xl.weights $github/dog-qiuqiu/Yolo-Fastest/96a2900/$yolo_fastest/yolo-fastest-1.1-xl.weights"
  "models/yolox_nano.onnx|$github/hamacom2004jp/iinfer/c7f9a3c5216c6f8b3e8b35886f863dffa2dc0bf9/models/yolox_nano.onnx"
)
video="pets/vtest.avi"
video_url="$github/opencv/opencv/4.6.0/samples/data/vtest.avi"
mahimahi="$github/ravinet/mahimahi/ae477d437615b972217498ba52be07db17a15618/traces"
truth="$github/gonzalocarreteroh/MASA-OA/ff2036c/benchmarks/MOT15/PETS09-S2L1"
mmdetection="$github/open-mmlab/mmdetection3d/fe25f7a51d36e3702f961e198894580d83c4387b/demo/data"

say() { printf 'fetch_data: %s\n' "$*"; }
failures=0
# One line: the file, where it was sought, what went wrong, what to do.
missed() {
  failures=$((failures + 1))
  printf 'fetch_data: %s: %s: %s; run this again, or put the file at %s yourself\n' "$1" "$2" "$3" "$dest/$1" >&2
}

if ! mkdir -p "$dest" 2>/dev/null || [[ ! -w $dest ]]; then
  printf 'fetch_data: cannot write to %s; choose another folder with --dest\n' "$dest" >&2
  exit 1
fi
dest=$(readlink -f "$dest")
work=$(mktemp -d "$dest/.fetch.XXXXXX")
trap 'rm -rf "$work"' EXIT
trap 'trap - INT; kill -INT $$' INT
trap 'exit 143' TERM

right() {  # right FILE NAME: whether FILE has the sum listed for NAME
  local sum
  sum=$(sed -n "s|^\([0-9a-f]\{64\}\)  $2\$|\1|p" "$sums")
  [[ -n $sum && -f $1 ]] && sha256sum --check --status <<<"$sum  $1"
}

kept=0
there() {  # there NAME: already fetched and right
  right "$dest/$1" "$1" || return 1
  kept=$((kept + 1))
}

place() {  # place FILE NAME: moves a verified file to where it belongs
  mkdir -p "$dest/$(dirname "$2")" && chmod 644 "$1" && mv -f "$1" "$dest/$2" && say "$2: fetched and verified"
}

download() {  # download URL FILE; the reason for a failure lands in $reason
  if command -v curl >/dev/null; then
    reason=$(curl -fsSL --proto '=https' --connect-timeout 15 --retry 1 --speed-limit 1000 --speed-time 30 \
      -o "$2" "$1" 2>&1) && return 0
  elif command -v wget >/dev/null; then
    reason=$(wget -nv --https-only --timeout=30 --tries=2 -O "$2" "$1" 2>&1) && return 0
  else
    reason="neither curl nor wget is installed"
    return 1
  fi
  reason=$(tail -n 1 <<<"$reason")
  reason=${reason:-download failed}
  return 1
}

fetch() {  # fetch NAME URL...
  local name=$1 url file="$work/file"
  shift
  there "$name" && return 0
  for url in "$@"; do
    if download "$url" "$file"; then
      right "$file" "$name" && { place "$file" "$name"; return 0; }
      reason="the file there has another sha256 than scripts/data.sha256"
    fi
  done
  missed "$name" "$url" "$reason"
}

video_from_debian() {  # the reason for a failure lands in $reason
  local options=() deb member
  if ! command -v apt-get >/dev/null || ! command -v dpkg-deb >/dev/null; then
    reason="this system has no apt-get"
    return 1
  fi
  ((EUID == 0)) && options=(-o APT::Sandbox::User=root)
  say "$video: downloading Debian's opencv-doc (95 MB)"
  if ! reason=$(cd "$work" && LC_ALL=C apt-get "${options[@]}" -q download opencv-doc 2>&1); then
    reason="apt-get download opencv-doc: $(grep '^E:' <<<"$reason" | head -n 1 || true)"
    [[ $reason != *"Unable to locate"* && $reason != *"No candidate"* ]] || reason+=" (try: sudo apt-get update)"
    return 1
  fi
  deb=$(find "$work" -maxdepth 1 -name 'opencv-doc_*.deb' | head -n 1)
  member=usr/share/doc/opencv-doc/examples/data/vtest.avi
  mkdir -p "$work/tree"
  dpkg-deb --fsys-tarfile "$deb" 2>/dev/null | tar -x -C "$work/tree" --wildcards "./$member*" 2>/dev/null || true
  [[ ! -f $work/tree/$member.gz ]] || gunzip "$work/tree/$member.gz"
  rm -f "$deb"
  right "$work/tree/$member" "$video" && { place "$work/tree/$member" "$video"; return 0; }
  reason="opencv-doc of this system holds no such file with the right sha256"
  return 1
}

if ! there "$video" && ! video_from_debian; then
  say "$video: $reason; trying $video_url"
  debian_reason=$reason
  if download "$video_url" "$work/file" && right "$work/file" "$video"; then
    place "$work/file" "$video"
  else
    missed "$video" "$video_url" "${reason:-wrong sha256}; and $debian_reason"
  fi
fi

for source in "${sources[@]}"; do
  # shellcheck disable=SC2086  # the places are separated by spaces
  fetch "${source%%|*}" ${source#*|}
done

if $ground_truth; then
  say "the ground truth is MOTChallenge data, licensed CC BY-NC-SA 3.0: attribution, no commercial use, share alike"
  fetch pets/gt.txt "$truth/gt/gt.txt" "$truth/gt.txt"
  fetch pets/seqinfo.ini "$truth/seqinfo.ini"
fi

if $point_clouds; then
  say "the sweeps are of KITTI (CC BY-NC-SA 3.0) and nuScenes (CC BY-NC-SA 4.0): attribution, no commercial use, share alike"
  fetch pointcloud/kitti_000008.bin "$mmdetection/kitti/000008.bin"
  fetch pointcloud/nuscenes_lidar_top.pcd.bin \
    "$mmdetection/nuscenes/n015-2018-07-24-11-22-45%2B0800__LIDAR_TOP__1532402927647951.pcd.bin"
fi

if $traces; then
  say "the traces are part of Mahimahi, licensed GPL 3"
  for name in TMobile-LTE-short.up TMobile-LTE-short.down Verizon-LTE-short.up Verizon-LTE-short.down; do
    fetch "traces/mahimahi/$name" "$mahimahi/$name"
  done
fi

((kept == 0)) || say "$kept already there"
((failures == 0)) || { printf 'fetch_data: %d file(s) missing in %s\n' "$failures" "$dest" >&2; exit 1; }
say "all there in $dest"
