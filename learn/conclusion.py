"""Trains and measures the network of the conclusion: `conclusion.py SCENES... --unseen FOLDER --out FOLDER`.

Of every seed, a folder has what the network sees, l7.npz (`thirdbounce reconstruct c7.npz --layers l7.npz`), beside the truth t7.npz. Needs no
GPU: a step of four scenes takes .2 s of one core with bfloat16."""

import argparse
import math
import pathlib
import random

import numpy as np
import torch
import torch.nn as nn
import torch.nn.functional as F
from safetensors.torch import load_file, save_file

from train import mask_loss

# Voxels of the start's box along x; channels with the slopes along x and y; largest logarithm of the scale of a depth, smallest.
SIDE, SLOPES, SCALES = 64, (7, 8), (-5, 4)
# A Laplace law has 68 and 95 % of its errors below these multiples of its scale.
BOUNDS = 1.139, 2.996


class Block(nn.Module):
    def __init__(self, inputs, outputs):
        super().__init__()
        self.a, self.b = (nn.Conv2d(n, outputs, 3, padding=1) for n in (inputs, outputs))
        self.na, self.nb = nn.GroupNorm(4, outputs), nn.GroupNorm(4, outputs)
        self.skip = nn.Identity() if inputs == outputs else nn.Conv2d(inputs, outputs, 1)

    def forward(self, x):
        return F.silu(self.nb(self.b(F.silu(self.na(self.a(x))))) + self.skip(x))


class Conclusion(nn.Module):
    """Channels [scene, channel, x, y] to the logit of the mask, what depth lacks (voxels), and the logarithm of its Laplace scale."""

    def __init__(self, channels, widths=(16, 24, 32, 40)):
        super().__init__()
        self.stem = nn.Conv2d(channels, widths[0], 1)
        for i, (before, width) in enumerate(zip((widths[0],) + widths, widths)):
            self.add_module(f"e{i}", Block(before, width))
        for i, (fine, coarse) in enumerate(zip(widths, widths[1:])):
            self.add_module(f"f{i}", Block(coarse + fine, fine))
        self.out = nn.Conv2d(widths[0], 3, 1)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def forward(self, x):
        x0 = self.e0(self.stem(x))
        x1 = self.e1(F.avg_pool2d(x0, 2))
        x2 = self.e2(F.avg_pool2d(x1, 2))
        y = self.e3(F.avg_pool2d(x2, 2))
        for block, fine in ((self.f2, x2), (self.f1, x1), (self.f0, x0)):
            y = block(torch.cat([F.interpolate(y, scale_factor=2), fine], 1))
        return self.out(y)


class Scenes(torch.utils.data.Dataset):
    """Channels, true mask, what depth lacks in voxels, and the mask without the network, of every scene of folders."""

    def __init__(self, folders):
        self.found = sorted(path for folder in folders for path in pathlib.Path(folder).glob("l*.npz"))
        if not self.found:
            raise SystemExit(f"{folders}: no layers; write some with thirdbounce reconstruct c7.npz --layers l7.npz")

    def __len__(self):
        return len(self.found)

    def __getitem__(self, i):
        known, true = np.load(self.found[i]), np.load(self.found[i].with_name(f"t{self.found[i].stem[1:]}.npz"))
        n, extent, count = known["mask"].shape, known["extent"], true["gt_mask"].shape
        at = []
        for k in range(2):
            places = extent[2 * k] + (np.arange(n[k]) + 0.5) / n[k] * (extent[2 * k + 1] - extent[2 * k])
            low, high = true["gt_extent"][2 * k : 2 * k + 2]
            at.append(np.floor((places - low) / (high - low) * count[k]).astype(int))
        inside = [(a >= 0) & (a < size) for a, size in zip(at, count)]
        at = np.ix_(*(a.clip(0, size - 1) for a, size in zip(at, count)))
        mask = true["gt_mask"][at].astype(bool) & inside[0][:, None] & inside[1]
        base, wall = known["wall"]
        lacks = np.where(mask, ((true["gt_depth"][at] - base) / wall - known["depth"]) * SIDE, 0)
        return tuple(map(torch.from_numpy, (known["channels"].astype(np.float32), mask, lacks.astype(np.float32), known["mask"])))


def mirrored(x, *maps):
    """Flips and transposes along x and y, at random; slopes change their signs and places."""
    x = x.clone()
    for axis in (0, 1):
        if random.random() < 0.5:
            x, maps = x.flip(2 + axis), [m.flip(1 + axis) for m in maps]
            x[:, SLOPES[axis]] *= -1
    if random.random() < 0.5:
        x, maps = x.transpose(2, 3).clone(), [m.transpose(1, 2) for m in maps]
        x[:, list(SLOPES)] = x[:, list(SLOPES)[::-1]]
    return x, *maps


