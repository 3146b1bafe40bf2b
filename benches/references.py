"""Times of the closed-form methods beside plain numpy and scipy versions of them, in one run on the same cores.

    python3 benches/references.py [CAPTURE ...] [--binary FILE] [--repeats N]

Without captures it simulates a letter, 32 x 32 and 64 x 64 points. A capture is an npz in the plain form (docs/data.md):
confocal, a square regular scan of a flat wall. Both sides run in turns. Each row holds the median of the seconds of both and
their ratio. Bounds: a Fourier method takes no longer than its reference on as many threads; filtered back-projection on the
Vulkan device is at least 5 times as fast as a vectorised back-projection on one thread. Ends with 1 if a bound is missed, and
says that it skips if numpy or scipy is absent.

The references are what a paper's published code does, in float32 where numpy allows: the same bins, scan and zero padding, without
reading files. Ours does more: it also brings the volume to 128 x 128 pixels, and makes maps, normals and a mask.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

try:
    import numpy as np
    from scipy import fft, sparse
    from scipy.ndimage import map_coordinates
except ImportError as missing:
    print(f"skipped: {missing.name} is not installed (pip install numpy scipy)")
    sys.exit(0)

THREADS = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
# Pairs that the back-projection's reference takes; its time for all is in proportion.
SOME_PAIRS = 48


class Scan:
    """Counts [N, N, M], places of the points and bins of a confocal capture."""

    def __init__(self, path):
        with np.load(path) as data:
            self.counts = np.moveaxis(data["H"].astype(np.float32), 0, 2)
            self.points = data["sensor_xyz"].reshape(-1, 3).astype(np.float32)
            self.bin, self.start = float(data["delta_t"]), float(data["t_start"])
        self.n, other, self.bins = self.counts.shape
        if self.n != other or len(self.points) != self.n**2:
            sys.exit(f"{path}: is no square confocal scan")
        # Published codes begin at path 0.
        self.from_zero = np.pad(self.counts, ((0, 0), (0, 0), (round(self.start / self.bin), 0)))
        x = self.points[:, 0]
        self.wall = float(x.max() - x.min()) * self.n / (self.n - 1)


def cube_of(scan):
    """Counts [M, N, N] with a power of two of bins, as the resampling of the light-cone transform needs."""
    counts = scan.from_zero
    bins = 1 << (counts.shape[2] - 1).bit_length()
    return np.ascontiguousarray(np.moveaxis(np.pad(counts, ((0, 0), (0, 0), (0, bins - counts.shape[2]))), 2, 0)), bins


def resampling(bins):
    """The matrices that take bins of time to cells of its square and back."""
    cell = np.arange(bins * bins)
    bin_of = np.ceil(np.sqrt(cell + 1)).astype(int) - 1
    to = sparse.csr_matrix((1 / np.sqrt(cell + 1), (cell, bin_of)), shape=(bins * bins, bins), dtype=np.float32)
    back = sparse.csr_matrix(to.T)
    for _ in range(bins.bit_length() - 1):
        to, back = 0.5 * (to[0::2] + to[1::2]), 0.5 * (back[:, 0::2] + back[:, 1::2])
    return to.tocsr(), back.tocsr()


def cone(scan, bins):
    """The light cone of one point, [2M, 2N, 2N], about the corner."""
    n, slope = scan.n, scan.wall / (bins * scan.bin)
    x, z = np.linspace(-1, 1, 2 * n, dtype=np.float32), np.linspace(0, 2, 2 * bins, dtype=np.float32)
    far = (2 * slope) ** 2 * (x[:, None] ** 2 + x[None] ** 2)
    psf = np.abs(far[None] - z[:, None, None])
    psf = (psf == psf.min(0, keepdims=True)).astype(np.float32)
    psf /= np.linalg.norm(psf)
    return np.roll(psf, (n, n), (1, 2)), x


def wide_spectrum(cube, scan, bins, to):
    wide = np.zeros((2 * bins, 2 * scan.n, 2 * scan.n), np.float32)
    falloff = np.linspace(0, 1, bins, dtype=np.float32)[:, None] ** 4
    wide[:bins, : scan.n, : scan.n] = to.dot(cube.reshape(bins, -1) * falloff).reshape(bins, scan.n, scan.n)
    return fft.fftn(wide, workers=THREADS)


def corner(spectrum, scan, bins, back):
    volume = fft.ifftn(spectrum, workers=THREADS)[:bins, : scan.n, : scan.n].real
    return back.dot(volume.reshape(bins, -1))


def lct(scan):
    """O'Toole and others 2018. The filter depends on the capture's size only: it is not timed, ours is."""
    cube, bins = cube_of(scan)
    to, back = resampling(bins)
    spectrum = fft.fftn(cone(scan, bins)[0], workers=THREADS)
    inverse = np.conj(spectrum) / (np.abs(spectrum) ** 2 + 1 / 0.8)

    def run():
        return corner(wide_spectrum(cube, scan, bins, to) * inverse, scan, bins, back)

    return run


def dlct(scan):
    """Young and others 2020: kernels of the three components, and a 3 x 3 system for every frequency."""
    cube, bins = cube_of(scan)
    to, back = resampling(bins)
    psf, x = cone(scan, bins)
    x = np.roll(x, scan.n)
    kernels = [psf * x[None, :, None], psf * x[None, None, :], psf]
    k = [fft.fftn(kernel, workers=THREADS) for kernel in kernels]

    def run():
        light = wide_spectrum(cube, scan, bins, to)
        # One measurement for three components: the system's matrix is of rank one and noise, and so is its solution.
        shared = light / (1 / 0.8 + sum(np.abs(kernel) ** 2 for kernel in k))
        return [corner(np.conj(kernel) * shared, scan, bins, back) for kernel in k]

    return run


def fk(scan):
    """Lindell and others 2019: Stolt's interpolation in the spectrum."""
    cube, bins = cube_of(scan)
    n = scan.n
    z, x = np.arange(-bins, bins, dtype=np.float32) / bins, np.arange(-n, n, dtype=np.float32) / n
    far = (n * bins * scan.bin / (bins * 2 * scan.wall)) ** 2 * (x[:, None] ** 2 + x[None] ** 2)

    def run():
        falloff = np.linspace(0, 1, bins, dtype=np.float32)[:, None, None] ** 4
        wide = np.zeros((2 * bins, 2 * n, 2 * n), np.complex64)
        wide[:bins, :n, :n] = np.sqrt(np.maximum(cube * falloff, 0))
        spectrum = fft.fftshift(fft.fftn(wide, workers=THREADS))
        long = np.sqrt(far[None] + z[:, None, None] ** 2)
        iy, ix = np.meshgrid(np.arange(2 * n), np.arange(2 * n), indexing="ij")
        at = [long * bins + bins, np.broadcast_to(iy, long.shape), np.broadcast_to(ix, long.shape)]
        moved = map_coordinates(spectrum.real, at, order=1) + 1j * map_coordinates(spectrum.imag, at, order=1)
        moved *= (z[:, None, None] > 0) * np.abs(z)[:, None, None] / np.maximum(long, 1e-6)
        return np.abs(fft.ifftn(fft.ifftshift(moved.astype(np.complex64)), workers=THREADS)[:bins, :n, :n]) ** 2

    return run


