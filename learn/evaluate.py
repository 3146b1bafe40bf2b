"""Measures weights on scenes that served no training: `evaluate.py WEIGHTS SCENES...`."""

import argparse
import copy

import numpy as np
import torch

import network
from scenes import Scenes

BINS = 10


def iou(mask, true):
    union = (mask | true).sum()
    return float((mask & true).sum() / union) if union else 1.0


def measured(net, state, folders):
    """Mean own IoU of weights on scenes, with the same layers."""
    measuring, data = copy.deepcopy(net).eval(), Scenes(folders)
    measuring.load_state_dict(state)
    device = next(net.parameters()).device
    rows = []
    for bands, kind, mask, _ in data:
        with torch.no_grad():
            _, logits = measuring(bands[None].float().to(device), torch.tensor([kind], device=device))
        rows.append(iou((logits[0] > 0).cpu().numpy(), mask.numpy()))
    return np.mean(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("weights")
    parser.add_argument("scenes", nargs="+")
    given = parser.parse_args()
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    net, data = network.load(given.weights).to(device).eval(), Scenes(given.scenes)
    rows, expected, found = [], np.zeros(BINS), np.zeros((BINS, 2))
    print("seed     own IoU  best IoU  at   depth, % of the wall")
    for i in range(len(data)):
        bands, kind, mask, depth = data[i]
        with torch.no_grad():
            of_depth, logits = net(bands[None].float().to(device), torch.tensor([kind], device=device))
        p, true = logits[0].sigmoid().cpu().numpy(), mask.numpy()
        at = network.most_probable(of_depth)[0].cpu().numpy().repeat(2, 0).repeat(2, 1)
        both = (p > 0.5) & true
        error = 100 / network.SIDE * np.abs(at - depth.numpy())[both].mean() if both.any() else float("nan")
        best = max((iou(p > t, true), t) for t in np.arange(0.05, 1, 0.05))
        rows.append([iou(p > 0.5, true), best[0], error])
        print(f"{data.seed(i):<8} {rows[-1][0]:7.3f} {best[0]:9.3f}  {best[1]:.2f} {error:6.2f}")
        bins = np.minimum((p * BINS).astype(int), BINS - 1)
        expected += np.bincount(bins.ravel(), p.ravel(), BINS)
        found += np.stack([np.bincount(bins.ravel(), w.ravel(), BINS) for w in (true, np.ones_like(p))], 1)
    rows = np.array(rows)
    print(f"mean     {rows[:, 0].mean():7.3f} {rows[:, 1].mean():9.3f}       {np.nanmedian(rows[:, 2]):6.2f} (median)")
    print("reliability: the network's probability, the share of pixels with surface, their number")
    for said, (hits, count) in zip(expected, found):
        if count:
            print(f"  {said / count:.3f}  {hits / count:.3f}  {count:.0f}")


if __name__ == "__main__":
    main()
