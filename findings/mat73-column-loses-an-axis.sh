#!/bin/sh
# mat73 0.65 with hdf5storage 0.2.2, h5py 3.16.0, scipy 1.17.1, numpy 2.4.6: a column of MATLAB comes as a flat array.
#
# Guess: a T x 1 variable of a MATLAB v7.3 file comes from mat73 as (T, 1), as scipy gives it from a v5 file.
# Seen:  it comes as (T,), and so does a row. Counts of T bins by N points minus a column with the background of
#        each bin are right with a v5 file; with a v7.3 file numpy takes the column for one value a point. That is
#        an error unless T = N: then other numbers come out without a word. T x 1 x N keeps its axes.
# Output:
#   v5.mat: column (4, 1), row (1, 4), T x 1 x N (4, 1, 3)
#   v5.mat: first bin less its background [0.0, 0.0, 0.0, 0.0]
#   v73.mat: column (4,), row (4,), T x 1 x N (4, 1, 3)
#   v73.mat: first bin less its background [0.0, -1.0, -2.0, -3.0]
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 scipy==1.17.1 h5py==3.16.0 \
    hdf5storage==0.2.2 mat73==0.65
cd "$work"
"$work/venv/bin/python" - <<'PY'
import sys

import hdf5storage
import mat73
import numpy as np
import scipy.io

# Four bins, four points, and a background that grows with the bin: nothing is left without it.
background = np.array([[1.0], [2.0], [3.0], [4.0]])
kept = {"H": background + np.zeros((4, 4)), "background": background, "row": background.T, "scan": np.zeros((4, 1, 3))}
scipy.io.savemat("v5.mat", kept)
hdf5storage.savemat("v73.mat", kept, format="7.3")
left = {}
shapes = {}
for name, read in {"v5.mat": scipy.io.loadmat, "v73.mat": mat73.loadmat}.items():
    got = read(name)
    shapes[name] = [got[key].shape for key in ("background", "row", "scan")]
    left[name] = got["H"] - got["background"]
    print(f"{name}: column {shapes[name][0]}, row {shapes[name][1]}, T x 1 x N {shapes[name][2]}")
    print(f"{name}: first bin less its background {left[name][0].tolist()}")
if shapes["v5.mat"] != [(4, 1), (1, 4), (4, 1, 3)] or left["v5.mat"].any():
    sys.exit("no longer as written: scipy reads other shapes")
if shapes["v73.mat"] != [(4,), (4,), (4, 1, 3)]:
    sys.exit("no longer as written: mat73 reads other shapes")
if left["v73.mat"][0].tolist() != [0, -1, -2, -3]:
    sys.exit("no longer as written: the difference is another one")
PY