def phasor(scan):
    """Liu and others 2020: every depth is a convolution with the wave from it, frequency by frequency, as products of spectra."""
    n, wavelength = scan.n, 3 * scan.wall / scan.n
    deviation = 0.15 * 5 * wavelength
    side = fft.next_fast_len(2 * n)
    far = np.minimum(np.arange(side), side - np.arange(side)) * np.float32(scan.wall / n)
    far = far[:, None] ** 2 + far[None] ** 2
    depths = np.arange(0.2 * scan.wall, 0.5 * scan.from_zero.shape[2] * scan.bin, 0.5 * scan.bin)
    length = fft.next_fast_len(scan.from_zero.shape[2] + int(6 * deviation / scan.bin))
    omega = np.arange(length) * 2 * np.pi / (length * scan.bin)
    band = np.abs(omega - 2 * np.pi / wavelength) < 3 / deviation
    omega = omega[band]
    weight = np.exp(-0.5 * ((omega - 2 * np.pi / wavelength) * deviation) ** 2)

    def run():
        spectra = fft.fft(np.moveaxis(scan.from_zero, 2, 0), length, axis=0, workers=THREADS)[band] * weight[:, None, None]
        waves = fft.fft2(spectra.astype(np.complex64), (side, side), workers=THREADS)
        volume = np.zeros((len(depths), n, n), np.float32)
        for plane, z in zip(volume, depths):
            r = np.sqrt(far + np.float32(z * z))
            from_there = fft.fft2((np.exp(2j * omega[:, None, None] * r) / r).astype(np.complex64), workers=THREADS)
            plane[:] = np.abs(fft.ifft2((waves * from_there).sum(0)))[:n, :n]
        return volume

    return run


