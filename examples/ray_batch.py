"""Reconstructs many captures on a Ray cluster: every Ray task runs `thirdbounce batch` on one part of the list.

    python examples/ray_batch.py captures.txt results --parts 8 -- --stride 2

Without a cluster Ray starts workers on this machine. All workers need the command, the captures and the folder of results,
by the same paths; THIRDBOUNCE names another command. A part whose worker died is started again, and skips what is done.
The options behind `--` are those of `thirdbounce reconstruct`.
"""

import argparse
import json
import os
import subprocess
import sys

import ray


@ray.remote(max_retries=3)
def reconstruct(program, part, parts, captures, out, options):
    """Reconstructs one part of the captures; one dictionary for each, the summary last."""
    command = [program, "batch", captures, "--out", out]
    command += ["--part", f"{part}/{parts}", "--quiet", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    # 1: some captures failed, and their lines say why. A worker that was killed comes again.
    if done.returncode not in (0, 1) or not done.stdout:
        raise RuntimeError(f"part {part} of {parts} ended with {done.returncode}: {done.stderr}")
    return [json.loads(line) for line in done.stdout.splitlines()]


def main():
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0],
        epilog="Behind -- follow options of `thirdbounce reconstruct`.",
    )
    parser.add_argument("captures", help="a list of captures (.txt), or a pattern")
    parser.add_argument("out", help="folder of the results")
    parser.add_argument("--parts", type=int, default=2, help="parts of the list, each a Ray task")
    parser.add_argument("--cpus", type=float, default=1, help="CPUs that a task takes")
    parser.add_argument("--gpus", type=float, default=0, help="GPUs that a task takes")
    parser.add_argument("--address", help="the cluster [default: this machine]")
    given = sys.argv[1:]
    split = given.index("--") if "--" in given else len(given)
    args, options = parser.parse_args(given[:split]), given[split + 1 :]

    ray.init(address=args.address, log_to_driver=False)
    captures = args.captures if any(c in args.captures for c in "*?[") else os.path.abspath(args.captures)
    program = os.environ.get("THIRDBOUNCE", "thirdbounce")
    task = reconstruct.options(num_cpus=args.cpus, num_gpus=args.gpus)
    waiting = [
        task.remote(program, part, args.parts, captures, os.path.abspath(args.out), options)
        for part in range(1, args.parts + 1)
    ]
    failed = 0
    while waiting:
        ready, waiting = ray.wait(waiting)
        *lines, summary = ray.get(ready[0])
        for line in lines:
            print(json.dumps(line), flush=True)
        failed += summary["failed"]
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
