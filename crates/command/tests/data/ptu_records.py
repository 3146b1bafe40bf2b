"""Records of a PTU file as ptufile reads them: int64, little endian, to standard output.

Four numbers a record that is no overflow: time, channel, delay, marker; channel -1 is a marker.
"""

import sys

import numpy
import ptufile

with ptufile.PtuFile(sys.argv[1]) as ptu:
    records = ptu.decode_records()
    delay = records["dtime"] if ptu.is_t3 else numpy.zeros(len(records))
    out = numpy.stack([records["time"], records["channel"], delay, records["marker"]], axis=1)
overflow = (out[:, 1] < 0) & (out[:, 3] == 0)
sys.stdout.buffer.write(out[~overflow].astype("<i8").tobytes())
