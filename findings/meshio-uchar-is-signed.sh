#!/bin/sh
# meshio 5.3.5 with numpy 2.4.6: the PLY type "uchar" of binary files is read as a signed byte.
#
# Guess: "uchar" and "uint8" are one type, unsigned, in every reader of PLY.
# Seen:  in binary files meshio reads "uchar" as int8, while it reads "uchar" of a text file and "uint8" of either
#        as uint8. An albedo stored as a grey value of 200 is -56: the brightest points of a result become negative
#        and the mean is wrong, without a warning.
# Output:
#   uchar, ascii: uint8 [10, 127, 128, 200, 255] mean 144.0
#   uint8, ascii: uint8 [10, 127, 128, 200, 255] mean 144.0
#   uchar, binary: int8 [10, 127, -128, -56, -1] mean -9.6
#   uint8, binary: uint8 [10, 127, 128, 200, 255] mean 144.0
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 meshio==5.3.5
cd "$work"
"$work/venv/bin/python" - <<'PY'
import struct
import sys

import meshio
import numpy as np

values = [10, 127, 128, 200, 255]


def read(name, binary):
    kind = "binary_little_endian" if binary else "ascii"
    lines = ["ply", f"format {kind} 1.0", f"element vertex {len(values)}"]
    lines += [f"property float {axis}" for axis in "xyz"] + [f"property {name} albedo", "end_header", ""]
    with open("points.ply", "wb") as file:
        file.write("\n".join(lines).encode())
        for at, value in enumerate(values):
            file.write(struct.pack("<fffB", at, 0, 1, value) if binary else f"{at} 0 1 {value}\n".encode())
    try:
        got = meshio.read("points.ply").point_data["albedo"]
    except Exception as error:
        sys.exit(f"no longer as written: {type(error).__name__}: {error}")
    print(f"{name}, {'binary' if binary else 'ascii'}: {got.dtype} {got.tolist()} mean {got.mean():.1f}")
    return got


for name, binary in (("uchar", False), ("uint8", False), ("uchar", True), ("uint8", True)):
    got = read(name, binary)
    signed = binary and name == "uchar"
    wanted = [10, 127, -128, -56, -1] if signed else values
    if got.dtype != (np.int8 if signed else np.uint8) or got.tolist() != wanted:
        sys.exit(f"no longer as written: {name} of this file is read otherwise")
PY
