"""The network of the learned start, as `src/learned/network.rs` computes it, and its file of weights."""

import torch
import torch.nn as nn
import torch.nn.functional as F
from safetensors import safe_open
from safetensors.torch import load_file, save_file

# Voxels of the box along x and y, and along z; bands; kinds of pairs; the box's near end in walls. As `src/learned/sizes.rs`.
SIDE, DEEP, BANDS, KINDS, NEAR = 64, 96, 5, 3, 0.1


class Block(nn.Module):
    def __init__(self, inputs, outputs):
        super().__init__()
        self.a, self.b = (nn.Conv3d(n, outputs, 3, padding=1) for n in (inputs, outputs))
        self.na, self.nb = nn.GroupNorm(4, outputs), nn.GroupNorm(4, outputs)
        self.skip = nn.Identity() if inputs == outputs else nn.Conv3d(inputs, outputs, 1)

    def forward(self, x):
        return F.silu(self.nb(self.b(F.silu(self.na(self.a(x))))) + self.skip(x))


class Network(nn.Module):
    """Bands [scene, band, x, y, z] and kinds of pairs [scene] to logits of depths [scene, x, y, z] and of the mask [scene, 2x, 2y]."""

    def __init__(self, widths=(8, 16, 32, 64), mask=32):
        super().__init__()
        self.widths = tuple(widths)
        self.inp = nn.Conv3d(BANDS + KINDS + 1, widths[0], 3, padding=1)
        for i, width in enumerate(widths):
            self.add_module(f"e{i}", Block(width, width))
        for i, (fine, coarse) in enumerate(zip(widths, widths[1:])):
            self.add_module(f"d{i + 1}", nn.Conv3d(fine, coarse, 2, 2))
            self.add_module(f"u{i}", nn.ConvTranspose3d(coarse, fine, 2, 2))
            self.add_module(f"f{i}", Block(2 * fine, fine))
        self.depth = nn.Conv3d(widths[0], 1, 1)
        self.m0 = nn.Conv2d(2 * widths[0] + 2, mask, 3, padding=1)
        self.m1, self.m2 = (nn.Conv2d(mask, mask, 3, padding=1) for _ in range(2))
        self.m3 = nn.Conv2d(mask, 4, 3, padding=1)

    def features(self, bands, kind):
        """What the head sees [scene, feature, x, y], and the logits of depths."""
        box = (SIDE, SIDE, DEEP)
        of = F.one_hot(kind, KINDS).to(bands.dtype)[:, :, None, None, None].expand(-1, -1, *box)
        z = torch.linspace(-1, 1, DEEP, device=bands.device, dtype=bands.dtype).expand(len(bands), 1, *box)
        x0 = self.e0(self.inp(torch.cat([bands, of, z], 1)))
        x1 = self.e1(self.d1(x0))
        x2 = self.e2(self.d2(x1))
        y = self.f2(torch.cat([self.u2(self.e3(self.d3(x2))), x2], 1))
        y = self.f1(torch.cat([self.u1(y), x1], 1))
        y = self.f0(torch.cat([self.u0(y), x0], 1))
        depth = self.depth(y)[:, 0].float()
        mean = (y.float() * depth.softmax(-1)[:, None]).sum(-1)
        of_depth = torch.stack([depth.amax(-1), torch.logsumexp(depth, -1)], 1)
        return torch.cat([mean, y.amax(-1).float(), of_depth], 1), depth

    def head(self, features):
        f = F.silu(self.m0(features))
        f = f + F.silu(self.m1(f))
        f = f + F.silu(self.m2(f))
        return F.pixel_shuffle(self.m3(f), 2)[:, 0].float()

    def forward(self, bands, kind):
        features, depth = self.features(bands, kind)
        return depth, self.head(features)


class Once(nn.Module):
    """Half a block: one convolution beside what comes in."""

    def __init__(self, width):
        super().__init__()
        self.a, self.na = nn.Conv3d(width, width, 3, padding=1), nn.GroupNorm(4, width)

    def forward(self, x):
        return F.silu(self.na(self.a(x)) + x)


