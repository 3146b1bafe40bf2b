"""Trains the network: `train.py SCENES[:SHARE]... --out FOLDER --minutes N`, from the last checkpoint if there is one. Writes FOLDER/weights.safetensors.

It can be stopped (Ctrl-C) and continued for ever: the rate stays, and the weights that are written are means over the last thousand steps."""

import argparse
import collections
import pathlib
import random
import signal
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
import torch.nn.functional as F

import network
from evaluate import measured
from scenes import Scenes, file, remove

# Steps of a rising rate; largest norm of a gradient; averaging of weights; seconds between looks for new scenes; batches read ahead.
WARM, CLIP, DECAY, LOOK, AHEAD = 100, 1.0, 0.999, 20, 2
# Weights of a teacher's mask and depths.
TAUGHT = 1.0, 0.3
START = pathlib.Path(__file__).with_name("start.safetensors")


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", help="folders of scenes to train on, each with its share of them all (1): drawn:3. New scenes are found")
    parser.add_argument("--out", required=True, type=pathlib.Path)
    parser.add_argument("--resume", action="store_true", help=f"begin with {START.name} of this folder where OUT has no checkpoint")
    parser.add_argument("--from", dest="start", type=pathlib.Path, help="weights.safetensors to begin with")
    parser.add_argument("--teacher", type=pathlib.Path, help="weights of a network at full resolution, whose answers are learned as well as the truth; at half resolution, layers of the same shape begin as its")
    parser.add_argument("--untaught", nargs="+", default=[], help="folders whose scenes are learned by their truth alone: the teacher has seen no such light")
    parser.add_argument("--full", action="store_true", help="train the network of the engine, which works on all voxels")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="stop after these")
    parser.add_argument("--steps", type=int, default=1 << 40, help="stop after these, of all runs together")
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--crop", type=float, default=0, help="share of batches that see a quarter of the box, for a quarter of the time")
    parser.add_argument("--uses", type=int, help="remove scenes that were used this often")
    parser.add_argument("--unseen", nargs="+", default=[], help="folders of scenes to measure with at every checkpoint")
    parser.add_argument("--every", type=int, default=100, help="steps between checkpoints")
    parser.add_argument("--widths", type=int, nargs="+")
    parser.add_argument("--compile", action="store_true", help="compile the network for this machine first (about a minute; needs a C++ compiler): a little more than half of the time a step")
    parser.add_argument("--threads", type=int, help="of the processor")
    given = parser.parse_args()
    if given.teacher and given.crop:
        parser.error("a teacher answers for the whole box: leave out --crop")
    if given.resume and START.exists():
        given.start = given.start or START
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


class Teacher:
    """Answers of a trained network, kept beside each scene in half precision: logits of depths and of the mask (Hinton et al. 2015)."""

    def __init__(self, path):
        self.net = network.load(path).eval()

    def answers(self, path, bands, kind):
        kept = file(path, "a", "npz")
        try:
            answer = np.load(kept)
            return answer["depth"], answer["mask"]
        except OSError:
            with torch.no_grad(), torch.autocast("cpu", torch.bfloat16, enabled=halves(torch.device("cpu"))):
                seen = bands[None].float().contiguous(memory_format=torch.channels_last_3d)
                depth, mask = (of[0].half().numpy() for of in self.net(seen, torch.tensor([kind])))
            np.savez(kept, depth=depth, mask=mask)
            return depth, mask


def taught_loss(of_depth, of_mask, depth, mask, weight):
    """Cross-entropies with a teacher's probabilities, by the weight of each scene; of depth, where it sees surface. Less the teacher's own entropies."""
    p, each = mask.float().sigmoid(), weight[:, None, None]
    lacks_mask = F.binary_cross_entropy_with_logits(of_mask, p, reduction="none") - F.binary_cross_entropy_with_logits(mask.float(), p, reduction="none")
    surface = each * F.max_pool2d(p[:, None], 2)[:, 0]
    q = depth.float().log_softmax(-1)
    lacks = (q.exp() * (q - of_depth.log_softmax(-1))).sum(-1)
    return (each * lacks_mask).mean(), (lacks * surface).sum() / surface.sum().clamp(min=1)


