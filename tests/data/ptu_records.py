"""Records of a PTU file, or histograms of a PHU file, as ptufile reads them: int64, little endian, to standard output.

PTU: four numbers a record that is no overflow: time, channel, delay, marker; channel -1 is a marker.
PHU: the number of histograms, then of each the number of bins and its counts.
"""

import sys

import numpy
import ptufile

path = sys.argv[1]
if path.endswith(".phu"):
    with ptufile.PhuFile(path) as phu:
        histograms = phu.histograms()
    parts = [numpy.array([len(histograms)])]
    for histogram in histograms:
        parts += [numpy.array([len(histogram)]), histogram]
    out = numpy.concatenate(parts)
else:
    with ptufile.PtuFile(path) as ptu:
        records = ptu.decode_records()
        delay = records["dtime"] if ptu.is_t3 else numpy.zeros(len(records))
        out = numpy.stack([records["time"], records["channel"], delay, records["marker"]], axis=1)
    overflow = (out[:, 1] < 0) & (out[:, 3] == 0)
    out = out[~overflow]
sys.stdout.buffer.write(out.astype("<i8").tobytes())
