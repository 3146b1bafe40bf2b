#!/bin/sh
# y-tal 0.20.0 with numpy 1.26.4, h5py 3.16.0: downscale() leaves the wall's normals in their full number.
#
# Guess: NLOSCaptureData.downscale(2) thins all arrays that have one entry a point of the wall.
# Seen:  H and the positions shrink, sensor_grid_normals and laser_grid_normals do not. write_capture stores the two
#        sizes side by side and read_capture gives them back, so entry [i, j] of the normals belongs to another
#        place of the wall than entry [i, j] of the positions. On the curved wall below, what stands at the index of
#        the last position, in a corner, is the normal of a point near the wall's middle. Values of H are summed,
#        not averaged.
# Output:
#   Downscaled from 8x8 to 4x4
#   H (16, 4, 4)
#   sensor_grid_xyz (4, 4, 3)
#   laser_grid_xyz (4, 4, 3)
#   sensor_grid_normals (8, 8, 3)
#   laser_grid_normals (8, 8, 3)
#   x of the last position 0.60: its normal's x is about -0.60, entry [3, 3] has 0.10
#   largest value of H 4.0 of 1.0 before
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
# The other packages that y-tal asks for are those of its plots and renders.
"$work/venv/bin/pip" install --quiet --disable-pip-version-check --no-deps y-tal==0.20.0 numpy==1.26.4 h5py==3.16.0 \
    scipy==1.17.1 nptyping==2.5.0 PyYAML==6.0.3 tqdm==4.67.1
cd "$work"
HOME="$work" "$work/venv/bin/python" - <<'PY'
import sys

import numpy as np
import tal
from tal.enums import GridFormat, HFormat, VolumeFormat
from tal.io.capture_data import NLOSCaptureData

# A wall that is part of a cylinder about the y axis: at each x its normal leans.
x = np.linspace(-0.7, 0.7, 8)
across, up = np.meshgrid(x, x, indexing="ij")
points = np.stack([across, up, 1 - np.sqrt(1 - across**2)], -1)
normals = np.stack([-across, 0 * across, np.sqrt(1 - across**2)], -1)

capture = NLOSCaptureData()
capture.H = np.ones((16, 8, 8), np.float32)
capture.H_format = HFormat.T_Sx_Sy
capture.sensor_grid_format = capture.laser_grid_format = GridFormat.X_Y_3
capture.volume_format = VolumeFormat.X_Y_Z_3
capture.sensor_grid_xyz, capture.laser_grid_xyz = points.copy(), points.copy()
capture.sensor_grid_normals, capture.laser_grid_normals = normals.copy(), normals.copy()
capture.sensor_xyz = capture.laser_xyz = np.array([0.0, 0.0, 2.0])
capture.delta_t, capture.t_start = 0.01, 0.0
capture.t_accounts_first_and_last_bounces = False
capture.scene_info = {"made": "here"}

capture.downscale(2)
tal.io.write_capture("small.hdf5", capture)
small = tal.io.read_capture("small.hdf5")
names = ["H", "sensor_grid_xyz", "laser_grid_xyz", "sensor_grid_normals", "laser_grid_normals"]
shapes = [getattr(small, name).shape for name in names]
for name, shape in zip(names, shapes):
    print(name, shape)
at, given = small.sensor_grid_xyz[-1, -1, 0], small.sensor_grid_normals[3, 3, 0]
print(f"x of the last position {at:.2f}: its normal's x is about {-at:.2f}, entry [3, 3] has {given:.2f}")
print("largest value of H", small.H.max(), "of 1.0 before")
if shapes[:3] != [(16, 4, 4), (4, 4, 3), (4, 4, 3)]:
    sys.exit("no longer as written: H and the positions do not shrink to 4 x 4")
if shapes[3:] != [(8, 8, 3), (8, 8, 3)]:
    sys.exit("no longer as written: the normals change their number")
if not (abs(at - 0.6) < 1e-3 and abs(given - 0.1) < 1e-3):
    sys.exit("no longer as written: the normals are other ones")
if small.H.max() != 4:
    sys.exit("no longer as written: the values of H are not sums of four")
PY
