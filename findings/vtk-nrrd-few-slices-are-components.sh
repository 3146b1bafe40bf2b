#!/bin/sh
# VTK 9.7.2 with pynrrd 1.1.3, numpy 2.4.6: a NRRD volume of fewer than ten slices is read as a plane of vectors.
#
# Guess: three axes that the file calls "domain", with spacings, are read as three axes of voxels, however short.
# Seen:  if the first axis has nine samples or fewer, vtkNrrdReader takes it for the components of a vector: 9 x 20 x
#        30 voxels become one slice of 20 x 30 with nine components, and its spacings are those of the wrong axes.
#        With ten samples the volume is right. "kinds", "space directions" and "space dimension: 3" in the header
#        change nothing. A thin volume, cut to the depths of the hidden object, is then a plane for all filters that
#        follow, without a word.
# Output:
#   2 x 20 x 30: dimensions (20, 30, 1), components 2, spacing (0.2, 0.3, 1.0)
#   3 x 20 x 30: dimensions (20, 30, 1), components 3, spacing (0.2, 0.3, 1.0)
#   4 x 20 x 30: dimensions (20, 30, 1), components 4, spacing (0.2, 0.3, 1.0)
#   8 x 20 x 30: dimensions (20, 30, 1), components 8, spacing (0.2, 0.3, 1.0)
#   9 x 20 x 30: dimensions (20, 30, 1), components 9, spacing (0.2, 0.3, 1.0)
#   10 x 20 x 30: dimensions (10, 20, 30), components 1, spacing (0.1, 0.2, 0.3)
#   11 x 20 x 30: dimensions (11, 20, 30), components 1, spacing (0.1, 0.2, 0.3)
#   40 x 20 x 30: dimensions (40, 20, 30), components 1, spacing (0.1, 0.2, 0.3)
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 pynrrd==1.1.3 vtk==9.7.2
cd "$work"
"$work/venv/bin/python" - <<'PY'
import sys

import nrrd
import numpy as np
import vtk

spacing = (0.1, 0.2, 0.3)
for depths in (2, 3, 4, 8, 9, 10, 11, 40):
    volume = np.arange(depths * 20 * 30, dtype=np.float32).reshape(depths, 20, 30)
    header = {
        "kinds": ["domain"] * 3,
        "space dimension": 3,
        "space directions": np.diag(spacing),
        "space origin": np.zeros(3),
        "encoding": "raw",
    }
    nrrd.write("volume.nrrd", volume, header)
    reader = vtk.vtkNrrdReader()
    reader.SetFileName("volume.nrrd")
    reader.Update()
    image = reader.GetOutput()
    got = image.GetDimensions(), image.GetNumberOfScalarComponents(), tuple(round(x, 6) for x in image.GetSpacing())
    print(f"{depths} x 20 x 30: dimensions {got[0]}, components {got[1]}, spacing {got[2]}")
    as_vectors = (20, 30, 1), depths, (0.2, 0.3, 1.0)
    as_voxels = (depths, 20, 30), 1, spacing
    if got != (as_vectors if depths < 10 else as_voxels):
        sys.exit("no longer as written: the first axis is read otherwise")
PY
