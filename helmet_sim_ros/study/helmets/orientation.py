"""How a mesh stands to the head: axes given by name, or by landmarks on it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError

AXES = {
    f"{sign}{letter}": (-1.0 if sign == "-" else 1.0) * np.eye(3)[i]
    for i, letter in enumerate("xyz")
    for sign in ("", "+", "-")
}
LANDMARKS = ("front", "back", "left", "right", "top")


def by_axes(forward: str, up: str) -> FloatArray:
    """Rotation from the mesh's to head axes (x forward, y left, z up), (3, 3).

    Args:
        forward, up: axes of the mesh, ``x``, ``-y``, ...

    Raises:
        SetupError: no axis, or twice the same.
    """
    for key, axis in (("forward", forward), ("up", up)):
        if axis not in AXES:
            raise SetupError.of(key, axis, f"must be one of {', '.join(AXES)}")
    x, z = AXES[forward], AXES[up]
    if x @ z:
        raise SetupError.of("up", up, f"must be across forward, {forward}")
    return np.array([x, np.cross(z, x), z])


def by_landmarks(points: Mapping[str, FloatArray]) -> FloatArray:
    """Rotation from the mesh's to head axes, (3, 3).

    Forward runs from ``back`` to ``front``, left from ``right`` to ``left``; ``top`` tells which
    way is up. The pair that is given sets its axis, the other is made square to it.

    Args:
        points: of ``LANDMARKS``, in the mesh's axes, each (3,).

    Raises:
        SetupError: an unknown or missing landmark, or points on one line.
    """
    for name in points:
        if name not in LANDMARKS:
            raise SetupError.of("landmark", name, f"must be one of {', '.join(LANDMARKS)}")
    missing = [name for name in ("left", "right", "front", "back") if name not in points]
    if missing:
        raise SetupError.of(
            "landmark", sorted(points), f"misses {', '.join(missing)}: left, right, front and back "
            "tell the axes",
        )  # fmt: skip
    y = _unit(points["left"] - points["right"])
    forward = points["front"] - points["back"]
    x = _unit(forward - (forward @ y) * y)
    z = np.cross(x, y)
    if "top" in points:
        middle = 0.25 * sum(points[name] for name in ("left", "right", "front", "back"))
        if (points["top"] - middle) @ z < 0.0:
            raise SetupError.of(
                "landmark.top", points["top"].tolist(),
                "lies below the others: left and right, or front and back, are exchanged",
            )  # fmt: skip
    return np.array([x, y, z])


def _unit(vector: FloatArray) -> FloatArray:
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise SetupError.of("landmark", vector.tolist(), "two landmarks must lie apart")
    return vector / length
