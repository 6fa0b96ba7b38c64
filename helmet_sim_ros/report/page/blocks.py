"""Data of a page in compressed blocks, which its script decodes when they come into view."""

from __future__ import annotations

import base64
import json
import struct
import zlib
from collections.abc import Mapping

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray

#: Steps of the range of an array that a drawn value is rounded to.
LEVELS = 65535


def packed(plain: Mapping[str, object], arrays: Mapping[str, FloatArray]) -> str:
    """Plain data and arrays as one text; ``report.js`` and :func:`unpacked` read it.

    The text is base64 of zlib of: length of the JSON (4 bytes), the JSON, and per array the
    differences of its values in steps of 1/65535 of its range, low bytes before high bytes.
    Neighbours should be neighbours in time: then differences are small and compress well.

    Args:
        plain: JSON types without NaN.
        arrays: any shapes; read back flat, last axis fastest.
    """
    described: dict[str, dict[str, object]] = {}
    bodies = []
    for name, values in arrays.items():
        flat = np.asarray(values, dtype=np.float64).ravel()
        low = float(flat.min()) if len(flat) else 0.0
        step = (float(flat.max()) - low) / LEVELS if len(flat) else 0.0
        level = np.rint((flat - low) / step) if step > 0.0 else np.zeros(len(flat))
        delta = np.diff(level.astype(np.int64), prepend=0).astype(np.uint16)
        described[name] = {"count": len(flat), "low": low, "step": step}
        bodies += [
            (delta & 255).astype(np.uint8).tobytes(),
            (delta >> 8).astype(np.uint8).tobytes(),
        ]
    text = json.dumps({**plain, "arrays": described}, allow_nan=False).encode("utf-8")
    raw = struct.pack("<I", len(text)) + text + b"".join(bodies)
    return base64.b64encode(zlib.compress(raw, 9)).decode("ascii")


def unpacked(text: str) -> tuple[dict[str, object], dict[str, FloatArray]]:
    """The inverse of :func:`packed`, up to its rounding; arrays are flat."""
    raw = zlib.decompress(base64.b64decode(text))
    (length,) = struct.unpack_from("<I", raw)
    plain = json.loads(raw[4 : 4 + length])
    at, arrays = 4 + length, {}
    for name, about in plain.pop("arrays").items():
        count = about["count"]
        low, high = (np.frombuffer(raw, np.uint8, count, at + i * count) for i in (0, 1))
        level = np.cumsum(low.astype(np.int64) + 256 * high.astype(np.int64)) % (LEVELS + 1)
        arrays[name] = about["low"] + level * about["step"]
        at += 2 * count
    return plain, arrays
