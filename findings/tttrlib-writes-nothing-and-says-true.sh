#!/bin/sh
# tttrlib 0.26.2 with numpy 2.4.6: TTTR.write() returns True where it wrote no record.
#
# Guess: a PTU file that tttrlib reads can be written again with write(), which returns False if it could not.
# Seen:  for T3 records of the PicoHarp 300, the HydraHarp 1 and the generic type (MultiHarp, PicoHarp 330) the new
#        file has a header and no record, and the call returns True; one line on standard error is all that tells of
#        it. Those of the HydraHarp 2 and TimeHarp 260 P come back whole. A program that trusts the answer and
#        deletes the original has lost the measurement.
# Output:
#   generic: 1000 photons read, write() returns True, 0 in the new file
#   PicoHarp 300: 1000 photons read, write() returns True, 0 in the new file
#   HydraHarp 1: 1000 photons read, write() returns True, 0 in the new file
#   HydraHarp 2: 1000 photons read, write() returns True, 1000 in the new file
#   TimeHarp 260 P: 1000 photons read, write() returns True, 1000 in the new file
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 tttrlib==0.26.2
cd "$work"
"$work/venv/bin/python" - <<'PY'
import struct
import sys

import numpy as np
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


def again(name, record_type, shift):
    """1,000 photons of input 1, each in a laser period of its own."""
    write("first.ptu", record_type, [1 << shift[0] | 1500 << shift[1] | period for period in range(1000)])
    first = tttrlib.TTTR("first.ptu", "PTU")
    path = f"{name}.ptu".replace(" ", "")
    answer = first.write(path)
    second = tttrlib.TTTR(path, "PTU")
    print(f"{name}: {len(first)} photons read, write() returns {answer}, {len(second)} in the new file", flush=True)
    return len(first), answer, len(second)


later, pico = (25, 10), (28, 16)
empty = [
    again("generic", 0x00010307, later),
    again("PicoHarp 300", 0x00010303, pico),
    again("HydraHarp 1", 0x00010304, later),
]
whole = [
    again("HydraHarp 2", 0x01010304, later),
    again("TimeHarp 260 P", 0x00010306, later),
]
if any(got != (1000, True, 0) for got in empty):
    sys.exit("no longer as written: records of these are written, or write() does not return True")
if any(got != (1000, True, 1000) for got in whole):
    sys.exit("no longer as written: records of the HydraHarp 2 or TimeHarp 260 do not come back whole")
PY
