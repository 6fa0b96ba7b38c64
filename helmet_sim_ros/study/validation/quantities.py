"""Quantities of an impact that experiments state and that are no criteria."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.errors import PulseError


class Quantity(NamedTuple):
    """What a quantity is: its unit, meaning, and how it is computed."""

    unit: str
    meaning: str
    of: Callable[[ImpactRecord], float]


def neck_force_at_peak(record: ImpactRecord) -> float:
    """Amount of the neck's force on the head when the head's acceleration peaks [N]."""
    return float(np.linalg.norm(record.neck_force[_peak(record)]))


def helmet_head_force(record: ImpactRecord) -> float:
    """Largest force of the helmet on the head [N]."""
    return float(np.linalg.norm(record.coupling_force, axis=1).max())


def effective_mass(record: ImpactRecord) -> float:
    """Ground force over head acceleration, both along the latter at its peak [kg]."""
    i = _peak(record)
    acceleration = record.head_acceleration[i]
    along = acceleration / np.linalg.norm(acceleration)
    return float(record.ground_force[i] @ along / np.linalg.norm(acceleration))


def neck_share(record: ImpactRecord) -> float:
    """What the neck adds to the head's effective mass [kg]: its force against the head's
    acceleration, over that acceleration, at the peak."""
    i = _peak(record)
    acceleration = record.head_acceleration[i]
    size = float(np.linalg.norm(acceleration))
    force = Rotation.from_quat(record.head_orientation[i]).apply(record.neck_force[i])
    return float(-force @ acceleration / size**2)


def liner_crush(record: ImpactRecord) -> float:
    """Largest crush of the foam liner [m]: the largest strain of its columns in this and earlier
    impacts, times the liner's thickness (of a liner that is the same all over).

    Raises:
        PulseError: the record is not of a foam helmet.
    """
    if "crush" not in record.extras:
        raise PulseError("liner_crush: this record is not of a foam helmet")
    strain = float(np.max(record.extras["crush"], initial=0.0))
    return strain * float(record.setup["helmet.liner.thickness"])


def _peak(record: ImpactRecord) -> int:
    return int(np.linalg.norm(record.head_acceleration, axis=1).argmax())


#: By name, as ``config/references`` uses them beside the criteria of the catalogue.
QUANTITIES: Mapping[str, Quantity] = {
    "neck_force_at_peak": Quantity(
        "N", "neck force at the peak of the head acceleration", neck_force_at_peak
    ),
    "helmet_head_force": Quantity("N", "largest force of helmet on head", helmet_head_force),
    "liner_crush": Quantity("m", "largest crush of the liner", liner_crush),
    "effective_mass": Quantity("kg", "ground force over head acceleration", effective_mass),
    "neck_share": Quantity("kg", "mass that the neck adds to the head", neck_share),
}
