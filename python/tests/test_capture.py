"""Captures: arrays in, arrays out."""

import numpy as np
import pytest

import thirdbounce as tb


def points(n=4):
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, n), np.linspace(-0.4, 0.4, n), indexing="ij")
    return np.stack([x, y, np.zeros_like(x)], axis=-1)


def counts(n=4, bins=32):
    return np.random.default_rng(1).random((n, n, bins), dtype=np.float32)


def test_float32_in_c_order_is_used_in_place():
    H = counts()
    capture = tb.Capture(H, points(), bin_width=0.05)
    assert np.shares_memory(capture.H, H)
    assert capture.scan == (4, 4) and capture.is_confocal and capture.laser_xyz is capture.sensor_xyz
    flat = tb.Capture(H.reshape(16, 32), points().reshape(16, 3), bin_width=0.05)
    assert flat.scan == (16, 1) and np.shares_memory(flat.H, H)


def test_other_arrays_are_converted():
    H = counts()
    for other in [H.astype(np.float64), np.asfortranarray(H), H[:, :, ::-1][:, :, ::-1], H.tolist()]:
        capture = tb.Capture(other, points(), bin_width=0.05)
        assert capture.H.dtype == np.float32 and capture.H.flags.c_contiguous
        np.testing.assert_array_equal(capture.H, H)
    first = tb.Capture(np.moveaxis(H, -1, 0), points(), bin_width=0.05, bins_axis=0)
    np.testing.assert_array_equal(first.H, H)


class OfAnotherLibrary:
    """An array that speaks DLPack and nothing else, as tensors of other libraries do."""

    def __init__(self, array):
        self.array = array

    def __dlpack__(self, **kwargs):
        return self.array.__dlpack__(**kwargs)

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()


def test_dlpack_arrays_are_used_in_place():
    H = counts()
    capture = tb.Capture(OfAnotherLibrary(H), OfAnotherLibrary(points()), bin_width=0.05)
    first = OfAnotherLibrary(np.ascontiguousarray(np.moveaxis(H, -1, 0)))
    np.testing.assert_array_equal(tb.Capture(first, points(), bin_width=0.05, bins_axis=0).H, H)
    assert np.shares_memory(capture.H, H)
    np.testing.assert_array_equal(capture.sensor_xyz, points())


def test_torch_tensors_are_used_in_place():
    torch = pytest.importorskip("torch")
    H = torch.from_numpy(counts())
    assert np.shares_memory(tb.Capture(H, points(), bin_width=0.05).H, H.numpy())


@pytest.mark.parametrize(
    ("H", "sensor", "laser", "words"),
    [
        (counts(4), points(5), None, "(4, 4, 32)"),
        (counts(4)[0, 0], points(4), None, "(32,)"),
        (counts(4), points(4)[..., :2], None, "sensor_xyz"),
        (counts(4), points(4), points(3), "laser_xyz"),
        (np.array(["a"]), points(4), None, "not an array of numbers"),
        (object(), points(4), None, "not an array of numbers"),
        (counts(4).astype(complex), points(4), None, "not an array of numbers"),
        (np.moveaxis(counts(4), -1, 0), points(4), None, "bins_axis=0"),
    ],
)
def test_wrong_shapes_are_told(H, sensor, laser, words):
    with pytest.raises(tb.OptionsError) as raised:
        tb.Capture(H, sensor, laser, bin_width=0.05)
    assert words in str(raised.value)
    assert raised.value.what and raised.value.hint and raised.value.where is None


def test_other_axes_are_refused():
    with pytest.raises(tb.OptionsError, match="bins_axis is 1"):
        tb.Capture(counts(), points(), bin_width=0.05, bins_axis=1)


@pytest.mark.parametrize("name", ["laser_xyz", "sensor_normal", "laser_normal"])
@pytest.mark.parametrize("shape", [(3, 5, 3), (15, 3), (1, 15, 3)])
def test_points_that_only_number_as_many_are_refused(name, shape):
    with pytest.raises(tb.Error, match=name) as raised:
        tb.Capture(np.ones((5, 3, 7)), np.ones((5, 3, 3)), bin_width=0.05, **{name: np.ones(shape)})
    assert "5 x 3" in str(raised.value) and str(shape[0]) in str(raised.value)


def test_a_single_point_is_that_of_every_pair():
    capture = tb.Capture(counts(), points(), (0.1, 0.2, 0.0), bin_width=0.05)
    assert capture.laser_xyz.shape == (4, 4, 3) and not capture.is_confocal
    assert (capture.laser_xyz == (0.1, 0.2, 0.0)).all()
    mirrored = tb.Capture(counts(), (0.1, 0.2, 0.0), points(), bin_width=0.05)
    np.testing.assert_array_equal(mirrored.sensor_xyz, capture.laser_xyz)


@pytest.mark.parametrize("ending", ["npz", "hdf5"])
def test_what_is_written_is_read(tmp_path, capture, ending):
    path = tmp_path / f"z.{ending}"
    assert capture.save(path) == []
    again = tb.read(path)
    assert again.name == "z" and again.scan == capture.scan
    np.testing.assert_array_equal(again.H, capture.H)
    np.testing.assert_allclose(again.sensor_xyz, capture.sensor_xyz, atol=1e-7)
    assert again.bin_width == pytest.approx(capture.bin_width)


def test_a_pulse_is_kept(tmp_path):
    pulse = (np.array([0.25, 0.5, 0.25]), 0.01, -0.015)
    tb.Capture(counts(), points(), bin_width=0.05, pulse=pulse, cycles=1e6).save(tmp_path / "p.npz")
    again = tb.read(tmp_path / "p.npz")
    np.testing.assert_allclose(again.pulse.samples, pulse[0])
    assert again.pulse[1:] == pytest.approx(pulse[1:]) and again.cycles == 1e6


def test_a_file_that_is_none_is_told_with_its_path(tmp_path):
    path = tmp_path / "bad.npz"
    path.write_text("nothing")
    with pytest.raises(tb.InputError) as raised:
        tb.read(path)
    assert raised.value.where == str(path) and str(path) not in raised.value.what
    assert "format" in raised.value.what and isinstance(raised.value, tb.Error)
    with pytest.raises(tb.OptionsError, match="ending"):
        tb.Capture(counts(), points(), bin_width=0.05).save(tmp_path / "x.csv")


def test_npz_files_have_the_bins_first(tmp_path):
    H = counts()
    np.savez(tmp_path / "a.npz", H=np.moveaxis(H, -1, 0), sensor_xyz=points(), laser_xyz=points(), delta_t=0.05)
    np.testing.assert_array_equal(tb.read(tmp_path / "a.npz").H, H)


def test_a_scene_is_rendered_with_its_truth(rendered):
    capture, truth = rendered
    assert capture.H.shape[:2] == (8, 8) and capture.H.sum() > 0
    assert truth.shape == (32, 32) and 0 < truth.mask.mean() < 1
    assert np.isfinite(truth.depth[truth.mask]).all() and np.isnan(truth.depth[~truth.mask]).all()
    assert "a sphere" in tb.scenes()["sphere"]
    with pytest.raises(tb.Error, match="nonsense"):
        tb.simulate("nonsense")
