"""Segment masses, lengths, centres and inertias of the rider (de Leva 1996, men and women).

Lengths scale with the height, masses with the body mass, moments of inertia with mass times
height squared (geometric similarity). The head follows the circumference of the skull instead,
which hardly grows with the body.

Sources: P. de Leva, J. Biomech. 29(9), 1996, table 4 (mass fractions, lengths, centres, radii of
gyration). Head without neck: radii of gyration T. Beier et al. 1980; mass over circumference
C. Clauser, J. McConville & J. Young, AMRL-TR-69-70, 1969 (general literature value); circumference
over height and body mass: ANSUR II, 2014, as in ``config/populations/ansur_ii.yaml``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

from helmet_sim_ros.model.rider.properties import Rider, Sex

Vector = tuple[float, float, float]

REFERENCE_HEIGHT = 1.75  # m, of the man whose head has REFERENCE_HEAD_MASS
REFERENCE_MASS = 77.0  # kg
REFERENCE_HEAD_MASS = 4.5  # kg, head without neck (general literature value)
HEAD_GYRATION = (0.0689, 0.0718, 0.0585)  # m, about x (sagittal), y (transverse), z axes; Beier
HEAD_MASS_PER_CIRCUMFERENCE = 14.8  # kg/m, Clauser et al.: 0.148 circumference [cm] - 3.716
HEAD_JOINT_DEPTH = 0.150  # m, vertex to atlanto-occipital joint (general literature value)
NECK_RADIUS = 0.060  # m (general literature value)
NECK_SHARE = 0.158  # mass of the neck over that of head and neck: (0.0694 * 77 - 4.5) / 5.344
SHOULDER_HALF_WIDTH = 0.175  # m, joint centres (general literature value)
HIP_HALF_WIDTH = 0.085  # m, joint centres (general literature value)

#: Mean circumference of the head at mean height and ln(body mass) [m], its slope over height and
#: over ln(mass / kg) [m], those means [m, -]: the conditional mean of ANSUR's normal distribution.
_CIRCUMFERENCE: dict[Sex, tuple[float, float, float, float, float]] = {
    "male": (0.5744, 0.03122, 0.04295, 1.7562, 4.4351),
    "female": (0.5611, 0.04715, 0.03564, 1.6285, 4.2030),
}


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
    inertia: Vector


@dataclass(frozen=True)
class _Table:
    """De Leva's table 4: standing height [m], length of the trunk from cervicale and from the
    shoulder joints' middle to the hips' [m], and of each segment mass / body mass, length [m],
    centre / length, radii of gyration / length about sagittal, transverse, longitudinal axis."""

    height: float
    trunk: tuple[float, float]
    segments: dict[str, tuple[float, float, float, Vector]]


_TABLES: dict[Sex, _Table] = {
    "male": _Table(
        1.741,
        (0.6033, 0.5155),
        {
            "head_neck": (0.0694, 0.2429, 0.5002, (0.303, 0.315, 0.261)),
            "upper_trunk": (0.1596, 0.2421, 0.5066, (0.505, 0.320, 0.465)),
            "middle_trunk": (0.1633, 0.2155, 0.4502, (0.482, 0.383, 0.468)),
            "lower_trunk": (0.1117, 0.1457, 0.6115, (0.615, 0.551, 0.587)),
            "upper_arm": (0.0271, 0.2817, 0.5772, (0.285, 0.269, 0.158)),
            "forearm": (0.0162, 0.2689, 0.4574, (0.276, 0.265, 0.121)),
            "hand": (0.0061, 0.0862, 0.7900, (0.628, 0.513, 0.401)),
            "thigh": (0.1416, 0.4222, 0.4095, (0.329, 0.329, 0.149)),
            "shank": (0.0433, 0.4340, 0.4459, (0.255, 0.249, 0.103)),
            "foot": (0.0137, 0.2581, 0.4415, (0.257, 0.245, 0.124)),
        },
    ),
    "female": _Table(
        1.735,
        (0.6148, 0.4979),
        {
            "head_neck": (0.0668, 0.2437, 0.4841, (0.271, 0.295, 0.261)),
            "upper_trunk": (0.1545, 0.2280, 0.5050, (0.466, 0.314, 0.449)),
            "middle_trunk": (0.1465, 0.2053, 0.4512, (0.433, 0.354, 0.415)),
            "lower_trunk": (0.1247, 0.1815, 0.4920, (0.433, 0.402, 0.444)),
            "upper_arm": (0.0255, 0.2751, 0.5754, (0.278, 0.260, 0.148)),
            "forearm": (0.0138, 0.2643, 0.4559, (0.261, 0.257, 0.094)),
            "hand": (0.0056, 0.0780, 0.7474, (0.531, 0.454, 0.335)),
            "thigh": (0.1478, 0.3685, 0.3612, (0.369, 0.364, 0.162)),
            "shank": (0.0481, 0.4323, 0.4416, (0.271, 0.267, 0.093)),
            "foot": (0.0129, 0.2283, 0.4014, (0.299, 0.279, 0.139)),
        },
    ),
}
_UNPAIRED = frozenset({"head_neck", "upper_trunk", "middle_trunk", "lower_trunk"})


@dataclass(frozen=True)
class Anthropometry:
    """All segments and the joint locations that the segment table does not give.

    Attributes:
        scale: height over the reference height [-].
        segments: by name; ``head`` and ``neck`` together have the centre of the table's
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


