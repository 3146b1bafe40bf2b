"""Writes the averaged weights of a checkpoint as the engine reads them, and prints what the network says of one input.

`export.py CHECKPOINT.pt WEIGHTS.safetensors`, or their mean with the weights that training began with. As `src/learned/weights.safetensors` they are part of the next build. The numbers are the
expected ones of `tests/solvers/learned.rs`, which compares the engine with them."""

import argparse

import numpy as np
import torch

import network

PIXELS = [(0, 0), (5, 100), (64, 60), (90, 70), (100, 64), (127, 127)]
COLUMNS = [(17, 19), (40, 25), (47, 41)]


def bands():
    """A tilted plate and some haze, as in the test."""
    i = np.arange(network.BANDS * network.SIDE**2 * network.DEEP)
    b, x, y, z = np.unravel_index(i, (network.BANDS, network.SIDE, network.SIDE, network.DEEP))
    inside = (abs(x - 32) < 16) & (abs(y - 30) < 12)
    plate = np.where(inside, 6 / (1 + (z - (40 + 0.25 * x)) ** 2), 0)
    values = plate * (1 - 0.3 * b) + (i * 2654435761 % 1000) / 5000 - 0.1
    shape = (1, network.BANDS, network.SIDE, network.SIDE, network.DEEP)
    return torch.from_numpy(values.astype(np.float32).reshape(shape))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoint")
    parser.add_argument("weights")
    parser.add_argument("--first", help="weights that training began with, of which the share is kept (Wortsman et al. 2022): other light is not unlearned")
    parser.add_argument("--share", type=float, default=0.25, help="of the first weights")
    given = parser.parse_args()
    mean = torch.load(given.checkpoint, map_location="cpu")["mean"]
    if given.first:
        first = network.load(given.first).state_dict()
        mean = {name: torch.lerp(values, first[name], given.share) for name, values in mean.items()}
    network.save(mean, given.weights)
    net = network.load(given.weights).eval()
    for kind in (0, 2):
        with torch.no_grad():
            depth, mask = (answer[0].numpy() for answer in net(bands(), torch.tensor([kind])))
        pixels = ", ".join(f"({x}, {y}, {mask[x, y]:.4f})" for x, y in PIXELS)
        columns = ", ".join(f"({x}, {y}, {depth[x, y].argmax()}, {depth[x, y].max():.4f})" for x, y in COLUMNS)
        print(f"({kind}, [{pixels}], [{columns}], {(mask > 0).sum()}),")


if __name__ == "__main__":
    main()
