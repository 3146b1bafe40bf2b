"""Opens captures that thirdbounce wrote with y-tal, has y-tal's solvers find the target, and writes them with y-tal.

Usage: check_ytal.py OURS THEIRS X Y Z

OURS holds captures as NAME.hdf5 of one small target at (X, Y, Z) in metres. THEIRS is the folder for the same captures
as y-tal writes them. Needs y-tal (tal).
"""

import sys
from pathlib import Path

import numpy as np
import tal


def find(data, target):
    """Filtered back-projection around the target: the brightest voxel is there."""
    pitch = 0.02
    volume = tal.reconstruct.get_volume_min_max_resolution(target - 0.15, target + 0.15, pitch)
    camera = tal.enums.CameraSystem.DIRECT_LIGHT
    image = np.abs(tal.reconstruct.fbp.solve(data, 0.06, 0.04, volume_xyz=volume, camera_system=camera, progress=False))
    brightest = volume[np.unravel_index(image.argmax(), image.shape)]
    assert np.abs(brightest - target).max() <= 1.1 * pitch, f"the brightest voxel is {brightest}, not {target}"


def check(path, target):
    data = tal.io.read_capture(str(path))
    assert data.scene_info == {"name": path.stem, "source": "thirdbounce"}, data.scene_info
    assert data.is_confocal() == (path.stem == "confocal")
    for points, normals in (
        (data.laser_grid_xyz, data.laser_grid_normals),
        (data.sensor_grid_xyz, data.sensor_grid_normals),
    ):
        assert normals.shape == points.shape, (normals.shape, points.shape)
        assert np.allclose(np.linalg.norm(normals, axis=-1), 1)
    find(data, target)
    # The one function of y-tal that computes with normals. It needs a laser and real numbers.
    before = data.H.sum(axis=0)
    data.H = data.H.astype(np.float64)
    data.laser_xyz = np.array([0.3, 0.2, 1.5])
    tal.reconstruct.compensate_laser_cos_dsqr(data)
    to_laser = data.laser_xyz - data.laser_grid_xyz
    distance = np.linalg.norm(to_laser, axis=-1)
    cosine = (to_laser / distance[..., None] * data.laser_grid_normals).sum(axis=-1)
    factor = distance**2 / cosine
    if data.H.ndim == 5:
        factor = factor[..., None, None]
    assert np.allclose(data.H.sum(axis=0), factor * before)


ours, theirs = Path(sys.argv[1]), Path(sys.argv[2])
target = np.array([float(v) for v in sys.argv[3:6]])
files = sorted(ours.glob("*.hdf5"))
assert files, "there is nothing to open"
for path in files:
    check(path, target)
    tal.io.write_capture(str(theirs / path.name), tal.io.read_capture(str(path)))
print(f"y-tal opened and wrote {len(files)} captures")