def back_projection(scan, voxels):
    """Sums of interpolated bins with the cosine, vectorised over a volume of this size, of some of the pairs; one thread."""
    x = np.linspace(-0.5, 0.5, voxels[0], dtype=np.float32) * np.float32(scan.wall)
    z = np.linspace(0.3, 1.0, voxels[2], dtype=np.float32) * np.float32(0.5 * scan.from_zero.shape[2] * scan.bin)
    at = np.stack(np.meshgrid(x, x, z, indexing="ij"), -1).reshape(-1, 3)
    counts = np.ascontiguousarray(scan.counts.reshape(-1, scan.bins))
    pairs = np.linspace(0, len(counts) - 1, SOME_PAIRS).astype(int)

    def run():
        volume = np.zeros(len(at), np.float32)
        for pair in pairs:
            arm = at - scan.points[pair]
            r = np.sqrt((arm * arm).sum(1))
            place = np.clip((2 * r - scan.start) / scan.bin - 0.5, 0, scan.bins - 1.001)
            low = place.astype(np.int32)
            share = place - low
            histogram = counts[pair]
            volume += (histogram[low] * (1 - share) + histogram[low + 1] * share) * (arm[:, 2] / r) * r**4
        return volume

    return run


def ours(binary, capture, method, out):
    """Solve seconds of one run, and its report."""
    command = [binary, "reconstruct", capture, "--solver", method, "--out", out, "--quiet"]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stderr}")
    report = json.loads((Path(out) / "report.json").read_text())
    return report["totals"]["solve_s"], report


def timed(run):
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def compare(binary, capture, repeats, folder):
    """Prints the rows of a capture; the bounds that it misses."""
    scan, missed = Scan(capture), []
    for method, reference in [("lct", lct), ("dlct", dlct), ("fk", fk), ("phasor", phasor), ("fbp", None)]:
        out = Path(folder) / method
        first, report = ours(binary, capture, method, out)
        times, factor, words = ([first], []), 1.0, "host, the same threads"
        if reference:
            run = reference(scan)
        else:
            n = [int(v) for v in report["settings"]["grid"]]
            # Maps of 128 pixels and more have voxels of two pixels.
            n[:2] = [v // 2 if v >= 128 else v for v in n[:2]]
            run, factor = back_projection(scan, n), scan.n**2 / SOME_PAIRS
            words = f"{report['device']['name'].split(' (')[0]} against one thread, {SOME_PAIRS} of {scan.n**2} pairs timed"
        for number in range(repeats):
            # What takes long is timed once.
            if number and times[0][0] < 10:
                times[0].append(ours(binary, capture, method, out)[0])
            if not times[1] or times[1][0] < 10 * factor:
                times[1].append(timed(run) * factor)
        mine, theirs = map(statistics.median, times)
        least = 1.0 if reference else 5.0
        verdict = "" if theirs / mine >= least else f" (below {least:g})"
        if verdict:
            missed.append(f"{method} on {Path(capture).name}")
        print(f"| {Path(capture).stem} | {method} | {mine:.3g} | {theirs:.3g} | {theirs / mine:.1f}{verdict} | {words} |", flush=True)
    return missed


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("captures", nargs="*")
    parser.add_argument("--binary", default=Path(__file__).parent.parent / "target/release/thirdbounce")
    parser.add_argument("--repeats", type=int, default=3)
    args = parser.parse_args()
    if not Path(args.binary).exists():
        sys.exit(f"{args.binary} is not there: make build, or give --binary")
    with tempfile.TemporaryDirectory() as folder:
        captures = args.captures
        if not captures:
            for side in (32, 64):
                file = Path(folder) / f"letter-{side}.npz"
                made = [args.binary, "simulate", "letter-Z", "--scan", side, "--noise", 0.05, "--out", file, "--quiet"]
                subprocess.run([str(part) for part in made], check=True, capture_output=True)
                captures.append(str(file))
        print(f"{THREADS} threads, medians of {args.repeats}, ours and numpy in turns\n")
        print("| capture | method | ours (s) | numpy (s) | numpy / ours | ours runs on |\n|---|---|--:|--:|--:|---|")
        missed = [bound for capture in captures for bound in compare(args.binary, capture, args.repeats, folder)]
    if missed:
        sys.exit("missed: " + ", ".join(missed))


if __name__ == "__main__":
    main()
