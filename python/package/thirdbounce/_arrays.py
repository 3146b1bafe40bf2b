"""Conversion of arrays to flat arrays in C order."""

from __future__ import annotations

import difflib
import os
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

from . import _native
from ._native import OptionsError


def refuse(what: str, hint: str) -> OptionsError:
    """Error for an invalid argument."""
    error = OptionsError(f"{what}\n  {hint}")
    error.what, error.where, error.hint = what, None, hint
    return error


def metres(value: Any, name: str, is_path: bool = False) -> float:
    """A length in metres, or text with a unit: "2cm"; a path may be a time: "20ps"."""
    if isinstance(value, str):
        return _native.metres(name, value, is_path)
    try:
        return float(value)
    except (TypeError, ValueError) as error:
        raise refuse(f"{name} is {value!r}", 'give metres, or text such as "2cm"') from error


def count(value: Any, name: str) -> int:
    """A whole number."""
    try:
        if int(value) == float(value) and int(value) >= 0:
            return int(value)
    except (TypeError, ValueError, OverflowError):
        pass
    raise refuse(f"{name} is {value!r}", "give a whole number")


def plain(value: Any, name: str) -> np.ndarray:
    """The value as an array of real numbers. Arrays with DLPack support are not copied."""
    try:
        if not isinstance(value, np.ndarray) and hasattr(value, "__dlpack__"):
            value = np.from_dlpack(value)
        array = np.asarray(value)
        if array.dtype.kind not in "biuf":
            raise TypeError(f"its type is {array.dtype}")
        return array
    except (TypeError, ValueError, BufferError, RuntimeError) as error:
        hint = "give an array of real numbers in the host's memory (torch: tensor.detach().cpu())"
        raise refuse(f"{name} is not an array of numbers: {error}", hint) from error


def as_array(value: Any, dtype: Any, name: str) -> np.ndarray:
    """The value as an array in C order, copied only if necessary."""
    return np.ascontiguousarray(plain(value, name), dtype=dtype)


def texts(settings: Dict[str, Any], arguments: Sequence[str] = ()) -> List[Tuple[str, str]]:
    """Settings as text, by their names; those that are None are left out. A name like one of the function's own arguments is
    refused; those like a setting the native part refuses."""
    for name in settings:
        meant = difflib.get_close_matches(name.lower(), arguments, 1, 0.8)
        if meant:
            raise refuse(f"there is no argument {name}", f"did you mean {meant[0]}?")
    return [(name, _text(name, value)) for name, value in settings.items() if value is not None]


def _text(name: str, value: Any) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if name == "memory" and isinstance(value, (int, np.integer)):
        return f"{int(value) / 1024!r}K"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        # 64.0 is a number of pixels, too.
        return str(int(value)) if float(value).is_integer() else repr(float(value))
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if isinstance(value, (tuple, list, np.ndarray)):
        ends = ["" if part is None else _text(name, part) for part in value]
        # (from, to), (width, tail), or the ranges of a box.
        between = "," if name in ("spot", "volume") and not (name == "volume" and np.isscalar(value[0])) else ":"
        return between.join(ends)
    raise refuse(f"{name} is a {type(value).__name__}: {value!r}", "give a number, a text, a bool or a tuple of numbers")


def as_counts(value: Any, scan: Tuple[int, int], bins_axis: int) -> np.ndarray:
    """Histograms as float32, (X, Y, T). Copied only if not already in C order in this form."""
    if bins_axis not in (-1, 0):
        raise refuse(f"bins_axis is {bins_axis}", "give -1 for H of shape (X, Y, T), or 0 for (T, X, Y)")
    array = plain(value, "H")
    if bins_axis == 0 and array.ndim > 1:
        array = np.moveaxis(array, 0, -1)
    if array.ndim < 2 or array.shape[:-1] not in (scan, (scan[0] * scan[1],)):
        hint = "H is (X, Y, T) with points (X, Y, 3), or (P, T) with (P, 3); with the bins first, bins_axis=0"
        raise refuse(f"H has shape {np.shape(value)}, the points are {scan[0]} x {scan[1]}", hint)
    return np.ascontiguousarray(array, dtype=np.float32).reshape(scan + (array.shape[-1],))


def as_bools(value: Any) -> np.ndarray:
    """Flat truth values, each 0 or 1. A view of other bytes as bool may contain any, which is undefined in the native part."""
    return np.not_equal(np.ascontiguousarray(value, dtype=np.bool_).reshape(-1).view(np.uint8), 0)


def as_points(value: Any, name: str) -> np.ndarray:
    """Points as float64, (X, Y, 3). A list of points (P, 3) becomes (P, 1, 3)."""
    array = as_array(value, np.float64, name)
    if array.ndim not in (1, 2, 3) or array.shape[-1] != 3 or array.size == 0:
        raise refuse(f"{name} has shape {array.shape}", "give points as (X, Y, 3), or as a list (P, 3), in metres")
    if array.ndim == 1:
        return array.reshape(1, 1, 3)
    return array if array.ndim == 3 else array.reshape(-1, 1, 3)


def like_points(value: Any, scan: Tuple[int, int], name: str) -> Optional[np.ndarray]:
    """As `as_points`; a single point is repeated for every pair."""
    if value is None:
        return None
    points = as_points(value, name)
    if points.shape[:2] == (1, 1):
        points = np.ascontiguousarray(np.broadcast_to(points, scan + (3,)))
    if points.shape[:2] != tuple(scan):
        x, y = scan
        flat = f" or ({x}, 3)" if y == 1 else ""
        raise refuse(
            f"{name} has shape {np.shape(value)}, the scan is {x} x {y}",
            f"give one for each pair in the same order, ({x}, {y}, 3){flat}, or a single one, (3,)",
        )
    return points
