"""Segment masses, lengths, centres and inertias of the rider (de Leva 1996, male).

The reference values are those of a man of 1.75 m and 77 kg. Lengths scale with the height, masses
with the body mass, moments of inertia with mass times height squared (geometric similarity).

Sources: P. de Leva, J. Biomech. 29(9), 1996 (mass fractions, lengths, centres, radii of
gyration); head without neck: T. Beier et al. 1980 (radii of gyration 6.89 / 7.18 / 5.85 cm).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from helmet_sim_ros.model.setup import Rider

REFERENCE_HEIGHT = 1.75  # m
REFERENCE_MASS = 77.0  # kg
REFERENCE_HEAD_MASS = 4.5  # kg, head without neck
HEAD_GYRATION = (0.0689, 0.0718, 0.0585)  # m, about x (sagittal), y (transverse), z axes; Beier
HEAD_JOINT_DEPTH = 0.150  # m, vertex to atlanto-occipital joint (general literature value)
NECK_RADIUS = 0.060  # m (general literature value)
SHOULDER_DEPTH = 0.0883  # m, cervicale to shoulder joints (de Leva: trunk CERV-MIDH less MIDS-MIDH)
SHOULDER_HALF_WIDTH = 0.175  # m, joint centres (general literature value)
HIP_HALF_WIDTH = 0.085  # m, joint centres (general literature value)


@dataclass(frozen=True)
class Segment:
    """One rigid body segment of the rider.

    Attributes:
        mass: [kg].
        length: proximal to distal end [m].
        center: distance of the centre of mass from the proximal (upper) end, for the foot from
            the heel [m].
        inertia: about the centre of mass: sagittal (x), transverse (y), longitudinal axis [kg m^2].
    """

    mass: float
    length: float
    center: float
    inertia: tuple[float, float, float]


# name: mass fraction, length [m], centre [m], inertia [kg m^2] at the reference height and mass
_REFERENCE: dict[str, tuple[float, float, float, tuple[float, float, float]]] = {
    "head_neck": (0.0694, 0.2442, 0.1221, (0.02925, 0.03161, 0.02170)),
    "upper_trunk": (0.1596, 0.2434, 0.1233, (0.1856, 0.0745, 0.1574)),
    "middle_trunk": (0.1633, 0.2166, 0.0975, (0.1371, 0.0866, 0.1292)),
    "lower_trunk": (0.1117, 0.1465, 0.0896, (0.0698, 0.0560, 0.0636)),
    "upper_arm": (0.0271, 0.2832, 0.1634, (0.01359, 0.01211, 0.00418)),
    "forearm": (0.0162, 0.2703, 0.1236, (0.00694, 0.00640, 0.00133)),
    "hand": (0.0061, 0.0866, 0.0685, (0.00139, 0.00093, 0.00057)),
    "thigh": (0.1416, 0.4244, 0.1738, (0.2126, 0.2126, 0.0436)),
    "shank": (0.0433, 0.4362, 0.1945, (0.0413, 0.0393, 0.0067)),
    "foot": (0.0137, 0.2594, 0.1145, (0.0047, 0.0043, 0.0011)),
}


@dataclass(frozen=True)
class Anthropometry:
    """All segments and the joint locations that the segment table does not give.

    Attributes:
        scale: height over the reference height [-].
        segments: by name; ``head`` and ``neck`` together have the mass and centre of the table's
            "head+neck".
        head_depth: vertex to the head's centre of gravity [m].
        head_joint_depth: vertex to the head-neck joint [m].
        cervicale_depth: vertex to the lower end of the neck [m].
        shoulder_depth, shoulder_half_width: shoulder joints from the cervicale [m].
        hip_half_width: hip joints from the mid-plane [m].
        ankle_height: sole to ankle, what the segments leave of the height [m].
    """

    scale: float
    segments: dict[str, Segment]
    head_depth: float
    head_joint_depth: float
    cervicale_depth: float
    shoulder_depth: float
    shoulder_half_width: float
    hip_half_width: float
    ankle_height: float


@lru_cache(maxsize=64)
def anthropometry(rider: Rider) -> Anthropometry:
    """The rider's segments, scaled by height and mass.

    A head mass of the user's replaces the table's; the other segments share the rest of the body
    mass in the table's proportions, so that the total stays ``rider.mass``.
    """
    scale = rider.height / REFERENCE_HEIGHT
    table_head = REFERENCE_HEAD_MASS / REFERENCE_MASS * rider.mass
    head_mass = table_head if rider.head_mass is None else rider.head_mass
    body_mass = rider.mass * (rider.mass - head_mass) / (rider.mass - table_head)
    segments = {
        name: Segment(
            fraction * body_mass,
            length * scale,
            center * scale,
            _scaled(inertia, body_mass / REFERENCE_MASS * scale**2),
        )
        for name, (fraction, length, center, inertia) in _REFERENCE.items()
    }
    head_neck = segments.pop("head_neck")
    neck_fraction = _REFERENCE["head_neck"][0] - REFERENCE_HEAD_MASS / REFERENCE_MASS
    neck_mass = neck_fraction * body_mass
    joint_depth = HEAD_JOINT_DEPTH * scale
    neck_length = head_neck.length - joint_depth
    neck_center = joint_depth + 0.5 * neck_length
    # Head and neck together keep the table's centre of mass (at the table's head mass).
    head_depth = (_REFERENCE["head_neck"][0] * head_neck.center - neck_fraction * neck_center) / (
        REFERENCE_HEAD_MASS / REFERENCE_MASS
    )
    sagittal, transverse, longitudinal = (head_mass * (k * scale) ** 2 for k in HEAD_GYRATION)
    segments["head"] = Segment(
        head_mass, joint_depth, head_depth, (sagittal, transverse, longitudinal)
    )
    radius = NECK_RADIUS * scale
    across = neck_mass * (3.0 * radius**2 + neck_length**2) / 12.0  # solid cylinder
    segments["neck"] = Segment(
        neck_mass, neck_length, 0.5 * neck_length, (across, across, 0.5 * neck_mass * radius**2)
    )
    stacked = ("upper_trunk", "middle_trunk", "lower_trunk", "thigh", "shank")
    return Anthropometry(
        scale=scale,
        segments=segments,
        head_depth=head_depth,
        head_joint_depth=joint_depth,
        cervicale_depth=head_neck.length,
        shoulder_depth=SHOULDER_DEPTH * scale,
        shoulder_half_width=SHOULDER_HALF_WIDTH * scale,
        hip_half_width=HIP_HALF_WIDTH * scale,
        ankle_height=rider.height
        - head_neck.length
        - sum(segments[name].length for name in stacked),
    )


def _scaled(vector: tuple[float, float, float], factor: float) -> tuple[float, float, float]:
    x, y, z = vector
    return x * factor, y * factor, z * factor
