"""Counts the instructions of a kernel's main loop in a listing of machine code, by class, and writes the report.

count.py NVIDIA.sass...            prints the loops of nvdisasm's listings
count.py --report FOLDER OUT.json  gathers what run.sh left in a folder
"""

import json
import pathlib
import re
import sys

# Classes in order: the first whose pattern matches the beginning of an instruction counts it.
AMD = [
    ("wait", r"s_(wait|clause|nop|inst_prefetch|delay_alu|sleep|setprio)"),
    ("constant", r"s_(buffer_)?load"),
    ("scalar", r"s_"),
    ("special", r"v_(rsq|rcp|sqrt|exp|log|sin|cos)_"),
    ("fma", r"v_(pk_)?(fma|fmac|fmaak|fmamk|mad|mac|mul|add|sub|subrev)(_legacy)?_f32"),
    ("atomic", r"(buffer|global|flat)_atomic"),
    ("memory", r"(buffer|tbuffer|global|flat|scratch)_"),
    ("shared", r"ds_"),
    ("other", r"v_"),
]
NVIDIA = [
    ("wait", r"(NOP|WARPSYNC|DEPBAR)"),
    ("constant", r"(LDC|ULDC)"),
    ("scalar", r"(U[A-Z0-9]+|R2UR|BRA|BSSY|BSYNC|BREAK|EXIT|CALL|RET|BAR)\b"),
    ("special", r"MUFU"),
    ("fma", r"(FFMA|FMUL|FADD)"),
    ("atomic", r"(RED|REDG|ATOM|ATOMG)\b"),
    ("shared", r"(LDS|STS|ATOMS)\b"),
    ("memory", r"(LDG|STG|LD|ST|LDL|STL)\b"),
    ("other", r"[A-Z]"),
]
# A pair takes one inverse root: loops that a compiler unrolled hold several.
ROOT = re.compile(r"v_rsq_f32|MUFU\.RSQ")
LABEL = re.compile(r"^\s*(BB\d+|\.L_x_\d+):?\s*$")
BRANCH = re.compile(r"^(?:@!?U?P\d+\s+)?(?:s_c?branch\w*|BRA\S*)\s.*?(BB\d+|\.L_x_\d+)")


def instructions(listing):
    """The instructions of a listing, and the place of each label among them."""
    found, labels = [], {}
    for line in listing.splitlines():
        label = LABEL.match(line)
        if label:
            labels[label.group(1)] = len(found)
            continue
        text = re.sub(r"/\*.*?\*/", "", line).split(";")[0].strip()
        # Without a disassembler RADV prints its compiler's own listing: results = instruction.
        text = re.sub(r"^[sv]\d+: .*? = ", "", text)
        if re.match(r"(@!?U?P\w+\s+)?[a-zA-Z]\w*(\s|\.|$)", text) and not text.endswith(":"):
            found.append(text)
    return found, labels


def main_loop(listing):
    """The instructions of the innermost loop that holds the most inverse roots; None if no loop holds one."""
    found, labels = instructions(listing)
    loops = []
    for end, text in enumerate(found):
        branch = BRANCH.match(text)
        begin = labels.get(branch.group(1)) if branch else None
        if begin is not None and begin <= end:
            body = found[begin : end + 1]
            roots = sum(bool(ROOT.search(t)) for t in body)
            if roots:
                loops.append((begin, end, roots, body))
    # A loop around another one with a root is no innermost one.
    inner = [
        a
        for a in loops
        if not any(b is not a and a[0] <= b[0] and b[1] <= a[1] and (b[0], b[1]) != (a[0], a[1]) for b in loops)
    ]
    return max(inner, key=lambda loop: (loop[2], -len(loop[3])))[2:] if inner else None


def count(listing):
    """Instructions of a pair by class, and all but those that only wait."""
    loop = main_loop(listing)
    if loop is None:
        return None
    roots, body = loop
    classes = AMD if any(t.startswith("v_") for t in body) else NVIDIA
    counts = dict.fromkeys([name for name, _ in classes], 0)
    for text in body:
        plain = re.sub(r"^@!?U?P\w+\s+", "", text)
        name = next((name for name, pattern in classes if re.match(pattern, plain)), "other")
        counts[name] += 1
    counts = {name: number / roots for name, number in counts.items()}
    counts["issued"] = sum(number for name, number in counts.items() if name != "wait")
    return {name: round(number, 2) for name, number in counts.items()}


