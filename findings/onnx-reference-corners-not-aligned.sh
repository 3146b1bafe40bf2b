#!/bin/sh
# onnx 1.23.2 with onnxruntime 1.32.0, numpy 2.4.6: Resize with aligned corners gives two volumes from one model.
#
# Guess: the reference evaluator of onnx and ONNX Runtime agree on Resize of three axes, whatever the scales, and
#        "align_corners" puts the last voxel upon the last voxel.
# Seen:  they agree if scale times length is a whole number. If not, the reference goes by that product and ONNX
#        Runtime by the length it is rounded down to: only there is the last voxel the last of the input. Five voxels
#        at 0.5 are 0 and 4 in one, 0 and 2.7 in the other; the same sizes stated instead of the scales agree again.
#        A network checked against the reference with even volumes is another one with odd ones.
# Output:
#   4 voxels at 0.5: last of 2 is 3.00 in onnx, 3.00 in ONNX Runtime
#   8 voxels at 1.5: last of 12 is 7.00 in onnx, 7.00 in ONNX Runtime
#   5 voxels at 2.0: last of 10 is 4.00 in onnx, 4.00 in ONNX Runtime
#   5 voxels at 0.5: last of 2 is 2.67 in onnx, 4.00 in ONNX Runtime
#   5 voxels at 0.75: last of 3 is 2.91 in onnx, 4.00 in ONNX Runtime
#   9 voxels at 0.5: last of 4 is 6.86 in onnx, 8.00 in ONNX Runtime
#   9 voxels at 1.5: last of 13 is 7.68 in onnx, 8.00 in ONNX Runtime
#   5 voxels, size 2 stated: [0.0, 4.0] [0.0, 4.0]
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 onnx==1.23.2 onnxruntime==1.32.0
cd "$work"
"$work/venv/bin/python" - <<'PY'
import sys

import numpy as np
import onnxruntime
from onnx import TensorProto, helper
from onnx.reference import ReferenceEvaluator


def resized(volume, **how):
    """One axis of the result, by the reference and by ONNX Runtime. How: scales or sizes of the three axes."""
    kind = TensorProto.FLOAT if "scales" in how else TensorProto.INT64
    name = next(iter(how))
    value = helper.make_tensor(name, kind, [5], how[name])
    inputs = ["volume", "", "scales"] if "scales" in how else ["volume", "", "", "sizes"]
    node = helper.make_node("Resize", inputs, ["out"], mode="linear", coordinate_transformation_mode="align_corners")
    graph = helper.make_graph(
        [node],
        "resize",
        [helper.make_tensor_value_info("volume", TensorProto.FLOAT, volume.shape)],
        [helper.make_tensor_value_info("out", TensorProto.FLOAT, [None] * 5)],
        [value],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 21)], ir_version=10)
    given = {"volume": volume}
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    return ReferenceEvaluator(model).run(None, given)[0], session.run(None, given)[0]


def depths(count):
    """Voxels that hold their own depth index."""
    return np.broadcast_to(np.arange(count, dtype=np.float32)[:, None, None], (1, 1, count, 4, 4)).copy()


for count, scale in ((4, 0.5), (8, 1.5), (5, 2.0), (5, 0.5), (5, 0.75), (9, 0.5), (9, 1.5)):
    by_reference, by_runtime = resized(depths(count), scales=[1, 1, scale, 1, 1])
    first, second = (out[0, 0, :, 0, 0].round(2) for out in (by_reference, by_runtime))
    last = f"last of {len(first)} is {first[-1]:.2f} in onnx, {second[-1]:.2f} in ONNX Runtime"
    print(f"{count} voxels at {scale}: {last}")
    if second[-1] != count - 1 or len(first) != len(second):
        sys.exit("no longer as written: ONNX Runtime does not end with the last voxel, or the lengths differ")
    exact = count * scale
    if not np.allclose(first, np.arange(len(first)) * (count - 1) / (exact - 1), atol=0.01):
        sys.exit("no longer as written: onnx goes by another length")
    if np.allclose(first, second) != (exact == int(exact)):
        sys.exit("no longer as written: the two agree elsewhere")

by_reference, by_runtime = resized(depths(5), sizes=[1, 1, 2, 4, 4])
print("5 voxels, size 2 stated:", by_reference[0, 0, :, 0, 0].tolist(), by_runtime[0, 0, :, 0, 0].tolist())
if not np.array_equal(by_reference, by_runtime):
    sys.exit("no longer as written: the two differ with sizes")
PY
