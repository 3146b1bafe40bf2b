#!/bin/sh
# Checks and times one GPU with the release binary alone: no cargo, no compiler, no network.
#
#   benches/gpu.sh [--quick|--smoke] [--device DEVICE] [--out FOLDER] [BINARY]      BINARY: target/release/thirdbounce
#
# 1. Every pass of both solvers on every accumulation path against its float64 twin, and the device's limits.
#    Stops here if a pass is wrong.
# 2. Scenes, each solved with cold kernels, by a second process, and more often: seconds of the solve and of the whole command,
#    device memory. Then once with time stamps: every kernel against the measured limits.
# 3. Every accumulation path, in short runs of the paper's solver.
# 4. One line, pass or FAIL, for each target of a GPU; exit status 1 after a FAIL.
# Prints tables and writes FOLDER/<device>-<driver>.json, by default to benches/results. Every part is kept as it is measured in a
# folder of that name, so that nothing is lost if the run ends early. Scenes that no longer fit into ten minutes are left out.
# Stops if there is only a CPU. --quick runs on a CPU too: small scenes, two repeats; --smoke is its shortest form, without parts 1
# and 3, in which only the targets that do not depend on speed are judged. Both mark the file.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
binary=$here/../target/release/thirdbounce
quick=false
smoke=false
device=
out=$here/results
began=$(date +%s)
while [ $# -gt 0 ]; do
    case $1 in
    --quick) quick=true ;;
    --smoke) quick=true smoke=true ;;
    --out)
        [ $# -gt 1 ] || { echo "gpu.sh: --out takes a folder" >&2; exit 2; }
        out=$2
        shift
        ;;
    --device)
        [ $# -gt 1 ] || { echo "gpu.sh: --device takes an index or part of a name" >&2; exit 2; }
        device=$2
        shift
        ;;
    -*)
        echo "gpu.sh: $1 is not known; usage: benches/gpu.sh [--quick|--smoke] [--device DEVICE] [--out FOLDER] [BINARY]" >&2
        exit 2
        ;;
    *) binary=$1 ;;
    esac
    shift
done
[ -f "$binary" ] && [ -x "$binary" ] ||
    { echo "gpu.sh: $binary is no program: build it (make build) or name it" >&2; exit 1; }
binary=$(cd "$(dirname "$binary")" && pwd)/$(basename "$binary")
mkdir -p "$out"
out=$(cd "$out" && pwd)

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
        echo "note: Vulkan's loader finds no GPU, but $library exists: passed to the loader for this run" >&2
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
now() { date +%s.%N; }
since() { awk "BEGIN { print $(now) - $1 }"; }
# Judges a value: WHAT VALUE BOUND UNIT
judge() {
    verdict=$(awk -v v="${2:-none}" -v most="$3" 'BEGIN { print (v + 0 == v && v <= most) ? "pass" : "FAIL" }')
    printf '%s  %s: %s %s, at most %s\n' "$verdict" "$1" "${2:-no value}" "$4" "$3" >>verdicts
}
# The same for what depends on the speed of a GPU.
judge_speed() { if $quick; then printf 'skip  %s: a CPU, %s %s\n' "$1" "$2" "$4" >>verdicts; else judge "$@"; fi; }

# --- What is measured ---------------------------------------------------------------------------------------------

if $smoke; then
    size="--scan 8 --bin-width 0.02 --noise 0.1" lateral=16 paper=4 short=2 repeats=1
elif $quick; then
    size="--scan 16 --bin-width 0.012 --noise 0.05" lateral=32 paper=40 short=4 repeats=2
else
    size="--scan 32 --bin-width 0.006 --noise 0.02" lateral=128 paper=1000 short=20 repeats=5
fi

if $smoke; then
    run devices --json >check.json
else
    title "every pass against its float64 twin"
    run profile --check --json check.json
    echo "pass  every pass agrees with its float64 twin" >>verdicts
fi
# The first "name" and "driver" in the check's output are the device's.
word() { sed -n "s/^ *\"$1\": \"\\(.*\\)\",*\$/\\1/p" check.json | head -n 1; }
slug() { printf '%s' "$1" | tr -cs 'A-Za-z0-9.' '-' | sed 's/^-*//; s/-*$//' | cut -c 1-60; }
name="$(slug "$(word name)")-$(slug "$(word driver)")"
if $smoke; then name="$name-smoke"; elif $quick; then name="$name-quick"; fi
parts="$out/$name"
rm -rf "$parts"
mkdir -p "$parts"
cp check.json "$parts/check.json"

