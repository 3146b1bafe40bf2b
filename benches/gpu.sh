#!/bin/sh
# Checks and times one device with the release binary alone: no cargo, no compiler, no network.
#
#   benches/gpu.sh [--quick] [--device DEVICE] [BINARY]      BINARY: target/release/thirdbounce
#
# 1. Every pass of both solvers on every accumulation path against its float64 twin, and the device's limits.
#    Stops here if a pass is wrong.
# 2. Both solvers on the paper's scene (32 x 32 points, 128 x 128 voxels), simulated first: every kernel.
# 3. The same with the fastest sizes of workgroups, chunks and columns that trials find.
# 4. Every accumulation path, in short runs of the paper's solver.
# Prints a table of each and writes benches/results/<device>-<driver>.json. --quick uses a scene that two CPU cores
# solve in seconds, and marks the file as quick.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
binary=$here/../target/release/thirdbounce
quick=false
device=
while [ $# -gt 0 ]; do
    case $1 in
    --quick) quick=true ;;
    --device)
        [ $# -gt 1 ] || { echo "gpu.sh: --device takes an index or part of a name" >&2; exit 2; }
        device=$2
        shift
        ;;
    -*)
        echo "gpu.sh: $1 is not known; usage: benches/gpu.sh [--quick] [--device DEVICE] [BINARY]" >&2
        exit 2
        ;;
    *) binary=$1 ;;
    esac
    shift
done
[ -f "$binary" ] && [ -x "$binary" ] ||
    { echo "gpu.sh: $binary is no program: build it (make build) or name it" >&2; exit 1; }
binary=$(cd "$(dirname "$binary")" && pwd)/$(basename "$binary")

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# Ignores sizes from earlier runs, and leaves none.
export XDG_CACHE_HOME="$work/cache"
# File names without folders, so no result contains a local path.
cd "$work"
# The device's name may contain spaces.
profile() { if [ -n "$device" ]; then "$binary" profile --device "$device" "$@"; else "$binary" profile "$@"; fi; }
title() { printf '\n== %s\n' "$1"; }

if $quick; then
    scene="--scan 16 --bin-width 0.012 --noise 0.05"
    lateral=32 paper=40 vector=30 short=4
else
    scene="--scan 32 --bin-width 0.006 --noise 0.02"
    lateral=128 paper=1000 vector=60 short=20
fi

title "every pass against its float64 twin"
profile --check --json check.json
title "the scene"
# shellcheck disable=SC2086 # a list
"$binary" simulate figure $scene --out figure.npz --quiet
title "vector solver"
profile figure.npz --solver vector --lateral $lateral --iterations $vector --quiet --json vector.json
title "paper's solver"
profile figure.npz --solver paper --lateral $lateral --iterations $paper --quiet --json paper.json
for solver in vector paper; do
    title "sizes for the $solver solver, then with them"
    iterations=$vector
    [ $solver = vector ] || iterations=$((paper / 4))
    profile figure.npz --solver $solver --lateral $lateral --iterations $iterations --tune --json tune-$solver.json
    [ $solver = vector ] || iterations=$paper
    profile figure.npz --solver $solver --lateral $lateral --iterations $iterations --quiet --json tuned-$solver.json
done
rm -rf "$XDG_CACHE_HOME"
paths=
for path in owned float fixed fixed32 cas; do
    title "paper's solver, --accumulation $path"
    # A path that the device lacks is refused with its reason.
    if profile figure.npz --solver paper --lateral $lateral --no-coarse-to-fine --iterations $short \
        --accumulation $path --quiet --json "$path.json"; then
        paths="$paths $path"
    fi
done

# The first "name" and "driver" in the check's output are the device's.
word() { sed -n "s/^ *\"$1\": \"\\(.*\\)\",*\$/\\1/p" check.json | head -n 1; }
slug() { printf '%s' "$1" | tr -cs 'A-Za-z0-9.' '-' | sed 's/^-*//; s/-*$//' | cut -c 1-60; }
mkdir -p "$here/results"
result="$here/results/$(slug "$(word name)")-$(slug "$(word driver)").json"
{
    printf '{\n"device": "%s",\n"driver": "%s",\n"quick": %s,\n' "$(word name)" "$(word driver)" "$quick"
    printf '"check": '
    cat check.json
    for part in vector paper tune-vector tuned-vector tune-paper tuned-paper; do
        printf ',\n"%s": ' "$part"
        # Where the cache was is nobody's business.
        sed 's|"file": ".*/|"file": "|' "$part.json"
    done
    printf ',\n"accumulation": {'
    comma=
    for path in $paths; do
        printf '%s\n"%s": ' "$comma" "$path"
        cat "$path.json"
        comma=,
    done
    printf '}\n}\n'
} >result.json
mv result.json "$result"
printf '\nwrote     %s\n' "$result"