def head_circumference(sex: Sex, height: float, mass: float) -> float:
    """Mean circumference of the head [m] at a height [m] and body mass [kg] (ANSUR II)."""
    mean, per_height, per_log_mass, mean_height, mean_log_mass = _CIRCUMFERENCE[sex]
    return (
        mean + per_height * (height - mean_height) + per_log_mass * (math.log(mass) - mean_log_mass)
    )


def head_mass(sex: Sex, height: float, mass: float) -> float:
    """Mass of the head without neck [kg] at a height [m] and body mass [kg].

    The slope over the circumference is Clauser's (men); the level is chosen so that a man of
    1.75 m and 77 kg has 4.5 kg, where Clauser's constant would give 4.7.
    """
    reference = head_circumference("male", REFERENCE_HEIGHT, REFERENCE_MASS)
    around = head_circumference(sex, height, mass)
    return REFERENCE_HEAD_MASS + HEAD_MASS_PER_CIRCUMFERENCE * (around - reference)


@lru_cache(maxsize=64)
def anthropometry(rider: Rider) -> Anthropometry:
    """The rider's segments, scaled by height and mass.

    The head has the mass of :func:`head_mass`, or the user's; the other segments share the rest
    of the body mass in the table's proportions, so that the total stays ``rider.mass``.
    """
    table = _TABLES[rider.sex]
    scale = rider.height / table.height
    head = rider.head_mass
    if head is None:
        head = head_mass(rider.sex, rider.height, rider.mass)
    fractions = {name: row[0] for name, row in table.segments.items()}
    fractions["neck"] = NECK_SHARE * fractions.pop("head_neck")
    whole = sum(f if n in _UNPAIRED or n == "neck" else 2.0 * f for n, f in fractions.items())
    masses = {name: f * (rider.mass - head) / whole for name, f in fractions.items()}
    segments = {
        name: _scaled(masses[name], length * scale, center, gyration)
        for name, (_, length, center, gyration) in table.segments.items()
        if name in masses
    }
    cervicale = table.segments["head_neck"][1] * scale
    body_scale = rider.height / REFERENCE_HEIGHT
    joint_depth = HEAD_JOINT_DEPTH * body_scale
    neck_length = cervicale - joint_depth
    # Head and neck together have the table's centre of mass (at the table's share of the neck).
    together = table.segments["head_neck"][2] * cervicale
    head_depth = (together - NECK_SHARE * (joint_depth + 0.5 * neck_length)) / (1.0 - NECK_SHARE)
    # A heavier head is larger, not denser.
    size = (head / REFERENCE_HEAD_MASS) ** (1.0 / 3.0)
    ix, iy, iz = (head * (k * size) ** 2 for k in HEAD_GYRATION)
    segments["head"] = Segment(head, joint_depth, head_depth, (ix, iy, iz))
    segments["neck"] = cylinder(masses["neck"], neck_length, NECK_RADIUS * body_scale)
    stacked = ("upper_trunk", "middle_trunk", "lower_trunk", "thigh", "shank")
    return Anthropometry(
        scale=body_scale,
        segments=segments,
        head_depth=head_depth,
        head_joint_depth=joint_depth,
        cervicale_depth=cervicale,
        shoulder_depth=(table.trunk[0] - table.trunk[1]) * scale,
        shoulder_half_width=SHOULDER_HALF_WIDTH * body_scale,
        hip_half_width=HIP_HALF_WIDTH * body_scale,
        ankle_height=rider.height - cervicale - sum(segments[name].length for name in stacked),
    )


def cylinder(mass: float, length: float, radius: float) -> Segment:
    """A solid upright cylinder [kg, m, m]."""
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    return Segment(mass, length, 0.5 * length, (across, across, 0.5 * mass * radius**2))


def _scaled(mass: float, length: float, center: float, gyration: Vector) -> Segment:
    x, y, z = (mass * (k * length) ** 2 for k in gyration)
    return Segment(mass, length, center * length, (x, y, z))
