#!/bin/sh
# opencv-python-headless 5.0.0.93 with Pillow 13.0.0, numpy 2.4.6: values of a PFM file are divided by its scale.
#
# Guess: the third line of a PFM depth map tells by its sign the order of the bytes, and readers ignore its size.
# Seen:  OpenCV divides by it, for one channel and for three. Netpbm's page of the format says that the scale tells
#        the units of the samples, and Pillow returns the stored numbers with the scale beside them. Depths in
#        millimetres that state 0.001, to be metres, are a million times too far: 1500 is 1500000 instead of 1.5.
#        Files of scale 1, as all that OpenCV and Pillow write, do not show it.
# Output:
#   scale -1.0: stored 1500, OpenCV 1500, Pillow 1500 with scale 1
#   scale 1.0: stored 1500, OpenCV 1500, Pillow 1500 with scale 1
#   scale -2.0: stored 1500, OpenCV 750, Pillow 1500 with scale 2
#   scale 2.0: stored 1500, OpenCV 750, Pillow 1500 with scale 2
#   scale -0.5: stored 1500, OpenCV 3000, Pillow 1500 with scale 0.5
#   scale 0.001: stored 1500, OpenCV 1.5e+06, Pillow 1500 with scale 0.001
#   scale -2.0, three channels: stored (0, 0, 1), OpenCV (0.0, 0.0, 0.5)
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 \
    opencv-python-headless==5.0.0.93 pillow==13.0.0
cd "$work"
"$work/venv/bin/python" - <<'PY'
import sys

import cv2
import numpy as np
from PIL import Image

depth = np.array([[1500, 1600, 1700], [2000, 2100, 2200]], np.float32)


def read(scale, kind, values):
    with open("depth.pfm", "wb") as file:
        file.write(f"{kind}\n3 2\n{scale}\n".encode())
        # Rows from the bottom to the top.
        file.write(values[::-1].astype(">f4" if scale > 0 else "<f4").tobytes())
    return cv2.imread("depth.pfm", cv2.IMREAD_UNCHANGED)


for scale in (-1.0, 1.0, -2.0, 2.0, -0.5, 0.001):
    got = read(scale, "Pf", depth)
    with Image.open("depth.pfm") as image:
        plain, beside = np.asarray(image), image.info["scale"]
    print(f"scale {scale}: stored 1500, OpenCV {got[0, 0]:g}, Pillow {plain[0, 0]:g} with scale {beside:g}")
    if not np.array_equal(plain, depth) or abs(beside - abs(scale)) > 1e-9:
        sys.exit("no longer as written: Pillow returns other values or another scale")
    if not np.allclose(got, depth / abs(scale), rtol=1e-6):
        sys.exit("no longer as written: OpenCV does not divide by the scale")

normals = np.zeros((2, 3, 3), np.float32)
normals[..., 2] = 1
got = read(-2.0, "PF", normals)
# OpenCV's order of channels is the reverse one.
print(f"scale -2.0, three channels: stored (0, 0, 1), OpenCV {tuple(got[0, 0, ::-1].tolist())}")
if not np.array_equal(got[..., ::-1], normals / 2):
    sys.exit("no longer as written: OpenCV does not divide three channels")
PY
