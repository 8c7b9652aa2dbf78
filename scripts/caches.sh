# Sourced by the scripts that build: where caches lie. `root` is the project's folder.
#
# Those of font and image libraries stay in build/. The compiler's is the user's own where ccache is installed, so that a new
# clone need not compile what another one has; INTERNEURON_CCACHE=build keeps it in build/ as well.
# shellcheck shell=bash

if [[ ${INTERNEURON_CCACHE-} != build && -z ${CCACHE_DIR-} && -n ${HOME-} ]]; then
  # Where it is installed only now, by scripts/setup.sh, it has no configuration yet.
  CCACHE_DIR=$(ccache --get-config cache_dir 2>/dev/null) || CCACHE_DIR="${XDG_CACHE_HOME:-$HOME/.cache}/ccache"
  # One that cannot be written, as that of a user without a home, would make every compilation fail.
  if { mkdir -p "$CCACHE_DIR" && [[ -w $CCACHE_DIR ]]; } 2>/dev/null; then export CCACHE_DIR; else CCACHE_DIR=; fi
fi
export XDG_CACHE_HOME="${root:?}/build/cache"
if [[ ${INTERNEURON_CCACHE-} == build || -z ${CCACHE_DIR-} ]]; then export CCACHE_DIR="$XDG_CACHE_HOME/ccache"; fi
