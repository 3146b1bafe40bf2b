"""One panel decides about a change: four groups of scenes, by turns with two programs or more.

    panel.py old=./old new=target/release/thirdbounce --seed 4711
    panel.py none='thirdbounce --calibrate none' default=thirdbounce --seed 4711    # does a correction harm proper captures?

Groups: as measured (--measured), the family as drawn (--family), ideal (--family --ideal), known objects. Draw the seed after the change.
A change lands if the mean over the groups rises by two standard errors of the paired difference, and no group falls by .01."""

import argparse
import json
import os
import pathlib
import random
import shlex
import statistics
import subprocess
import tempfile
import time

# Known objects: options of simulate for a seed.
OBJECTS = ("figure", "sphere", "torus", "letter-R", "letter-S", "spheres")
LIGHT = ((32, 200), (32, 20), (16, 1000), (64, 50), (32, 2))
FALL, ERRORS = 0.01, 2


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs="+", help="NAME='PROGRAM options of reconstruct'; the first one is compared with")
    parser.add_argument("--seed", type=int, default=random.randrange(10**6), help="of the panel")
    parser.add_argument("--each", type=int, default=15, help="scenes of a group")
    parser.add_argument("--keep", type=pathlib.Path, help="a folder for captures, truths and results")
    parser.add_argument("--groups", nargs="+", default=list(GROUPS))
    parser.add_argument("--tsv", type=pathlib.Path, help="also write every row to this file")
    return parser.parse_args()


def family(dice, *options):
    # Seeds from 100000 on are trained on; those below 10000 are looked at.
    seed = dice.randrange(10_000, 100_000)
    return seed, ["--family", f"{seed}..{seed + 1}", *options]


def measured(dice):
    seed = dice.randrange(5_000, 7_000)
    return seed, ["--measured", f"{seed}..{seed + 1}"]


def known(dice):
    seed, scene, (scan, photons) = dice.randrange(10**6), dice.choice(OBJECTS), dice.choice(LIGHT)
    light = ["--scan", str(scan), "--photons", str(photons), "--dark", str(dice.choice((0, 0.2, 1)))]
    return seed, [scene, *light, "--reflectance", dice.choice(("cosine", "lambertian")), "--seed", str(seed)]


GROUPS = {"measured": measured, "drawn": family, "ideal": lambda dice: family(dice, "--ideal"), "objects": known}


def made(program, group, dice, folder):
    """A capture and its truth, and words."""
    seed, options = GROUPS[group](dice)
    capture, truth = folder / f"{group}-c{seed}.npz", folder / f"{group}-t{seed}.npz"
    if not capture.exists() or not truth.exists():
        if options[0].startswith("--"):
            subprocess.run([program, "simulate", *options, "--out", folder / "drawn", "-q"], check=True)
            for kind, to in (("c", capture), ("t", truth)):
                (folder / "drawn" / f"{kind}{seed}.npz").replace(to)
        else:
            subprocess.run([program, "simulate", *options, "--out", capture, "--truth", truth, "-q"], check=True)
    return capture, truth, f"{group} {' '.join(options[:2])}"


def solved(command, capture, truth, out):
    """Own IoU, median depth error and normals, CPU and wall seconds, grade, and causes that were undone."""
    before, clock = os.times(), time.monotonic()
    done = subprocess.run([command[0], "reconstruct", capture, "--out", out, "-q", *command[1:]], capture_output=True, text=True)
    wall, after = time.monotonic() - clock, os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    if done.returncode:
        return {"iou": 0.0, "depth": None, "normals": None, "cpu": cpu, "wall": wall, "grade": "refused", "undone": []}
    said = subprocess.run([command[0], "evaluate", out, "--truth", truth, "--json", "--no-pictures"], capture_output=True, text=True, check=True)
    metrics, report = json.loads(said.stdout), json.loads((out / "report.json").read_text())
    verdict = report["verdict"] or {"grade": "?", "reasons": []}
    undone = [reason for reason in verdict["reasons"] if "undone here" in reason]
    return {"iou": metrics["iou"], "depth": metrics.get("depth_mae"), "normals": metrics.get("normal_error_deg"), "cpu": cpu, "wall": wall, "grade": verdict["grade"], "undone": undone}


def mean(values):
    kept = [v for v in values if v is not None]
    return statistics.fmean(kept) if kept else float("nan")


def main():
    given = arguments()
    programs = {name: shlex.split(command) for name, command in (of.split("=", 1) for of in given.programs)}
    folder = given.keep or pathlib.Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    print(f"panel of seed {given.seed}, {given.each} scenes of each group", flush=True)
    dice, rows, first = random.Random(given.seed), [], next(iter(programs))
    for at in range(given.each):
        for group in given.groups:
            capture, truth, words = made(programs[first][0], group, dice, folder)
            row = {"group": group, "words": words}
            for name, command in random.sample(list(programs.items()), len(programs)):
                row[name] = solved(command, capture, truth, folder / f"{capture.stem}-{name}")
            rows.append(row)
            each = "  ".join(f"{name} {row[name]['iou']:.3f} {row[name]['cpu']:.1f} s {row[name]['grade']}" for name in programs)
            print(f"{words}: {each} {'; '.join(of for name in programs for of in row[name]['undone'])[:200]}", flush=True)
    for name in programs:
        of = lambda group: [row[name] for row in rows if row["group"] == group]
        parts = [f"{group} {mean([r['iou'] for r in of(group)]):.3f} ({1000 * mean([r['depth'] for r in of(group)]):.1f} mm, {mean([r['normals'] for r in of(group)]):.1f} deg)" for group in given.groups]
        total = sum(row[name]["cpu"] for row in rows)
        print(f"{name}: {', '.join(parts)}; {total:.0f} CPU s, {sum(row[name]['wall'] for row in rows):.0f} s by the clock")
    for name in list(programs)[1:]:
        differences = {group: [row[name]["iou"] - row[first]["iou"] for row in rows if row["group"] == group] for group in given.groups}
        means = {group: mean(all) for group, all in differences.items()}
        error = sum(statistics.variance(all) / len(all) for all in differences.values() if len(all) > 1) ** 0.5 / len(means)
        rise = mean(list(means.values()))
        lands = rise > ERRORS * error and min(means.values()) > -FALL
        print(f"{name} over {first}: {', '.join(f'{group} {of:+.4f}' for group, of in means.items())}; mean {rise:+.4f} +- {error:.4f}: {'lands' if lands else 'does not land'}")
        for row in rows:
            fall = row[name]["iou"] - row[first]["iou"]
            if fall < -FALL:
                print(f"  falls: {row['words']} {row[first]['iou']:.3f} to {row[name]['iou']:.3f}")
    if given.tsv:
        lines = [f"{row['words']}\t{name}\t{row[name]['iou']:.4f}\t{row[name]['depth']}\t{row[name]['normals']}\t{row[name]['cpu']:.2f}\t{row[name]['grade']}" for row in rows for name in programs]
        given.tsv.write_text("\n".join(["scene\tprogram\tiou\tdepth\tnormals\tcpu\tgrade", *lines]) + "\n")


if __name__ == "__main__":
    main()
