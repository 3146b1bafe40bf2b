"""Reconstructs many captures on a Dask cluster: each capture is a task, each worker has a device of its own.

    python examples/cluster.py 'scans/*.npz' results --workers 2 --set lateral=64
    python examples/cluster.py 'scans/*.npz' results --scheduler tcp://head:8786

Without --scheduler workers start on this machine. Those of a cluster (`dask worker tcp://head:8786 --nthreads 1`, one per
device) need thirdbounce, the captures and the folder of results, by the same paths. A capture whose folder has a report.json
is skipped, so an interrupted run can be continued. The task of a worker that dies is run again by another worker.
Prints a line of JSON for each capture; ends with 1 if one failed.
"""

import argparse
import collections
import glob
import json
import os
import sys
from pathlib import Path

from distributed import Client, LocalCluster, as_completed, get_worker


def reconstruct(path, folder, settings, devices, threads):
    """Reconstructs a capture into a folder, by a worker."""
    line = {"capture": path, "folder": folder}
    # Written last: a folder without it is not complete.
    if (Path(folder) / "report.json").is_file():
        return {**line, "status": "skipped"}
    # Before the first reconstruction: workers on one machine share its cores.
    if threads:
        os.environ.setdefault("RAYON_NUM_THREADS", str(threads))
    import thirdbounce as tb

    device = devices.get(get_worker().name)
    try:
        maps = tb.reconstruct(path, **settings, **({} if device is None else {"device": device}))
        maps.save(folder)
    except tb.Error as error:
        return {**line, "status": "failed", "error": error.what, "hint": error.hint}
    return {**line, "status": "done", "seconds": maps.seconds, "verdict": maps.verdict, "device": device}


def devices_of(client, devices):
    """A device for each worker by its name: workers of one host get them in turn."""
    if not devices:
        return {}
    hosts = collections.defaultdict(list)
    for worker in client.scheduler_info(n_workers=-1)["workers"].values():
        hosts[worker["host"]].append(worker["name"])
    return {name: devices[at % len(devices)] for names in hosts.values() for at, name in enumerate(sorted(names))}


def run(client, captures, out, settings, devices=(), threads=None):
    """Maps the captures over the workers; yields a dictionary for each, in the order in which they end."""
    names = [Path(path).stem for path in captures]
    twice = [name for name, count in collections.Counter(names).items() if count > 1]
    if twice:
        raise SystemExit(f"captures of one name: {', '.join(twice)}; rename them, or run each folder by itself")
    places = [os.path.join(os.path.abspath(out), name) for name in names]
    paths = [os.path.abspath(path) for path in captures]
    arguments = settings, devices_of(client, devices), threads
    # Several tasks for each worker at a time would wait in its memory.
    futures = [
        client.submit(reconstruct, path, place, *arguments, pure=False, retries=2) for path, place in zip(paths, places)
    ]
    asked = dict(zip([future.key for future in futures], zip(paths, places)))
    for future in as_completed(futures):
        if future.status == "finished":
            yield future.result()
        else:
            path, place = asked[future.key]
            yield {"capture": path, "folder": place, "status": "failed", "error": repr(future.exception()), "hint": ""}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", nargs="+", help="captures, or patterns")
    parser.add_argument("out", help="folder of the results")
    parser.add_argument("--scheduler", help="address of a running cluster [default: workers on this machine]")
    parser.add_argument("--workers", type=int, default=1, help="workers on this machine")
    parser.add_argument("--devices", default="", help="devices of each host, one for each worker: 0,1 [default: the best]")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a setting of the reconstruction")
    args = parser.parse_args()
    captures = sorted({file for pattern in args.captures for file in glob.glob(pattern) or [pattern]})
    settings = dict(pair.split("=", 1) for pair in args.set)
    devices = [device for device in args.devices.split(",") if device]
    cluster = threads = None
    if args.scheduler is None:
        threads = max(1, (os.cpu_count() or 1) // args.workers)
        cluster = LocalCluster(n_workers=args.workers, threads_per_worker=1, dashboard_address=None)
    failed = 0
    with Client(args.scheduler or cluster) as client:
        for line in run(client, captures, args.out, settings, devices, threads):
            print(json.dumps(line), flush=True)
            failed += line["status"] == "failed"
    if cluster is not None:
        cluster.close()
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
