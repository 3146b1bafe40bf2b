"""Lists the packages that are linked into what `make dist` makes, with their licences, from `cargo metadata`.

    python3 .ci/licences.py > THIRD-PARTY.txt

Tests, benchmarks and build scripts are not part of it. A package without a licence is an error.
"""

import collections
import json
import pathlib
import subprocess
import sys

TARGET = "x86_64-unknown-linux-gnu"
OURS = [
    f"thirdbounce-{name}" for name in ("benchmark", "capi", "command", "live", "python", "tags", "track")
]
# Files that hold licences, in this order.
NAMES = ["licen[cs]e*", "copying*", "notice*", "unlicense*"]


def linked(metadata):
    """The packages that ours link, without ours."""
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    packages = {package["id"]: package for package in metadata["packages"]}
    waiting = [id for id in nodes if packages[id]["name"] in OURS]
    seen = set(waiting)
    while waiting:
        for dep in nodes[waiting.pop()]["deps"]:
            normal = any(kind["kind"] is None for kind in dep["dep_kinds"])
            is_macro = any("proc-macro" in target["kind"] for target in packages[dep["pkg"]]["targets"])
            if normal and not is_macro and dep["pkg"] not in seen:
                seen.add(dep["pkg"])
                waiting.append(dep["pkg"])
    found = [packages[id] for id in seen if not packages[id]["name"].startswith("thirdbounce")]
    return sorted(found, key=lambda package: (package["name"], package["version"]))


def texts(package):
    """The texts of the package's licences."""
    folder = pathlib.Path(package["manifest_path"]).parent
    files = [file for file in sorted(folder.iterdir()) if file.is_file()]
    found = [file for name in NAMES for file in files if file.match(name) or file.match(name.upper())]
    found += [file for name in NAMES for file in files if pathlib.Path(file.name.lower()).match(name)]
    return list(dict.fromkeys(file.read_text(errors="replace").strip() for file in found))


def main():
    command = ["cargo", "metadata", "--locked", "--all-features", "--format-version", "1", "--filter-platform", TARGET]
    metadata = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    packages = linked(metadata)
    without = [p["name"] for p in packages if not p["license"] and not p["license_file"]]
    if without:
        sys.exit(f"no licence is stated by: {', '.join(without)}")
    print("Packages that are linked into thirdbounce, and their licences.\n")
    users = collections.defaultdict(list)
    for package in packages:
        name = f"{package['name']} {package['version']}"
        print(f"{name:<34}{package['license'] or package['license_file']:<44}{package['repository'] or ''}")
        for text in texts(package) or [f"(no text in the package: {package['license']})"]:
            users[text].append(name)
    for text, names in users.items():
        print(f"\n{'=' * 110}\n{', '.join(names)}\n{'-' * 110}\n{text}")


if __name__ == "__main__":
    main()
