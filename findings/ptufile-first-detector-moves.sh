#!/bin/sh
# ptufile 2026.2.6 with numpy 2.4.6: the axis of detectors begins at the first one that has a photon.
#
# Guess: index k of axis C of an image is the detector k, and the last axis has all bins; what saw nothing stays
#        zero.
# Seen:  detectors before the first one and behind the last one with photons are left out, empty ones between are
#        kept. If the first detector saw nothing, the second one's photons stand at index 0, where those of the
#        first are looked for. The bins end with that of the longest delay likewise, so that two records of one
#        instrument differ in length. What imwrite stored is not what imread returns. active_channels tells the
#        numbers.
# Output:
#   all detectors: (1, 4, 5, 3, 50) -> (1, 4, 5, 3, 50), photons per index of C [1000, 2000, 3000], active (0, 1, 2)
#   none in detector 1: (1, 4, 5, 3, 50) -> (1, 4, 5, 3, 50), photons per index of C [1000, 0, 3000], active (0, 2)
#   none in detector 0: (1, 4, 5, 3, 50) -> (1, 4, 5, 2, 50), photons per index of C [2000, 3000], active (1, 2)
#   none in detector 2: (1, 4, 5, 3, 50) -> (1, 4, 5, 2, 50), photons per index of C [1000, 2000], active (0, 1)
#   none after bin 39: (1, 4, 5, 3, 50) -> (1, 4, 5, 3, 40), photons per index of C [800, 1600, 2400], active (0, 1, 2)
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 ptufile==2026.2.6
cd "$work"
"$work/venv/bin/python" - <<'PY'
import sys

import numpy as np
import ptufile


def through_a_file(name, counts):
    """Counts: frame, row, column, detector, bin."""
    ptufile.imwrite("scan.ptu", counts, 1e-7, 1e-10)
    got = ptufile.imread("scan.ptu")
    with ptufile.PtuFile("scan.ptu") as file:
        active = file.active_channels
    per_index = got.sum(axis=(0, 1, 2, 4)).tolist()
    print(f"{name}: {counts.shape} -> {got.shape}, photons per index of C {per_index}, active {active}")
    return got.shape, per_index


counts = np.ones((1, 4, 5, 3, 50), np.uint16)
counts[..., 1, :] *= 2
counts[..., 2, :] *= 3
all_of_them = through_a_file("all detectors", counts)
no_middle, no_first, no_last, no_end = (counts.copy() for _ in range(4))
no_middle[..., 1, :] = 0
no_first[..., 0, :] = 0
no_last[..., 2, :] = 0
no_end[..., 40:] = 0
no_middle = through_a_file("none in detector 1", no_middle)
no_first = through_a_file("none in detector 0", no_first)
no_last = through_a_file("none in detector 2", no_last)
no_end = through_a_file("none after bin 39", no_end)
if all_of_them != ((1, 4, 5, 3, 50), [1000, 2000, 3000]):
    sys.exit("no longer as written: a full array does not come back as it was")
if no_middle != ((1, 4, 5, 3, 50), [1000, 0, 3000]):
    sys.exit("no longer as written: an empty detector between others is not kept")
if no_first != ((1, 4, 5, 2, 50), [2000, 3000]):
    sys.exit("no longer as written: an empty first detector is not left out")
if no_last != ((1, 4, 5, 2, 50), [1000, 2000]):
    sys.exit("no longer as written: an empty last detector is not left out")
if no_end != ((1, 4, 5, 3, 40), [800, 1600, 2400]):
    sys.exit("no longer as written: bins after the last photon are not left out")
PY