# Simulates a capture once: NAME OPTION...
simulated() {
    to=$1
    shift
    [ -f "$to.npz" ] || "$binary" simulate "$@" --out "$to.npz" --quiet
}
value() { sed -n "s/^ *\"$2\": \([0-9.e-]*\),*\$/\1/p" "$1" | head -n 1; }

# Times a case: NAME CAPTURE OPTION... The first solve makes the kernels.
printf 'case\tcold s\tleast s\tmedian s\tfirst start s\tsecond start s\tMiB\n' >times.tsv
timed() {
    case=$1 capture=$2
    shift 2
    options=$*
    if [ $(($(date +%s) - began)) -gt 480 ]; then
        echo "note: $case is left out, as eight minutes have passed"
        return 0
    fi
    title "$case: thirdbounce reconstruct $capture.npz $options"
    rm -rf kernels
    all= second=
    for i in $(seq 0 "$repeats"); do
        start=$(now)
        if ! run reconstruct "$capture.npz" "$@" --pipeline-cache kernels --out out --quiet; then
            printf 'FAIL  %s does not run\n' "$case" >>verdicts
            printf '{"options": "%s", "failed": true}\n' "$options" >"$parts/case-$case.json"
            return 0
        fi
        whole=$(since "$start")
        if [ "$i" = 0 ]; then
            cold=$(value out/report.json solve_s) first=$whole
        else
            all="$all $(value out/report.json solve_s)" second=${second:-$whole}
        fi
    done
    bytes=$(value out/report.json peak_device_bytes) preview=$(value out/report.json preview_s)
    # The profile's stamps cost time: it tells shares, not seconds.
    case " $* " in *" --model "*) ;; *) set -- "$@" --model cosine ;; esac
    run profile "$capture.npz" "$@" --quiet --json profile.json || printf 'null\n' >profile.json
    # shellcheck disable=SC2086 # a list
    sorted=$(printf '%s\n' $all | sort -g)
    least=$(printf '%s\n' "$sorted" | head -n 1)
    median=$(printf '%s\n' "$sorted" | sed -n "$(((repeats + 1) / 2))p")
    printf '%s\t%s\t%s\t%s\t%s\t%s\t%s\n' "$case" "$cold" "$least" "$median" "$first" "$second" \
        "$((${bytes:-0} >> 20))" | tee -a times.tsv
    {
        printf '{"options": "%s", "cold_s": %s, "least_s": %s, "median_s": %s, "solve_s": [%s],\n' \
            "$options" "$cold" "$least" "$median" "$(echo "$all" | sed 's/^ //; s/ /, /g')"
        printf '"first_start_s": %s, "second_start_s": %s, "preview_s": %s, "peak_device_bytes": %s,\n"profile": ' \
            "$first" "$second" "${preview:-null}" "${bytes:-null}"
        cat profile.json
        printf '}\n'
    } >"$parts/case-$case.json"
}

# shellcheck disable=SC2086 # a list
simulated figure figure $size
timed default figure --lateral $lateral
judge "device memory of the default" "${bytes:-}" 33554432 bytes
judge_speed "the default by a second process" "${second:-}" 2 s
judge_speed "first preview" "${preview:-}" 0.1 s
timed named figure --lateral $lateral --model cosine
judge_speed "device time of a solve" "$(value profile.json device_s)" 0.04 s
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

if ! $smoke; then
    for path in auto repeatable; do
        title "paper's solver, --accumulation $path"
        # A path that the device lacks is refused with its reason.
        run profile figure.npz --solver paper --lateral $lateral --no-coarse-to-fine --iterations $short \
            --accumulation $path --quiet --json path.json && cp path.json "$parts/accumulation-$path.json" || true
    done
fi

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
judge "this script" "$(($(date +%s) - began))" 600 s
{
    printf '{\n"device": "%s",\n"driver": "%s",\n"quick": %s,\n' "$(word name)" "$(word driver)" "$quick"
    printf '"check": '
    cat "$parts/check.json"
    printf ',\n"verdicts": [%s]' "$(sed 's/"//g; s/.*/"&"/' verdicts | paste -s -d, -)"
    for group in case- accumulation-; do
        printf ',\n"%s": ' "${group%-}"
        object "$group"
    done
    printf '\n}\n'
} >result.json
mv result.json "$out/$name.json"
rm -rf "$parts"
title "seconds of a solve"
expand -t 20 times.tsv
title "targets"
cat verdicts
printf '\nwrote     %s\n' "$out/$name.json"
! grep -q '^FAIL' verdicts
