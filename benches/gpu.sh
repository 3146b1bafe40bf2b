#!/bin/sh
# Checks and times one GPU with the release binary alone: no cargo, no compiler, no network.
#
#   benches/gpu.sh [--quick] [--device DEVICE] [BINARY]      BINARY: target/release/thirdbounce
#
# 1. Every pass of both solvers on every accumulation path against its float64 twin, and the device's limits.
#    Stops here if a pass is wrong.
# 2. Scenes, each solved once with cold kernels and five times more: least and median of the solve's seconds, without
#    stamps. Then once with stamps: the share of every kernel.
# 3. Sizes of workgroups, chunks and columns by `profile --tune`, then both solvers on the paper's scene with them.
# 4. Every accumulation path, in short runs of the paper's solver.
# Prints tables and writes benches/results/<device>-<driver>.json. Every part is kept as it is measured in a folder of
# that name, so that nothing is lost if the run ends early. A fast GPU takes some ten minutes.
# Stops if there is only a CPU. --quick runs on a CPU too: small scenes, two repeats; it marks the file as quick.
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
# Ignores sizes and kernels from earlier runs, and leaves none.
export XDG_CACHE_HOME="$work/cache"
# File names without folders, so no result contains a local path.
cd "$work"

# --- The device ---------------------------------------------------------------------------------------------------

# NVIDIA's driver comes as one library. Containers often have it without the file that tells Vulkan's loader of it.
nvidia_library() {
    for name in libGLX_nvidia.so.0 libEGL_nvidia.so.0; do
        { ldconfig -p 2>/dev/null || /sbin/ldconfig -p 2>/dev/null || true; } | sed -n "s|.*=> \\(.*/$name\\)\$|\\1|p"
        ls /usr/lib/*/$name /usr/lib64/$name /usr/local/nvidia/lib64/$name 2>/dev/null || true
    done | head -n 1
}
gpus() { "$binary" devices --json 2>devices.err | grep -c '"kind": "\(discrete\|integrated\|virtual\|other\)"' || true; }
if [ "$(gpus)" = 0 ] && [ -z "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ]; then
    library=$(nvidia_library)
    if [ -n "$library" ]; then
        echo "note: Vulkan's loader finds no GPU, but \$library exists: passed to the loader for this run" >&2
        printf '{"file_format_version": "1.0.0", "ICD": {"library_path": "%s", "api_version": "1.3.0"}}\n' \
            "$library" >nvidia_icd.json
        export VK_DRIVER_FILES="$work/nvidia_icd.json" VK_ICD_FILENAMES="$work/nvidia_icd.json"
    fi
fi
if [ "$(gpus)" = 0 ] && ! $quick; then
    sed 's/^/gpu.sh: /' devices.err >&2
    cat >&2 <<'TEXT'
gpu.sh: there is no GPU that Vulkan sees. `thirdbounce devices` lists what it sees.
  - A driver comes with a file in /usr/share/vulkan/icd.d or /etc/vulkan/icd.d that names its library. If the file is
    elsewhere, set VK_DRIVER_FILES to it.
  - The loader is libvulkan.so.1 (Debian: libvulkan1).
  - A container needs its GPU passed in. NVIDIA: --gpus all -e NVIDIA_DRIVER_CAPABILITIES=all; with compute,utility
    alone, the driver's Vulkan library is left out. AMD and Intel: --device /dev/dri, the group render, and
    mesa-vulkan-drivers inside.
  - benches/gpu.sh --quick measures a CPU.
TEXT
    exit 1
fi

run() { if [ -n "$device" ]; then "$binary" "$@" --device "$device"; else "$binary" "$@"; fi; }
title() { printf '\n== %s\n' "$1"; }

# --- What is measured ---------------------------------------------------------------------------------------------

if $quick; then
    size="--scan 16 --bin-width 0.012 --noise 0.05" lateral=32 paper=40 surface=30 short=4 repeats=2
else
    size="--scan 32 --bin-width 0.006 --noise 0.02" lateral=128 paper=1000 surface=60 short=20 repeats=5
fi

title "every pass against its float64 twin"
run profile --check --json check.json
# The first "name" and "driver" in the check's output are the device's.
word() { sed -n "s/^ *\"$1\": \"\\(.*\\)\",*\$/\\1/p" check.json | head -n 1; }
slug() { printf '%s' "$1" | tr -cs 'A-Za-z0-9.' '-' | sed 's/^-*//; s/-*$//' | cut -c 1-60; }
name="$(slug "$(word name)")-$(slug "$(word driver)")"
$quick && name="$name-quick"
parts="$here/results/$name"
rm -rf "$parts"
mkdir -p "$parts"
cp check.json "$parts/check.json"

# Simulates a capture once: NAME OPTION...
simulated() {
    to=$1
    shift
    [ -f "$to.npz" ] || "$binary" simulate "$@" --out "$to.npz" --quiet
}
seconds() { sed -n 's/^ *"solve_s": \([0-9.e-]*\),*$/\1/p' "$1" | head -n 1; }

# Times a case: NAME CAPTURE OPTION... The first solve makes the kernels.
printf 'case\tcold s\tleast s\tmedian s\n' >times.tsv
timed() {
    case=$1 capture=$2
    shift 2
    options=$*
    title "$case: thirdbounce reconstruct $capture.npz $options"
    rm -rf kernels
    all=
    for i in $(seq 0 "$repeats"); do
        if ! run reconstruct "$capture.npz" "$@" --pipeline-cache kernels --out out --quiet; then
            printf '%s\tfailed\n' "$case" >>times.tsv
            printf '{"options": "%s", "failed": true}\n' "$options" >"$parts/case-$case.json"
            return 0
        fi
        [ "$i" = 0 ] && cold=$(seconds out/report.json) || all="$all $(seconds out/report.json)"
    done
    # The profile's stamps cost time: it tells shares, not seconds.
    case " $* " in *" --model "*) ;; *) set -- "$@" --model cosine ;; esac
    run profile "$capture.npz" "$@" --quiet --json profile.json >/dev/null || printf 'null\n' >profile.json
    # shellcheck disable=SC2086 # a list
    sorted=$(printf '%s\n' $all | sort -g)
    least=$(printf '%s\n' "$sorted" | head -n 1)
    median=$(printf '%s\n' "$sorted" | sed -n "$(((repeats + 1) / 2))p")
    printf '%s\t%s\t%s\t%s\n' "$case" "$cold" "$least" "$median" | tee -a times.tsv
    {
        printf '{"options": "%s", "cold_s": %s, "least_s": %s, "median_s": %s, "solve_s": [%s],\n"profile": ' \
            "$options" "$cold" "$least" "$median" "$(echo "$all" | sed 's/^ //; s/ /, /g')"
        cat profile.json
        printf '}\n'
    } >"$parts/case-$case.json"
}

