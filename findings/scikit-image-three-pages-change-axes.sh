#!/bin/sh
# scikit-image 0.26.0 with tifffile 2026.3.3, numpy 2.4.6: stacks of three or four pages are read with other axes.
#
# Guess: a TIFF file of n float32 pages, one a gate or a depth, is read as (n, rows, columns), as by tifffile.
# Seen:  so for two, five and more. With three or four pages imread() moves the pages to the end, as if they were
#        colours, also where the file says that its pixels are grey. What imsave() wrote is then not what imread()
#        returns. If one of the next axes is as long as the pages, code that takes stack[0] for the first gate goes on
#        with the first row of all gates. In four axes, gates by delays, the last but two is moved.
# Output:
#   2 pages: tifffile (2, 6, 7), skimage (2, 6, 7), imsave and imread (2, 6, 7)
#   3 pages: tifffile (3, 6, 7), skimage (6, 7, 3), imsave and imread (6, 7, 3)
#   4 pages: tifffile (4, 6, 7), skimage (6, 7, 4), imsave and imread (6, 7, 4)
#   5 pages: tifffile (5, 6, 7), skimage (5, 6, 7), imsave and imread (5, 6, 7)
#   9 x 3 pages: tifffile (9, 3, 8, 7), skimage (9, 8, 7, 3)
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 scipy==1.17.1 \
    tifffile==2026.3.3 scikit-image==0.26.0
cd "$work"
"$work/venv/bin/python" - <<'PY'
import sys

import numpy as np
import skimage.io
import tifffile

for pages in (2, 3, 4, 5):
    stack = np.arange(pages * 6 * 7, dtype=np.float32).reshape(pages, 6, 7)
    tifffile.imwrite("gates.tif", stack, photometric="minisblack")
    by_tifffile, by_skimage = tifffile.imread("gates.tif"), skimage.io.imread("gates.tif")
    skimage.io.imsave("saved.tif", stack, check_contrast=False)
    again = skimage.io.imread("saved.tif")
    print(f"{pages} pages: tifffile {by_tifffile.shape}, skimage {by_skimage.shape}, imsave and imread {again.shape}")
    if not np.array_equal(by_tifffile, stack):
        sys.exit("no longer as written: tifffile does not return what was written")
    wanted = np.moveaxis(stack, 0, -1) if pages in (3, 4) else stack
    if not (np.array_equal(by_skimage, wanted) and np.array_equal(again, wanted)):
        sys.exit("no longer as written: skimage returns other axes")

# Nine gates, three depths each.
stack = np.arange(9 * 3 * 8 * 7, dtype=np.uint16).reshape(9, 3, 8, 7)
tifffile.imwrite("gates.tif", stack, photometric="minisblack")
got = skimage.io.imread("gates.tif")
print(f"9 x 3 pages: tifffile {tifffile.imread('gates.tif').shape}, skimage {got.shape}")
if not np.array_equal(got, np.moveaxis(stack, 1, -1)):
    sys.exit("no longer as written: skimage returns four axes otherwise")
PY