def loss_of(net, seen, kind, mask, depth, *taught):
    """The loss of a batch: by the truth and, with a teacher, by its depths, its mask and the weight of each scene."""
    with torch.autocast(seen.device.type, torch.bfloat16, enabled=halves(seen.device)):
        of_depth, of_mask = net(seen, kind)
    loss = mask_loss(of_mask, mask) + 0.15 * depth_loss(of_depth, mask, depth)
    if taught:
        lacks = taught_loss(of_depth, of_mask, *taught)
        loss = loss + TAUGHT[0] * lacks[0] + TAUGHT[1] * lacks[1]
    return loss


def mirrored(volume, *maps):
    """Flips and transposes along x and y, at random: axes 2 and 3 of a volume, 1 and 2 of maps."""
    for axis in (0, 1):
        if torch.rand(()) < 0.5:
            volume, maps = volume.flip(2 + axis), [m.flip(1 + axis) for m in maps]
    if torch.rand(()) < 0.5:
        volume, maps = volume.transpose(2, 3), [m.transpose(1, 2) for m in maps]
    return volume, *maps


class Supply:
    """Scenes of folders by their shares, those first that were used least."""

    def __init__(self, given, used):
        self.teacher = Teacher(given.teacher) if given.teacher else None
        self.given, self.used, self.looked = given, collections.Counter(used), -LOOK
        parts = [folder.rsplit(":", 1) if ":" in folder else (folder, 1) for folder in given.scenes]
        self.folders, self.shares = [folder for folder, _ in parts], [float(share) for _, share in parts]
        self.found, self.fresh = [], 0

    def look(self):
        """Scenes of every folder that are there now."""
        if time.monotonic() - self.looked > LOOK:
            self.found, self.looked = [Scenes([folder], few=True) for folder in self.folders], time.monotonic()
            if not any(map(len, self.found)):
                Scenes(self.folders)

    def uses(self):
        """How often the scenes that are there were used."""
        return {name: self.used[name] for name in (str(path) for data in self.found for path in data.found)}

    def names(self, count):
        """What to see next, and whether it is removed then: not the last scenes of a folder."""
        self.look()
        some = [i for i, data in enumerate(self.found) if len(data)]
        chosen = []
        for folder in random.choices(some, [self.shares[i] for i in some], k=count):
            data = self.found[folder].found
            least = min(self.used[str(path)] for path in data)
            path = random.choice([path for path in data if self.used[str(path)] == least])
            self.fresh += self.used[str(path)] == 0
            self.used[str(path)] += 1
            leaves = self.given.uses and self.used[str(path)] >= self.given.uses and len(data) > 4 * self.given.batch
            if leaves:
                data.remove(path)
            chosen.append((path, leaves))
        return chosen

    def batch(self, paths, crop):
        """The tensors of scenes, or of a quarter of the box of each."""
        scenes = []
        for path, leaves in paths:
            at = [random.randrange(0, network.SIDE // 2 + 1, 2) for _ in range(2)] if crop else None
            scene = Scenes.read(path, at)
            scenes.append(scene + self.taught(path, *scene[:2]))
            if leaves:
                remove(path)
        return [torch.stack([torch.as_tensor(scene[i]) for scene in scenes]) for i in range(len(scenes[0]))]

    def taught(self, path, bands, kind):
        """A teacher's answers and their weight, where there is a teacher."""
        if not self.teacher:
            return ()
        if any(pathlib.Path(folder) in path.parents for folder in self.given.untaught):
            return np.zeros((network.SIDE, network.SIDE, network.DEEP), np.float16), np.zeros((2 * network.SIDE, 2 * network.SIDE), np.float16), np.float32(0)
        return *self.teacher.answers(path, bands, kind), np.float32(1)

    def batches(self):
        """Endless batches, read ahead."""
        with ThreadPoolExecutor(1) as pool:
            waiting = collections.deque()
            while True:
                while len(waiting) < AHEAD:
                    waiting.append(pool.submit(self.batch, self.names(self.given.batch), random.random() < self.given.crop))
                yield waiting.popleft().result()


def begun(given, device):
    """The network, its optimiser, averaged weights, what is known of the training, and the uses of scenes. Of the training: steps, scenes that
    were seen (a quarter of a box is a quarter), how many they are, and hours."""
    checkpoint = given.out / "checkpoint.pt"
    kept = torch.load(checkpoint, map_location=device) if checkpoint.exists() else None
    about = {"step": 0, "seen": 0.0, "scenes": 0, "hours": 0.0}
    if given.start and not kept:
        net, said = network.load(given.start), network.said(given.start)
        about = {name: type(value)(said.get(name, value)) for name, value in about.items()}
    else:
        of = network.Network if given.full else network.Half
        net = of(given.widths) if given.widths else of()
        if given.teacher and not given.full:
            net.begin_as(network.load(given.teacher))
    if kept:
        net.load_state_dict(kept["net"])
        about = kept["about"]
    net = net.to(device)
    # Half the time of a step on CPUs.
    for p in net.parameters():
        p.data = p.data.contiguous(memory_format=torch.channels_last_3d) if p.dim() == 5 else p.data
    optimiser = torch.optim.AdamW(net.parameters(), lr=given.rate, weight_decay=1e-2, betas=(0.9, 0.98))
    if kept:
        optimiser.load_state_dict(kept["optimiser"])
    mean = kept["mean"] if kept else {name: values.detach().clone() for name, values in net.state_dict().items()}
    return net, optimiser, mean, about, kept["used"] if kept else {}


def main():
    given = arguments()
    if given.threads:
        torch.set_num_threads(given.threads)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    net, optimiser, mean, about, used = begun(given, device)
    supply = Supply(given, used)
    given.out.mkdir(parents=True, exist_ok=True)
    parameters, operations = network.cost(type(net)(net.widths))
    print(f"{parameters} parameters, {operations / 1e9:.2f} GFLOP, from step {about['step']}, on {device}", flush=True)
    # Normalisation, activations and sums in one pass of memory: a little more than half of the time on processors, after a minute of compiling.
    lost = torch.compile(loss_of) if given.compile else loss_of
    asked = []
    for by in (signal.SIGINT, signal.SIGTERM):
        signal.signal(by, lambda *_: asked.append(True))
    spent, before = time.process_time(), about["seen"]
    first, begin, losses, hours = about["step"], time.monotonic(), [], about["hours"]
    for seen, kind, mask, depth, *taught in supply.batches():
        is_last = asked or about["step"] >= given.steps or time.monotonic() - begin > 60 * given.minutes
        if is_last or about["step"] % given.every == 0 and about["step"] > first:
            about["hours"] = hours + (time.monotonic() - begin) / 3600
            about["scenes"], supply.fresh = about["scenes"] + supply.fresh, 0
            write(given, net, optimiser, mean, about, supply.uses())
            each = (time.process_time() - spent) / max(about["seen"] - before, 1e-9)
            of = f", own IoU {measured(net, mean, given.unseen):.3f}" if given.unseen else ""
            print(f"step {about['step']}: {about['seen']:.0f} scene-steps, {about['scenes']} scenes, loss {np.mean(losses[-given.every:] or 0):.4f}{of}, {60 * about['hours']:.0f} min, {each:.2f} CPU s a scene-step", flush=True)
            spent, before = time.process_time(), about["seen"]
        if is_last:
            break
        # The moments of the optimiser are new after a change of machines: the rate rises each time.
        optimiser.param_groups[0]["lr"] = given.rate * min(1, (about["step"] - first + 1) / WARM)
        seen, mask, depth, *answers = mirrored(seen.to(device).float(), *(of.to(device) for of in (mask, depth, *taught[:2])))
        loss = lost(net, seen.contiguous(memory_format=torch.channels_last_3d), kind.to(device), mask, depth, *answers, *(of.to(device) for of in taught[2:]))
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), CLIP)
        optimiser.step()
        about["step"] += 1
        about["seen"] += len(mask) * mask[0].numel() / (2 * network.SIDE) ** 2
        losses.append(loss.item())
        share = min(DECAY, 1 - 10 / (about["step"] + 10))
        for name, values in net.state_dict().items():
            mean[name].lerp_(values, 1 - share)


def write(given, net, optimiser, mean, about, used):
    """Writes the checkpoint and the averaged weights, each at once."""
    kept = {"net": net.state_dict(), "optimiser": optimiser.state_dict(), "mean": mean, "about": about, "used": used}
    checkpoint, weights = given.out / "checkpoint.pt", given.out / "weights.safetensors"
    torch.save(kept, checkpoint.with_suffix(".new"))
    network.save(mean, weights.with_suffix(".new"), about)
    for file in (checkpoint, weights):
        file.with_suffix(".new").replace(file)


if __name__ == "__main__":
    main()
