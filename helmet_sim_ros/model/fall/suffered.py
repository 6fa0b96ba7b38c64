"""What helmet and neck suffered in one head strike beyond what they have, in words."""

from __future__ import annotations

import numpy as np

from helmet_sim_ros.biomech.record import SHELL, FloatArray, ImpactRecord
from helmet_sim_ros.biomech.rotation import matrices
from helmet_sim_ros.model.force.columns import columns
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.rider.neck import JOINTS, strained
from helmet_sim_ros.model.watch import compressed, crushed
from helmet_sim_ros.model.world import World


def suffered(
    record: ImpactRecord, window: slice, helmet: Helmet, world: World, yielded: float
) -> tuple[str, ...]:
    """What went beyond what there is, as an impact tells it.

    Args:
        record: of a fall.
        window: the samples of the strike.
        helmet: what is worn.
        yielded: shortening that the neck has kept of what was before [m].
    """
    joints, positions = record.joint_names, record.joint_positions[window]
    turns = [
        np.column_stack([positions[:, joints.index(f"{name}.{axis}")] for axis in "xyz"])
        for name in JOINTS
    ]
    lengths = positions[:, joints.index("neck_axial")] + yielded
    notes = strained(world.parts.neck, lengths, turns)
    if SHELL in record.extras:
        strokes = np.linalg.norm(record.extras[SHELL][window], axis=1)
        return notes + compressed(float(strokes.max()), helmet)
    if helmet.coupling == "foam":
        return notes + crushed(*_deepest(record, window, helmet))
    return notes


def _deepest(record: ImpactRecord, window: slice, helmet: Helmet) -> tuple[float, FloatArray]:
    """Strain of a foam liner where the surface is deepest in its shell, and the place there, helmet
    frame, (3,) [m]."""
    away = record.helmet_position[window] - record.head_position[window]
    turns = matrices(record.head_orientation[window])
    crush = np.einsum("nij,nj->ni", turns, record.coupling_displacement[window]) - away
    depths = np.linalg.norm(crush, axis=1)
    i = int(depths.argmax())
    turn = matrices(record.helmet_orientation[window][i : i + 1])[0]
    cells = columns(helmet)
    struck = int((cells.normal @ (turn.T @ -crush[i])).argmax())
    return float(depths[i] / cells.thickness[struck]), cells.point[struck]
