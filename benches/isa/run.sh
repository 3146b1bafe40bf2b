#!/bin/sh
# Asks the compilers of GPU drivers what they make of the kernels. Needs no GPU.
#
#   benches/isa/run.sh [BINARY]                BINARY: target/release/thirdbounce
#
# 1. Every Vulkan device that is there: `thirdbounce profile --compile`.
# 2. AMD: Mesa's RADV compiles for a GPU that is not there (RADV_FORCE_FAMILY).
# 3. NVIDIA: the two loops of loops.c, by clang to PTX, by ptxas for the H200's sm_90, and back by nvdisasm.
# What is missing is named with the way to get it, and left out. Prints a table and writes benches/results/isa.json, or
# the file of that folder that RESULT names, for a second driver (VK_DRIVER_FILES).
set -eu

here=$(cd "$(dirname "$0")" && pwd)
binary=${1:-$here/../../target/release/thirdbounce}
[ -x "$binary" ] || { echo "run.sh: $binary is no program: build it (make build) or name it" >&2; exit 1; }
binary=$(cd "$(dirname "$binary")" && pwd)/$(basename "$binary")
command -v python3 >/dev/null || { echo "run.sh: python3 is missing" >&2; exit 1; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# No sizes from earlier runs, and no kernels from a driver's cache.
export XDG_CACHE_HOME="$work/cache" MESA_SHADER_CACHE_DISABLE=true
missing() { printf 'left out: %s\n' "$1" >&2; }
compile() { # NAME DEVICE OPTIONS...
    name=$1 device=$2
    shift 2
    "$binary" profile --compile --quiet --device "$device" --pipeline-cache off --model cosine --listings "$work/$name" \
        --json "$work/$name.json" "$@" >/dev/null
}

count=$("$binary" devices --json | grep -c '"index"') || true
for index in $(seq 0 $((count - 1))); do
    compile "device-$index" "$index"
done

# Versions of Mesa know other names; gfx1100 and navi31 are one GPU.
known=
for family in vega20 navi21 gfx1100 navi31 gfx1201; do
    # A name that it does not know ends the program.
    if (RADV_FORCE_FAMILY=$family "$binary" devices | grep -q "Null hardware") 2>/dev/null; then
        export RADV_FORCE_FAMILY=$family
        compile "$family" "Null hardware"
        compile "$family-no-window" "Null hardware" --sizes window=0
        compile "$family-paper" "Null hardware" --solver paper --lateral 128
        unset RADV_FORCE_FAMILY
        known="$known $family"
    fi
done
[ -n "$known" ] || missing "AMD: Mesa's RADV is not there (Debian: apt-get install mesa-vulkan-drivers)"

"$binary" devices | grep -qi intel ||
    missing "Intel: ANV opens no device without /dev/dri. Mesa's stub for that (intel_stub_gpu) is in its sources only"

# The newest clang with a target for PTX; the tools of CUDA, on the path or in a Python environment.
clang=
for name in clang clang-19 clang-18 clang-17 clang-16 clang-15 clang-14; do
    command -v $name >/dev/null && $name --print-targets 2>/dev/null | grep -q nvptx64 && { clang=$name; break; }
done
: "${CUDA_TOOLS:=$here/../../target/cuda}"
tool() { command -v "$1" || find "$CUDA_TOOLS" -name "$1" -type f -perm -u+x 2>/dev/null | head -n 1; }
ptxas=$(tool ptxas) nvdisasm=$(tool nvdisasm)
if [ -z "$clang" ]; then
    missing "NVIDIA: no clang with the target nvptx64 (Debian: apt-get install clang)"
elif [ -z "$ptxas" ] || [ -z "$nvdisasm" ]; then
    missing "NVIDIA: no ptxas or nvdisasm (python3 -m venv target/cuda && target/cuda/bin/pip install \
nvidia-cuda-nvcc-cu12 nvidia-cuda-nvdisasm; another place: CUDA_TOOLS)"
else
    $clang -x cuda --cuda-device-only --cuda-gpu-arch=sm_80 -nocudainc -nocudalib -O3 -fno-unroll-loops \
        -ffp-contract=fast -fcuda-flush-denormals-to-zero -S -o "$work/nvidia.ptx" "$here/loops.c"
    "$ptxas" -v -arch=sm_90 -o "$work/nvidia.cubin" "$work/nvidia.ptx" 2>"$work/nvidia.ptxas"
    "$nvdisasm" -c "$work/nvidia.cubin" >"$work/nvidia.sass" 2>/dev/null
    { $clang --version | head -n 1; "$ptxas" --version | tail -n 1; "$nvdisasm" --version | tail -n 1; } \
        >"$work/nvidia.versions"
fi

mkdir -p "$here/../results"
python3 "$here/count.py" --report "$work" "$here/../results/${RESULT:=isa.json}"
printf '\nwrote     benches/results/%s\n' "$RESULT"
