"""Fits what IoU is to be expected of a result: `expect.py SCENES... --unseen FOLDER --out FOLDER`.

A logistic regression on what the network of the conclusion sees, from folders as for `conclusion.py`, in which captures have faults
(`faults.py`). A minute."""

import argparse
import pathlib

import numpy as np
import torch
from safetensors.torch import load_file, save_file

from conclusion import SCALES, Conclusion, Scenes, best_share, iou

# Channels of a pixel, the first one of the bands, weight of the rules' mask, least probability, most standard deviations
# (src/learned/expectation.rs, src/learned/conclusion.rs).
OF_PIXEL, OF_BANDS, RULES, LEAST, FAR = 33, 18, 1.7, 0.3, 4


def numbers(net, x, rules):
    """What the regression sees of a scene, and the mask."""
    with torch.no_grad():
        logit, _, scale = net(x[None])[0].float()
    x, logit, scale, rules = x.numpy(), logit.numpy(), scale.clamp(*SCALES).numpy(), rules.numpy()
    p, both = (1 / (1 + np.exp(-of)) for of in (logit, logit + np.where(rules, RULES, -RULES)))
    mask = both >= max(best_share(both)[0], LEAST)
    count = max(1, mask.sum())
    alone = p[mask].sum() / (count + p[~mask].sum())
    mean = lambda of: (of * mask).sum((-2, -1)) / count
    roots = np.sqrt(mean(x[OF_BANDS:OF_PIXEL] ** 2))
    rest = [np.log(max(alone, 0.01) / (1.01 - alone)), mask.mean(), mean(scale), mean(abs(scale))]
    return np.concatenate([x[OF_PIXEL:, 0, 0], mean(x[:OF_PIXEL]), roots, rest]), mask, alone


def seen(net, folders):
    rows, true, alone = [], [], []
    for x, mask, _, rules in Scenes(folders):
        of, own, promised = numbers(net, x, rules)
        rows.append(of)
        true.append(iou(own, mask.numpy()))
        alone.append(promised)
    return np.array(rows), np.array(true), np.array(alone)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", help="folders of scenes to fit on")
    parser.add_argument("--unseen", nargs="+", required=True, help="folders of scenes to measure with")
    parser.add_argument("--out", type=pathlib.Path, default="trained", help="folder of expectation.safetensors")
    parser.add_argument("--conclusion", default="src/learned/conclusion.safetensors", help="weights of the conclusion")
    parser.add_argument("--steps", type=int, default=1500)
    given = parser.parse_args()
    torch.manual_seed(0)
    weights = load_file(given.conclusion)
    net = Conclusion(weights["stem.weight"].shape[1]).eval()
    net.load_state_dict({name: values.float() for name, values in weights.items()})
    rows, true, _ = seen(net, given.scenes)
    middle, deviation = rows.mean(0), rows.std(0) + 1e-3
    standard = lambda of: torch.tensor(((of - middle) / deviation).clip(-FAR, FAR), dtype=torch.float32)
    x, y, line = standard(rows), torch.tensor(true, dtype=torch.float32), torch.nn.Linear(rows.shape[1], 1)
    optimiser = torch.optim.AdamW(line.parameters(), lr=5e-3, weight_decay=0.05)
    for step in range(given.steps):
        optimiser.param_groups[0]["lr"] = 5e-3 * (1 - step / given.steps)
        some = torch.randint(len(x), (64,))
        answer = line(x[some] + 0.1 * torch.randn(64, x.shape[1])).squeeze(1)
        loss = torch.nn.functional.binary_cross_entropy_with_logits(answer, y[some])
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    as_half = lambda of: torch.as_tensor(of).half().contiguous()
    given.out.mkdir(parents=True, exist_ok=True)
    tensors = {"standard.weight": 1 / deviation, "standard.bias": middle, "expectation.weight": line.weight.detach()[0], "expectation.bias": line.bias.detach()}
    save_file({name: as_half(of) for name, of in tensors.items()}, given.out / "expectation.safetensors")
    rows, true, alone = seen(net, given.unseen)
    with torch.no_grad():
        expected = torch.sigmoid(line(standard(rows)).squeeze(1)).numpy()
    for name, of in (("probabilities alone", alone), ("regression", expected)):
        print(f"{name}: mean {of.mean():.3f} (true {true.mean():.3f}), correlation {np.corrcoef(of, true)[0, 1]:.2f}, mean error {abs(of - true).mean():.3f}")


if __name__ == "__main__":
    main()
