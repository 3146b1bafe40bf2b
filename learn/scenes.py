"""Scenes that `thirdbounce simulate --family A..B --inputs --out FOLDER` wrote."""

import json
import pathlib

import numpy as np
import torch

from network import DEEP, NEAR, SIDE


class Scenes(torch.utils.data.Dataset):
    """Of every whole scene of folders: bands, kind of pairs, mask [2x, 2y], and depth of the surface in voxels [2x, 2y]."""

    def __init__(self, folders, few=False):
        found = sorted(path for folder in folders for path in pathlib.Path(folder).glob("s*.json"))
        self.found = [path for path in found if file(path, "i", "npy").exists()]
        if not self.found and not few:
            raise SystemExit(f"{folders}: no scenes; write some with thirdbounce simulate --family A..B --coarse --inputs --out FOLDER")

    def __len__(self):
        return len(self.found)

    def seed(self, i):
        return int(self.found[i].stem[1:])

    def __getitem__(self, i):
        return Scenes.read(self.found[i])

    @staticmethod
    def read(path, at=None):
        """A scene, or the quarter of its box that begins at a column."""
        kind, mask, depth = truth(path)
        bands = np.load(file(path, "i", "npy"), mmap_mode="r")
        if at:
            x, y = (slice(a, a + SIDE // 2) for a in at)
            bands, (mask, depth) = bands[:, x, y], (of[2 * x.start : 2 * x.stop, 2 * y.start : 2 * y.stop] for of in (mask, depth))
        return torch.from_numpy(np.array(bands)), kind, torch.from_numpy(np.array(mask)), torch.from_numpy(np.array(depth))


def file(path, kind, ending):
    return path.with_name(f"{kind}{path.stem[1:]}.{ending}")


def remove(path):
    """Removes a scene."""
    for of in (path, file(path, "i", "npy"), file(path, "t", "npz"), file(path, "c", "npz"), file(path, "a", "npz")):
        of.unlink(missing_ok=True)


def truth(path):
    about = json.loads(path.read_text())
    truth = np.load(file(path, "t", "npz"))
    x0, x1, y0, y1 = about["extent"]
    wall = max(x1 - x0, y1 - y0)
    # The box of the network covers what the capture covers, which is a little less than the wall where pairs are irregular.
    n, (left, right, low, high) = 2 * SIDE, truth["gt_extent"]
    places = (np.arange(n) + 0.5) / n * wall - 0.5 * wall
    pixels = lambda middle, a, b, count: np.floor((middle + places - a) / (b - a) * count).astype(int)
    count = truth["gt_mask"].shape
    x = pixels(0.5 * (x0 + x1), left, right, count[0])
    y = pixels(0.5 * (y0 + y1), low, high, count[1])
    inside = ((x >= 0) & (x < count[0]))[:, None] & ((y >= 0) & (y < count[1]))[None]
    at = np.ix_(x.clip(0, count[0] - 1), y.clip(0, count[1] - 1))
    depth = (truth["gt_depth"][at] / wall - NEAR) * SIDE - 0.5
    # What lies beyond the box cannot be seen.
    with np.errstate(invalid="ignore"):
        mask = truth["gt_mask"][at].astype(bool) & inside & (depth > 0) & (depth < DEEP - 1)
    return about["kind"], mask, np.where(mask, depth, 0).astype(np.float32)
