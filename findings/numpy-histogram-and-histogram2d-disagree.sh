#!/bin/sh
# numpy 2.4.6 with scipy 1.17.1, boost-histogram 1.8.1: one list of delays, two histograms, by the function's name.
#
# Guess: float32 delays that are multiples of the bin width give one count a bin, or nearly, in every function.
# Seen:  histogram() with a number of bins computes edges in float32 if the delays are: all is well. histogram2d(),
#        which one takes for delays by detector, computes them in float64, and so do boost-histogram and edges made
#        with linspace. There a delay that float32 rounds down falls into the bin before: of 1,000 bins of 4 ps, 269
#        are empty and 269 have two counts. The same delays in float64, as float32 rounded them, do so in histogram()
#        too. A comb that looks like the uneven bins of a converter is made by the sum over an axis of histogram2d().
#        binned_statistic() of scipy is right.
# Output:
#   histogram: 1000 counts, 0 bins empty, 0 with two
#   binned_statistic: 1000 counts, 0 bins empty, 0 with two
#   histogram2d, summed: 1000 counts, 269 bins empty, 269 with two
#   boost-histogram: 1000 counts, 269 bins empty, 269 with two
#   histogram, edges from linspace: 1000 counts, 269 bins empty, 269 with two
#   histogram, as float64: 1000 counts, 269 bins empty, 269 with two
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 scipy==1.17.1 boost-histogram==1.8.1
cd "$work"
"$work/venv/bin/python" - <<'PY'
import sys

import boost_histogram
import numpy as np
from scipy.stats import binned_statistic

bins, width = 1000, 0.004
edges = (0, bins * width)
delays = (np.arange(bins) * width).astype(np.float32)
detector = np.zeros(bins, np.float32)
counts = {
    "histogram": np.histogram(delays, bins, edges)[0],
    "binned_statistic": binned_statistic(delays, delays, "count", bins, edges)[0],
    "histogram2d, summed": np.histogram2d(delays, detector, [bins, 1], [edges, (-0.5, 0.5)])[0].sum(1),
    "boost-histogram": boost_histogram.Histogram(boost_histogram.axis.Regular(bins, *edges)).fill(delays).values(),
    "histogram, edges from linspace": np.histogram(delays, np.linspace(*edges, bins + 1))[0],
    "histogram, as float64": np.histogram(delays.astype(np.float64), bins, edges)[0],
}
for number, (name, got) in enumerate(counts.items()):
    total, empty, double = int(got.sum()), int((got == 0).sum()), int((got == 2).sum())
    print(f"{name}: {total} counts, {empty} bins empty, {double} with two")
    if (total, empty, double) != ((1000, 0, 0) if number < 2 else (1000, 269, 269)):
        sys.exit("no longer as written: other bins are filled")
PY