# shellcheck disable=SC2086 # a list
simulated figure figure $size
timed default figure --lateral $lateral
timed named figure --lateral $lateral --model cosine
timed paper figure --solver paper --lateral $lateral --iterations $paper
if ! $quick; then
    # The paper's own grid: 332 layers.
    timed paper-332 figure --solver paper --lateral 128 --iterations 1000 --depth-pitch 0.00338739
    simulated matt figure --reflectance lambertian --noise 0.02
    timed lambertian matt --model lambertian
    simulated fine figure --bin-width 0.003 --noise 0.03
    timed bins-3mm fine --model cosine
    simulated one-laser figure --pairs one-laser --noise 0.03
    timed one-laser one-laser --model cosine
    simulated exhaustive figure --pairs exhaustive --scan 8 --grid 8 --noise 0.03
    timed exhaustive exhaustive --model cosine
    simulated scan-64 figure --scan 64 --noise 0.05
    timed scan-64 scan-64 --model cosine
    simulated scan-256 figure --scan 256 --bin-width 0.012 --noise 0.05
    timed scan-256 scan-256 --model cosine --lateral 256
fi

for solver in surface paper; do
    title "sizes for the $solver solver, then with them"
    iterations=$surface
    [ $solver = surface ] || iterations=$((paper / 4))
    set -- figure.npz --solver $solver --model cosine --lateral $lateral
    run profile "$@" --iterations $iterations --tune --json tune.json
    # Without the path of the cache.
    sed 's|"file": ".*/|"file": "|' tune.json >"$parts/tune-$solver.json"
    [ $solver = surface ] || iterations=$paper
    run profile "$@" --iterations $iterations --quiet --json "$parts/tuned-$solver.json"
done
rm -rf "$XDG_CACHE_HOME"
for path in owned float fixed fixed32 cas; do
    title "paper's solver, --accumulation $path"
    # A path that the device lacks is refused with its reason.
    run profile figure.npz --solver paper --lateral $lateral --no-coarse-to-fine --iterations $short \
        --accumulation $path --quiet --json path.json && cp path.json "$parts/accumulation-$path.json" || true
done

# --- The results --------------------------------------------------------------------------------------------------

# All parts whose names begin so, as one object: PREFIX
object() {
    comma=
    printf '{'
    for part in "$parts/$1"*.json; do
        [ -f "$part" ] || continue
        key=$(basename "$part" .json)
        printf '%s\n"%s": ' "$comma" "${key#"$1"}"
        cat "$part"
        comma=,
    done
    printf '}'
}
{
    printf '{\n"device": "%s",\n"driver": "%s",\n"quick": %s,\n' "$(word name)" "$(word driver)" "$quick"
    printf '"check": '
    cat "$parts/check.json"
    for group in case- tune- tuned- accumulation-; do
        printf ',\n"%s": ' "${group%-}"
        object "$group"
    done
    printf '\n}\n'
} >result.json
mv result.json "$here/results/$name.json"
rm -rf "$parts"
title "seconds of a solve"
expand -t 20 times.tsv
printf '\nwrote     %s\n' "$here/results/$name.json"
