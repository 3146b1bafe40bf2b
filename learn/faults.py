"""Gives captures a fault of the instrument each: `faults.py SCENES... --out FOLDER`.

Of every c7.npz, the folder gets another one with a random fault of random strength, and its truth t7.npz. Whole counts stay whole: photons
are lost, and take one of two bins, by chance."""

import argparse
import pathlib
import random
import shutil

import numpy as np


class Capture:
    def __init__(self, path, seed):
        self.file, self.random, self.chance = dict(np.load(path)), random.Random(seed), np.random.default_rng(seed)
        counts = self.file["H"]
        self.is_whole = counts.dtype.kind in "iu" or bool((counts == np.round(counts)).all())
        self.counts, self.scan, self.bin = counts.astype(float), counts.shape[1:], float(self.file["delta_t"])
        self.laser, self.sensor = (np.broadcast_to(self.file[name].reshape(-1, 3) if self.file[name].size == 3 else self.file[name].reshape(*self.scan, 3), (*self.scan, 3)) for name in ("laser_xyz", "sensor_xyz"))
        points = np.concatenate([self.laser.reshape(-1, 3), self.sensor.reshape(-1, 3)])
        low, high = points.min(0), points.max(0)
        self.middle, self.half = 0.5 * (low + high), 0.5 * max(high[:2] - low[:2])

    def part(self, counts, share):
        return self.chance.binomial(counts.astype(int), np.clip(np.broadcast_to(share, counts.shape), 0, 1)) if self.is_whole else counts * share

    def weigh(self, gains):
        self.counts = self.part(self.counts, (gains / gains.max())[None])

    def delay(self, metres):
        """Later by metres of path of every pair."""
        by = np.broadcast_to(metres / self.bin, self.scan)
        low, bins, later = np.floor(by).astype(int), len(self.counts), np.zeros_like(self.counts)
        up = self.part(self.counts, (by - low)[None])
        for pair in np.ndindex(*self.scan):
            for of, at in ((self.counts - up, low[pair]), (up, low[pair] + 1)):
                row = of[(slice(None), *pair)]
                to, begin = max(at, 0), max(-at, 0)
                count = max(0, bins - to - begin)
                later[(slice(to, to + count), *pair)] += row[begin : begin + count]
        self.counts = later

    def place(self, of):
        """Points at other places, by a function of halves of the wall."""
        for name in ("laser_xyz", "sensor_xyz"):
            points = self.file[name].reshape(-1, 3).astype(float)
            points[:, :2] = self.middle[:2] + self.half * of(((points - self.middle) / self.half)[:, :2])
            self.file[name] = points.reshape(self.file[name].shape)


def device(c, amount, sign, both):
    """The light of laser, or of both, weakens from a device before the wall."""
    at = c.middle + c.half * np.array([c.random.uniform(-3, 3), c.random.uniform(-3, 3), np.exp(c.random.uniform(-0.7, 1.4))])
    fall = lambda points: at[2] / np.linalg.norm(points - at, axis=-1) ** 3
    c.weigh(fall(c.laser) * (fall(c.sensor) if both else 1))


def keystone(c, amount, sign):
    along = c.random.randrange(2)
    c.place(lambda p: p * np.where(np.arange(2) == along, 1 + 0.35 * sign * amount * p[:, 1 - along, None], 1))


def lean(c, amount, sign):
    angle, middle = c.random.uniform(0, 6.28), (0.5 * (c.laser + c.sensor) - c.middle) / c.half
    c.delay(0.3 * amount * c.half * (1 + middle[..., 0] * np.cos(angle) + middle[..., 1] * np.sin(angle)))


def walk(c, amount, sign):
    light = c.counts.sum(0) + 1e-9
    c.delay(0.12 * sign * amount * c.half * np.log(np.maximum(light / light.mean(), 1e-3)))


def bins(c, amount, sign):
    factor = np.exp(0.25 * sign * amount)
    c.file.update(delta_t=np.float64(c.bin * factor), t_start=np.float64(float(c.file["t_start"]) * factor))


def zero(c, amount, sign):
    c.file["t_start"] = np.float64(float(c.file["t_start"]) + 0.8 * sign * amount * c.half)


def echo(c, amount, sign):
    echoes = [(c.random.uniform(0.1, 0.7) * amount, sign * c.random.uniform(0.03, 0.4) * c.half) for _ in range(c.random.choice([1, 1, 2, 3]))]
    whole, all_light = c.counts, 1 + sum(share for share, _ in echoes)
    total = c.part(whole, 1 / all_light)
    for share, metres in echoes:
        c.counts = c.part(whole, share / all_light)
        c.delay(np.float64(metres))
        total = total + c.counts
    c.counts = total


def power(c, amount, sign):
    along, gains = c.random.randrange(len(c.scan)), np.ones(c.scan)
    lines = np.moveaxis(gains, along, 0)
    lines[c.random.randrange(1, max(2, len(lines))) :] = np.exp(sign * amount)
    c.weigh(gains)


def copied(c, amount, sign):
    each = c.random.choice([2, 4])
    c.counts = c.counts[:, np.arange(c.scan[0]) // each * each]


def laser(c, amount, sign):
    off = np.array([c.random.uniform(-0.5, 0.5), c.random.uniform(-0.5, 0.5), 0]) * c.half * amount
    c.file["laser_xyz"] = c.laser + off


FAULTS = [
    lambda c, a, s: device(c, a, s, False),
    lambda c, a, s: device(c, a, s, True),
    lambda c, a, s: c.place(lambda p: p * (1 + 0.25 * s * a * (p**2).sum(1, keepdims=True))),
    keystone,
    lambda c, a, s: c.place(lambda p: p + np.stack([0.4 * s * a * p[:, 1], 0 * p[:, 0]], 1)),
    lambda c, a, s: c.place(lambda p: p * np.roll([1, 1 - 0.4 * a], c.random.randrange(2))),
    lambda c, a, s: c.place(lambda p: p * np.exp(0.3 * s * a)),
    bins, lean, walk, zero, echo, power, copied, laser,
]  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", type=pathlib.Path, help="folders of c7.npz and t7.npz")
    parser.add_argument("--out", required=True, type=pathlib.Path, help="folder of the faulty ones")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    for path in sorted(path for folder in given.scenes for path in folder.glob("c*.npz")):
        capture = Capture(path, int(path.stem[1:]))
        amount, sign = capture.random.random() ** 0.7, capture.random.choice([-1, 1])
        capture.random.choice(FAULTS)(capture, amount, sign)
        kind = capture.file["H"].dtype if capture.is_whole else np.float32
        np.savez(given.out / path.name, **{**capture.file, "H": capture.counts.astype(kind)})
        shutil.copy(path.with_name(f"t{path.stem[1:]}.npz"), given.out)


if __name__ == "__main__":
    main()
