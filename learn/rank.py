"""Ranks weights on captures without truth, by the light that their surfaces leave: `rank.py NAME=PROGRAM NAME=PROGRAM... CAPTURES...`.

Each PROGRAM is a `thirdbounce` that was built with other weights. Printed for every capture: the share of the light of held-out pairs that
is left, which weights of the start change, and the expected intersection over union, which those of the conclusion change. The page has
the pictures side by side. Needs Python alone."""

import argparse
import base64
import html
import json
import math
import pathlib
import subprocess
import sys
import tempfile

PICTURES = "albedo.png", "depth.png", "probability.png"


def solved(program, capture, options):
    """Report and pictures of a capture, or what the program says instead."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run([program, "reconstruct", capture, "--out", folder, "--quiet", *options], capture_output=True, text=True)
        if done.returncode:
            return None, (done.stderr.strip().splitlines() or ["no error was printed"])[0]
        out = pathlib.Path(folder)
        shown = {name: (out / name).read_bytes() for name in PICTURES if (out / name).exists()}
        return json.loads((out / "report.json").read_text()), shown


def mean_of(values):
    """Mean and its standard error."""
    mean = sum(values) / len(values)
    spread = sum((v - mean) ** 2 for v in values) / max(1, len(values) - 1)
    return mean, math.sqrt(spread / len(values))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs="+", metavar="NAME=PROGRAM|CAPTURE", help="the first program is what the others are compared with")
    parser.add_argument("--option", action="append", default=[], help="an option of reconstruct, such as --option=--lateral=64")
    parser.add_argument("--page", type=pathlib.Path, default="rank.html", help="page of the pictures")
    given = parser.parse_args()
    programs = dict(text.split("=", 1) for text in given.programs if "=" in text)
    captures = [text for text in given.programs if "=" not in text]
    if len(programs) < 2 or not captures:
        raise SystemExit("give two programs or more, each as NAME=PROGRAM, and captures")
    first, *others = programs
    gains, rows = {name: [] for name in others}, []
    print(f"{'capture':32}" + "".join(f"{name[:20]:>24}" for name in programs) + "\n" + " " * 32 + f"{'left, %   expected IoU':>24}" * len(programs))
    for capture in captures:
        cells, left = [], {}
        for name, program in programs.items():
            report, shown = solved(program, capture, given.option)
            verdict = (report or {}).get("verdict") or {}
            if report is None or not verdict.get("left"):
                cells.append((name, "–", shown if isinstance(shown, str) else "no pair was held out", {}))
                continue
            left[name] = verdict["left"][0]
            expected = verdict.get("expected_iou")
            cells.append((name, f"{100 * left[name]:.2f} {'' if expected is None else f'{expected:16.3f}'}", verdict["grade"], shown))
        print(f"{pathlib.Path(capture).name[:31]:32}" + "".join(f"{text:>24}" for _, text, _, _ in cells), flush=True)
        rows.append((capture, cells))
        for name in others:
            if left.get(first, 0) > 0 and left.get(name, 0) > 0:
                gains[name].append(math.log(left[name] / left[first]))
    for name, all in gains.items():
        if all:
            mean, error = mean_of(all)
            print(f"{name} leaves {math.exp(mean):.3f} times as much as {first} (standard error {error:.3f}), less on {sum(g < 0 for g in all)} of {len(all)} captures")
    picture = lambda of: "".join(f'<img src="data:image/png;base64,{base64.b64encode(of[name]).decode()}" alt="{name}">' for name in PICTURES if name in of)
    cell = lambda name, text, said, of: f"<td><p>{html.escape(name)}: {html.escape(text)}, {html.escape(said)}</p>{picture(of)}</td>"
    body = "".join(f"<tr><th>{html.escape(pathlib.Path(capture).name)}</th>{''.join(cell(*c) for c in cells)}</tr>" for capture, cells in rows)
    given.page.write_text(f'<!doctype html><meta charset="utf-8"><title>Weights on captures</title><style>img {{ height: 12em }}</style><table>{body}</table>')
    print(f"pictures: {given.page}")


if __name__ == "__main__":
    sys.exit(main())
