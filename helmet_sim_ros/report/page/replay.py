"""The scene of an impact for the report's 3-D replay: shapes, and where they are over time."""

from __future__ import annotations

import base64

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.model.arrows import force_arrows
from helmet_sim_ros.report.replay.scene import scene_of

#: Pictures of one replay.
FRAMES = 81


def replay_data(record: ImpactRecord) -> dict[str, object]:
    """Plain data for ``report.js``.

    Returns:
        ``shapes`` (kind, size [m], color), ``time`` [ms], ``poses``: x, y, z, quaternion x, y, z, w
        of every shape and frame, ``arrows``: tail and tip of every force arrow and frame, ``names``
        of the arrows; arrays as base64 of little-endian 32-bit floats.

    Raises:
        LogError: this version's model cannot show the record.
    """
    scene = scene_of(record)
    frames = np.unique(np.linspace(0, len(record) - 1, FRAMES).astype(int))
    poses, arrows = [], []
    for index in frames.tolist():
        poses.append(np.hstack(scene.poses(record, index)))
        arrows.append([np.hstack([a.tail, a.tip]) for a in force_arrows(record, index)])
    first = force_arrows(record, 0)
    return {
        "shapes": [
            {"name": s.name, "kind": s.kind, "size": list(s.size), "color": css_color(s.color)}
            for s in scene.shapes
        ],
        "time": packed(record.time[frames] * 1e3),
        "poses": packed(np.array(poses)),
        "arrows": packed(np.array(arrows)),
        "arrowColors": [css_color(arrow.color) for arrow in first],
        "names": [arrow.name for arrow in first],
    }


def packed(values: FloatArray) -> str:
    """An array as base64 of little-endian 32-bit floats, last axis fastest."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def css_color(color: tuple[float, float, float, float]) -> str:
    """``rgba(204,38,38,1)``."""
    r, g, b = (round(255 * value) for value in color[:3])
    return f"rgba({r},{g},{b},{color[3]:g})"
