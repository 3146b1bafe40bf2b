"""Trains the network: `train.py SCENES... --out FOLDER`. Resumes from FOLDER/checkpoint.pt if it exists. Writes FOLDER/weights.safetensors."""

import argparse
import math
import pathlib
import time

import numpy as np
import torch
import torch.nn.functional as F

import network
from scenes import Scenes

WARM, CLIP, DECAY = 100, 1.0, 0.999  # steps of a rising rate; largest norm of a gradient; averaging of weights


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="+", help="folders of scenes to train on")
    parser.add_argument("--out", required=True, type=pathlib.Path)
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--rate", type=float, default=2e-3, help="largest learning rate; 6e-4 to go on from trained weights")
    parser.add_argument("--from", dest="start", help="weights.safetensors to begin with")
    parser.add_argument("--head", action="store_true", help="train the layers of the mask alone; needs --from")
    parser.add_argument("--every", type=int, default=200, help="steps between checkpoints")
    parser.add_argument("--widths", type=int, nargs=4, default=(8, 16, 32, 64))
    parser.add_argument("--workers", type=int, default=2, help="processes that read scenes")
    given = parser.parse_args()
    if given.head and not given.start:
        parser.error("--head needs --from")
    return given


def halves(device):
    """Whether the processor computes in bfloat16 without detours."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported()
    return torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported()


def mask_loss(logits, mask):
    """Cross-entropy of the mask, and half of what its soft intersection over union lacks."""
    p, m = logits.sigmoid(), mask.float()
    both = (p * m).flatten(1).sum(1)
    union = (p + m - p * m).flatten(1).sum(1).clamp(min=1)
    return F.binary_cross_entropy_with_logits(logits, m) + 0.5 * (1 - both / union).mean()


def depth_loss(logits, mask, depth):
    """Cross-entropy of the nearest surface of 2 x 2 pixels, shared by the two voxels around it."""
    nearest = -F.max_pool2d(torch.where(mask, -depth, -1e9)[:, None], 2)[:, 0]
    on = nearest < 1e8
    at = nearest.clamp(0, network.DEEP - 1.001)
    low = at.long()
    share = (at - low)[..., None]
    logp = logits.log_softmax(-1).gather(-1, torch.stack([low, low + 1], -1))
    entropy = -(torch.cat([1 - share, share], -1) * logp).sum(-1)
    return (entropy * on).sum() / on.sum().clamp(min=1)


def mirrored(volume, *maps):
    """Flips and transposes along x and y, at random: axes 2 and 3 of a volume, 1 and 2 of maps."""
    for axis in (0, 1):
        if torch.rand(()) < 0.5:
            volume, maps = volume.flip(2 + axis), [m.flip(1 + axis) for m in maps]
    if torch.rand(()) < 0.5:
        volume, maps = volume.transpose(2, 3), [m.transpose(1, 2) for m in maps]
    return volume, *maps


class Features(torch.utils.data.Dataset):
    """The scenes as the head sees them, computed once."""

    def __init__(self, scenes, net, device, folder):
        self.scenes = scenes
        folder.mkdir(parents=True, exist_ok=True)
        self.files = [folder / f"{scenes.seed(i)}.npy" for i in range(len(scenes))]
        for i, file in enumerate(self.files):
            if not file.exists():
                bands, kind, *_ = scenes[i]
                with torch.no_grad():
                    seen, _ = net.features(bands[None].float().to(device), torch.tensor([kind], device=device))
                np.save(file, seen[0].half().cpu().numpy())

    def __len__(self):
        return len(self.files)

    def __getitem__(self, i):
        kind, mask, depth = self.scenes.truth(i)
        return torch.from_numpy(np.load(self.files[i])), kind, torch.from_numpy(mask), torch.from_numpy(depth)


def batches(data, given, step):
    """Endless batches in a new order each time round, from the one that follows this many steps."""
    per = max(1, len(data) // given.batch)
    for around in range(step // per, 1 << 30):
        order = torch.randperm(len(data), generator=torch.Generator().manual_seed(around)).tolist()
        order = order[(step % per) * given.batch if around == step // per else 0 : per * given.batch]
        yield from torch.utils.data.DataLoader(data, given.batch, sampler=order, num_workers=given.workers)


def main():
    given = arguments()
    torch.manual_seed(0)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    net = network.load(given.start) if given.start else network.Network(given.widths)
    net = net.to(device)
    # Half the time of a step on CPUs.
    for p in net.parameters():
        p.data = p.data.contiguous(memory_format=torch.channels_last_3d) if p.dim() == 5 else p.data
    data = Scenes(given.scenes)
    if given.head:
        data = Features(data, net, device, given.out / "features")
    learned = [p for name, p in net.named_parameters() if not given.head or name[:2] in ("m0", "m1", "m2", "m3")]
    optimiser = torch.optim.AdamW(learned, lr=given.rate, weight_decay=1e-2, betas=(0.9, 0.98))
    mean = {name: values.detach().clone() for name, values in net.state_dict().items()}
    checkpoint, step = given.out / "checkpoint.pt", 0
    if checkpoint.exists():
        kept = torch.load(checkpoint, map_location=device)
        net.load_state_dict(kept["net"])
        optimiser.load_state_dict(kept["optimiser"])
        mean, step = kept["mean"], kept["step"]
    print(f"{len(data)} scenes, {sum(p.numel() for p in learned)} parameters, from step {step}, on {device}", flush=True)
    given.out.mkdir(parents=True, exist_ok=True)
    begin, losses = time.time(), []
    for seen, kind, mask, depth in batches(data, given, step):
        if step >= given.steps:
            break
        rate = given.rate * min(1, (step + 1) / WARM) * (0.5 + 0.5 * math.cos(math.pi * step / given.steps))
        optimiser.param_groups[0]["lr"] = rate
        seen, mask, depth = mirrored(seen.to(device).float(), mask.to(device), depth.to(device))
        with torch.autocast(device.type, torch.bfloat16, enabled=halves(device)):
            if given.head:
                loss = mask_loss(net.head(seen), mask)
            else:
                seen = seen.contiguous(memory_format=torch.channels_last_3d)
                of_depth, of_mask = net(seen, kind.to(device))
                loss = mask_loss(of_mask, mask) + 0.15 * depth_loss(of_depth, mask, depth)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(learned, CLIP)
        optimiser.step()
        step += 1
        losses.append(loss.item())
        share = max(0.0, min(DECAY, 1 - 10 / (step + 1))) if step > 20 else 0.0
        for name, values in net.state_dict().items():
            mean[name].lerp_(values, 1 - share)
        if step % given.every == 0 or step == given.steps:
            print(f"step {step}: loss {np.mean(losses[-given.every:]):.4f}, {time.time() - begin:.0f} s", flush=True)
            kept = {"net": net.state_dict(), "optimiser": optimiser.state_dict(), "mean": mean, "step": step}
            torch.save(kept, checkpoint.with_suffix(".new"))
            checkpoint.with_suffix(".new").replace(checkpoint)
            network.save(mean, given.out / "weights.safetensors")


if __name__ == "__main__":
    main()
