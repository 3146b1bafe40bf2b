#!/bin/sh
# tttrlib 0.26.2 with ptufile 2026.2.6, numpy 2.4.6: markers of a PicoHarp 300 in T3 mode count as photons.
#
# Guess: event_types tells photons (0) from markers (1) in every PTU file, and a histogram of delays is one of
#        photons.
# Seen:  so event_types are for the HydraHarp's records and those of later instruments. The PicoHarp 300's markers
#        have event type 0, input 15, and their marker bits as delay: a count of events of type 0 has every line
#        marker in it. The histogram of delays takes all events: markers of the HydraHarp are counts of bin 0, those
#        of the PicoHarp 300 of bins 1, 2 and 4, and no event type takes these out. ptufile finds the markers in
#        both files.
# Output:
#   HydraHarp 2: ptufile 300 photons and 200 markers
#   HydraHarp 2: tttrlib 300 of type 0, 200 of type 1, inputs [1, 2], histogram {0: 200, 1500: 300}
#   PicoHarp 300: ptufile 300 photons and 200 markers
#   PicoHarp 300: tttrlib 500 of type 0, 0 of type 1, inputs [1, 15], histogram {1: 100, 2: 100, 1500: 300}
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 ptufile==2026.2.6 tttrlib==0.26.2
cd "$work"
"$work/venv/bin/python" - <<'PY'
import struct
import sys

import numpy as np
import ptufile
import tttrlib


def tag(name, kind, value):
    return struct.pack("<32siI", name.encode(), -1, kind) + value


def write(path, record_type, words):
    """A T3 file of 4 ps and 10 MHz."""
    guid = b"{00000000-0000-0000-0000-000000000000}\0\0"
    whole = {
        "Measurement_Mode": 3,
        "Measurement_SubMode": 0,
        "TTResultFormat_TTTRRecType": record_type,
        "TTResultFormat_BitsPerRecord": 32,
        "TTResult_SyncRate": 10_000_000,
        "TTResult_NumberOfRecords": len(words),
    }
    real = {"MeasDesc_Resolution": 4e-12, "MeasDesc_GlobalResolution": 1e-7}
    with open(path, "wb") as file:
        file.write(b"PQTTTR\0\0" + b"1.0.00\0\0")
        file.write(tag("File_GUID", 0x4001FFFF, struct.pack("<q", len(guid)) + guid))
        for name, value in whole.items():
            file.write(tag(name, 0x10000008, struct.pack("<q", value)))
        for name, value in real.items():
            file.write(tag(name, 0x20000008, struct.pack("<d", value)))
        file.write(tag("Header_End", 0xFFFF0008, bytes(8)))
        file.write(np.array(words, "<u4").tobytes())


# 100 lines, each with a marker 1, three photons of input 1 and a marker 2.
picoharp, hydraharp = [], []
for line in range(100):
    start = 10 * line
    picoharp += [15 << 28 | 1 << 16 | start]
    hydraharp += [1 << 31 | 1 << 25 | start]
    for at in (1, 2, 3):
        picoharp += [1 << 28 | 1500 << 16 | start + at]
        hydraharp += [1 << 25 | 1500 << 10 | start + at]
    picoharp += [15 << 28 | 2 << 16 | start + 8]
    hydraharp += [1 << 31 | 2 << 25 | start + 8]

seen = {}
for name, record_type, words in (("HydraHarp 2", 0x01010304, hydraharp), ("PicoHarp 300", 0x00010303, picoharp)):
    write("scan.ptu", record_type, words)
    with ptufile.PtuFile("scan.ptu") as file:
        records = file.decode_records()
        other = int((records["channel"] >= 0).sum()), int((records["marker"] > 0).sum())
    events = tttrlib.TTTR("scan.ptu", "PTU")
    types = np.bincount(events.event_types, minlength=2).tolist()
    histogram = np.asarray(events.get_microtime_histogram(1)[0])
    filled = {int(at): int(histogram[at]) for at in np.nonzero(histogram)[0]}
    inputs = sorted(set(events.routing_channels.tolist()))
    print(f"{name}: ptufile {other[0]} photons and {other[1]} markers")
    print(f"{name}: tttrlib {types[0]} of type 0, {types[1]} of type 1, inputs {inputs}, histogram {filled}")
    seen[name] = other, types, filled
if any(other != (300, 200) for other, _, _ in seen.values()):
    sys.exit("no longer as written: ptufile finds other records")
if seen["HydraHarp 2"][1] != [300, 200] or seen["HydraHarp 2"][2] != {0: 200, 1500: 300}:
    sys.exit("no longer as written: markers of the HydraHarp are not of type 1, in bin 0")
if seen["PicoHarp 300"][1] != [500, 0] or seen["PicoHarp 300"][2] != {1: 100, 2: 100, 1500: 300}:
    sys.exit("no longer as written: markers of the PicoHarp 300 are told from photons")
PY