class Half(nn.Module):
    """As [`Network`], with voxels of 2 x 2 x 2 as channels of one: no layer works on all voxels. 3.8 GFLOP instead of 14.5."""

    def __init__(self, widths=(16, 32, 64), mask=48):
        super().__init__()
        self.widths = tuple(widths)
        self.inp = nn.Conv3d(8 * BANDS + KINDS + 1, widths[0], 1)
        for i, width in enumerate(widths):
            self.add_module(f"e{i}", Block(width, width))
        for i, (fine, coarse) in enumerate(zip(widths, widths[1:])):
            self.add_module(f"d{i + 1}", nn.Conv3d(fine, coarse, 2, 2))
            self.add_module(f"u{i}", nn.ConvTranspose3d(coarse, fine, 2, 2))
            self.add_module(f"f{i}", Once(fine))
        self.depth = nn.Conv3d(widths[0], 8, 1)
        self.m0 = nn.Conv2d(5 * widths[0] + 8, mask, 3, padding=1)
        self.m1, self.m2 = (nn.Conv2d(mask, mask, 3, padding=1) for _ in range(2))
        self.m3 = nn.Conv2d(mask, 16, 3, padding=1)

    def begin_as(self, full):
        """Takes over the layers of a trained [`Network`] at half resolution and below, which have the same shapes."""
        of = {"e0": "e1", "e1": "e2", "e2": "e3", "d1": "d2", "d2": "d3", "u1": "u2", "u0": "u1"}
        for own, other in of.items():
            getattr(self, own).load_state_dict(getattr(full, other).state_dict())

    def forward(self, bands, kind):
        n, _, x, y, z = bands.shape
        voxels = bands.view(n, BANDS, x // 2, 2, y // 2, 2, z // 2, 2).permute(0, 1, 3, 5, 7, 2, 4, 6).flatten(1, 4)
        box = voxels.shape[2:]
        of = F.one_hot(kind, KINDS).to(bands.dtype)[:, :, None, None, None].expand(-1, -1, *box)
        deep = torch.linspace(-1, 1, box[2], device=bands.device, dtype=bands.dtype).expand(n, 1, *box)
        seen = torch.cat([voxels, of, deep], 1).contiguous(memory_format=torch.channels_last_3d)
        x0 = self.e0(self.inp(seen))
        x1 = self.e1(self.d1(x0))
        y1 = self.f1(self.u1(self.e2(self.d2(x1))) + x1)
        y0 = self.f0(self.u0(y1) + x0)
        # [scene, x, y, z of a voxel's halves, x, y, z].
        depth = self.depth(y0).float().unflatten(1, (2, 2, 2))
        columns = torch.logsumexp(depth, 3).flatten(1, 2)
        mean = torch.einsum("nfxyz,ncxyz->ncfxy", y0.float(), columns.softmax(-1)).flatten(1, 2)
        f = torch.cat([mean, y0.amax(-1).float(), columns.amax(-1), torch.logsumexp(columns, -1)], 1)
        f = F.silu(self.m0(f))
        f = f + F.silu(self.m1(f))
        f = f + F.silu(self.m2(f))
        return depth.permute(0, 4, 1, 5, 2, 6, 3).reshape(n, x, y, z), F.pixel_shuffle(self.m3(f), 4)[:, 0].float()


def load(path):
    """The network of a file of weights, whose shapes give its widths."""
    kept = {name: values.float() for name, values in load_file(path).items()}
    levels = [f"e{i}.a.bias" for i in range(4)]
    of = Network if levels[3] in kept else Half
    net = of([len(kept[name]) for name in levels if name in kept], len(kept["m1.bias"]))
    net.load_state_dict(kept)
    return net


def save(state, path, about=None):
    """Writes weights in half precision, as the engine reads them, and words about them."""
    halves = {name: values.detach().cpu().half().contiguous() for name, values in state.items()}
    save_file(halves, path, {name: str(value) for name, value in (about or {}).items()})


def said(path):
    """The words in a file of weights."""
    with safe_open(path, "pt") as file:
        return file.metadata() or {}


def cost(net):
    """Parameters, and floating-point operations of one answer: two of each product."""
    count = [0]

    def layer(of, given, answer):
        per = of.weight[0].numel() if not isinstance(of, nn.ConvTranspose3d) else of.weight.shape[0]
        count[0] += 2 * answer.numel() * per

    hooks = [m.register_forward_hook(layer) for m in net.modules() if isinstance(m, (nn.Conv2d, nn.Conv3d, nn.ConvTranspose3d))]
    with torch.no_grad():
        net(torch.zeros(1, BANDS, SIDE, SIDE, DEEP), torch.zeros(1, dtype=torch.long))
    [hook.remove() for hook in hooks]
    return sum(p.numel() for p in net.parameters()), count[0]


def most_probable(depth):
    """The most probable voxel with its fraction [scene, x, y], from the voxels around it."""
    near = (depth.argmax(-1, keepdim=True) + torch.arange(-2, 3, device=depth.device)).clamp(0, DEEP - 1)
    return (depth.gather(-1, near).softmax(-1) * near).sum(-1)
