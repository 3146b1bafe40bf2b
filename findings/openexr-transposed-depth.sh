#!/bin/sh
# OpenEXR 3.5.3 (Python bindings), numpy 2.4.6: a transposed depth map is written in the order of its memory.
#
# Guess: a float32 array that is a transposed view is written as numpy shows it, or refused.
# Seen:  it is written with the right width and height, but its values are those of the memory in sequence, as if
#        the strides were those of a contiguous array. No warning, no error. Maps are often kept as [x, y] and
#        transposed for an image, so a depth map comes out scrambled. np.ascontiguousarray(z.T) is written rightly.
#        Reported to the project as issue 1929.
# Output:
#   given      [[0.0, 4.0, 8.0], [1.0, 5.0, 9.0], [2.0, 6.0, 10.0], [3.0, 7.0, 11.0]]
#   read again [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0], [9.0, 10.0, 11.0]]
#   copied first: equal
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 OpenEXR==3.5.3
cd "$work"
"$work/venv/bin/python" - <<'PY'
import sys

import numpy as np
import OpenEXR


def through_a_file(depth):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"Z": depth}).write("depth.exr")
    with OpenEXR.File("depth.exr") as file:
        return np.array(file.channels()["Z"].pixels)


depth = np.arange(12, dtype=np.float32).reshape(3, 4)
view = depth.T
got = through_a_file(view)
print("given     ", view.tolist())
print("read again", got.tolist())
copied = np.array_equal(through_a_file(np.ascontiguousarray(view)), view)
print("copied first:", "equal" if copied else "differs")
if not copied:
    sys.exit("no longer as written: a contiguous copy is not written rightly")
if np.array_equal(got, view):
    sys.exit("no longer as written: the transposed view is written rightly")
if not np.array_equal(got, depth.reshape(view.shape)):
    sys.exit("no longer as written: the values are not those of the memory in sequence")
PY