def loss_of(answer, mask, lacks):
    logits, depth, scale = answer.float().unbind(1)
    scale, on = scale.clamp(*SCALES), mask & (lacks.abs() < 16)
    errors = (depth - lacks).abs().clamp(max=8) * torch.exp(-scale) + scale
    return mask_loss(logits, mask) + 2 * F.binary_cross_entropy_with_logits(logits, mask.float()) + 0.15 * (errors * on).sum() / on.sum().clamp(min=1)


def best_share(p):
    """The probability from which on pixels are surface for the largest expected intersection over union, and that."""
    p = np.sort(p.ravel())[::-1].astype(np.float64)
    both, count = np.cumsum(p), np.arange(1, p.size + 1)
    share = both / (count + both[-1] - both)
    return p[share.argmax()], share.max()


def iou(a, b):
    return (a & b).sum() / max(1, (a | b).sum())


def measure(net, data):
    """Prints means over scenes."""
    rows, said, found, within = [], np.zeros(10), np.zeros((10, 2)), []
    for i in range(len(data)):
        x, mask, lacks, own = data[i]
        with torch.no_grad():
            logits, depth, scale = net.eval()(x[None])[0].float()
        p, mask, own = logits.sigmoid().numpy(), mask.numpy(), own.numpy()
        least, expected = best_share(p)
        rows.append([iou(own, mask), iou(p > 0.5, mask), iou(p >= least, mask), max(iou(p > t, mask) for t in np.arange(0.1, 0.95, 0.05)), expected])
        bins = np.minimum((p * 10).astype(int), 9).ravel()
        said += np.bincount(bins, p.ravel(), 10)
        found += np.stack([np.bincount(bins, mask.ravel().astype(float), 10), np.bincount(bins, minlength=10)], 1)
        both = (p >= least) & mask
        if both.any():
            errors = ((depth - lacks).abs() / scale.clamp(*SCALES).exp()).numpy()[both]
            within.append([(errors < bound).mean() for bound in BOUNDS])
    rows, some = np.array(rows), found[:, 1] > 0
    rules, half, best_expected, best, expected = rows.mean(0)
    print(f"{len(rows)} scenes: own IoU by rules {rules:.3f}, by probability .5 {half:.3f}, by the best expected IoU {best_expected:.3f}, by the best threshold {best:.3f}")
    print(f"expected IoU {expected:.3f}, correlation {np.corrcoef(rows[:, 2], rows[:, 4])[0, 1]:.2f}; worse than rules by .03: {(rows[:, 2] < rows[:, 0] - 0.03).sum()}")
    print(f"reliability {np.abs(said - found[:, 0])[some].__truediv__(found[some, 1]).mean():.3f}; depth errors within 68, 95 %: {np.mean(within, 0).round(2)}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", help="folders of scenes to train on; none: measure alone")
    parser.add_argument("--unseen", nargs="+", required=True, help="folders of scenes to measure with")
    parser.add_argument("--out", type=pathlib.Path, default="trained", help="folder of conclusion.safetensors")
    parser.add_argument("--from", dest="start", help="conclusion.safetensors to begin with")
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--batch", type=int, default=4)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--without", type=int, nargs="*", default=[], help="channels that are zero, to see what they are worth")
    given = parser.parse_args()
    unseen = Scenes(given.unseen)
    net = Conclusion(len(unseen[0][0])).to(memory_format=torch.channels_last)
    if given.start:
        net.load_state_dict({name: values.float() for name, values in load_file(given.start).items()})
    if given.scenes:
        train(net, Scenes(given.scenes), given)
        given.out.mkdir(parents=True, exist_ok=True)
        save_file({name: values.half().contiguous() for name, values in net.state_dict().items()}, given.out / "conclusion.safetensors")
    measure(net, unseen)


def train(net, data, given):
    optimiser = torch.optim.AdamW(net.parameters(), lr=given.rate, weight_decay=1e-2, betas=(0.9, 0.98))
    mean = {name: values.clone() for name, values in net.state_dict().items()}
    loader, losses, step = torch.utils.data.DataLoader(data, given.batch, shuffle=True, drop_last=True), [], 0
    while step < given.steps:
        for x, mask, lacks, _ in loader:
            x, mask, lacks = mirrored(x, mask, lacks)
            x[:, given.without] = 0
            optimiser.param_groups[0]["lr"] = given.rate * min(1, (step + 1) / 50) * (0.5 + 0.5 * math.cos(math.pi * step / given.steps))
            with torch.autocast("cpu", torch.bfloat16):
                answer = net(x.contiguous(memory_format=torch.channels_last))
            loss = loss_of(answer, mask, lacks)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            nn.utils.clip_grad_norm_(net.parameters(), 1.0)
            optimiser.step()
            losses.append(loss.item())
            step += 1
            for name, values in net.state_dict().items():
                mean[name].lerp_(values, 1 - min(0.99, 1 - 10 / (step + 10)))
            if step % 250 == 0:
                print(f"step {step}: loss {np.mean(losses[-250:]):.4f}", flush=True)
            if step == given.steps:
                break
    net.load_state_dict(mean)


if __name__ == "__main__":
    main()