WANTED = {
    "registers": ["VGPRs", "Register Count"],
    "spilled": ["Spilled VGPRs", "Spill Count"],
    "shared": ["LDS size", "Shared Memory Size"],
    "instructions": ["Instructions", "Instruction Count"],
    "waves": ["Subgroups per SIMD"],
}


def of_plan(file):
    """Report of one run of `profile --compile`, with the loops of its listings."""
    report = json.loads(file.read_text())
    kernels = []
    for kernel in report["kernels"]:
        row = {"kernel": kernel["kernel"], "module": kernel["code"], "slots": kernel["slots"]}
        for i, executable in enumerate(kernel["executables"][:1]):
            row["subgroup"] = executable["subgroup"]
            for name, names in WANTED.items():
                value = next((executable["statistics"][n] for n in names if n in executable["statistics"]), None)
                row[name] = value
            listing = file.with_suffix("") / f"{kernel['kernel']}.{i}.assembly.txt"
            if kernel["slots"] is not None and listing.exists():
                row["loop"] = count(listing.read_text())
        kernels.append(row)
    kept = {name: report[name] for name in ("device", "tells", "solver", "pairs", "voxels", "accumulation")}
    return {"plan": file.stem, **kept, "kernels": kernels}


def ptxas(file):
    """Registers and spills by kernel, from what `ptxas -v` printed."""
    found, kernel = {}, None
    for line in file.read_text().splitlines():
        if name := re.search(r"entry function '(\w+)'", line):
            kernel = found.setdefault(name.group(1), {})
        if spills := re.search(r"(\d+) bytes spill stores, (\d+) bytes spill loads", line):
            kernel["spilled_bytes"] = int(spills.group(1)) + int(spills.group(2))
        if registers := re.search(r"Used (\d+) registers", line):
            kernel["registers"] = int(registers.group(1))
    return found


def sections(listing):
    """The kernels of an nvdisasm listing."""
    parts = re.split(r"^\.text\.(\w+):$", listing, flags=re.M)
    return dict(zip(parts[1::2], parts[2::2]))


def report(folder, out):
    plans = [of_plan(file) for file in sorted(folder.glob("*.json"))]
    result = {"version": json.loads(next(folder.glob("*.json")).read_text())["version"], "plans": plans}
    listing = folder / "nvidia.sass"
    if listing.exists():
        report = ptxas(folder / "nvidia.ptxas")
        loops = {name: {**report[name], "loop": count(part)} for name, part in sections(listing.read_text()).items()}
        result["nvidia"] = {"tools": (folder / "nvidia.versions").read_text().splitlines(), "kernels": loops}
    # A line for each kernel, so that a change of one shows as one.
    text = json.dumps(result)
    out.write_text(re.sub(r'(\{"(?:plan|kernel)":)', r"\n\1", text) + "\n")
    print(table(result))


def table(result):
    head = ["what", "kernel", "registers", "spilled", "shared", "waves", "slots", "issued"]
    classes = ["fma", "special", "other", "memory", "atomic", "shared", "constant", "scalar"]
    rows = [head + [f"{name}" for name in classes]]

    def add(what, name, k):
        loop = k.get("loop") or {}
        figures = [k.get(n) for n in ("registers", "spilled", "shared", "waves", "slots")]
        figures = [f"{v:g}" if v is not None else "-" for v in figures]
        rows.append([what, name, *figures, *(f"{loop[n]:g}" if loop else "-" for n in ["issued", *classes])])

    for plan in result["plans"]:
        for k in plan["kernels"]:
            if k["slots"] is not None:
                add(plan["plan"], f"{k['kernel']} ({k['module']})", k)
    for name, k in result.get("nvidia", {}).get("kernels", {}).items():
        add("ptxas sm_90", name, {**k, "spilled": k["spilled_bytes"]})
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(row, widths)).rstrip() for row in rows)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--report"]:
        report(pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3]))
    else:
        for name in sys.argv[1:]:
            for kernel, part in sections(pathlib.Path(name).read_text()).items():
                print(kernel, count(part))
