"""What a falling body lands on: stiffness and thickness of the tissue of each region.

Stiffnesses are slow ones; pressed fast, tissue is ``FAST`` times as stiff. Where the source gives a
dynamic secant, it is divided by that.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.force.tissue import RESOLVES


class Region(NamedTuple):
    """Of one region: stiffness of the first contact [N/m], thickness at a height of 1.75 m [m]."""

    stiffness: float
    thickness: float


#: By the beginning of a segment's name. Read: pelvis, secant 24.6 to 35.6 kN/m on the side (Choi,
#: Park & Choi, J. Biomech. 162, 2023, 111885); thorax, 2.29 kN at 59 mm, 4.3 m/s, a hub of 150 mm
#: (Yoganandan et al., Proc. AAAM 40, 1996: 39 kN/m), three times as much where the load is
#: distributed (Kent et al., Traffic Inj. Prev. 4, 2003), of which a ground's is between; shoulder,
#: 30 mm at 23.4 kg and 1.5 m/s, 60 mm at 4 to 6 m/s (Compigne et al., IRCOBI 2003: at most
#: 58 kN/m). Abdomen: about 24 kN/m at 6 m/s (Cavanaugh et al. 1986, general). Limbs, hands and feet
#: and all thicknesses are general anatomy: muscle and skin over bone, of the trunk what gives way
#: before the spine is met: half a chest's breadth of 0.3 m less half a vertebra. An upper arm is
#: struck where it hangs on the shoulder, whose girdle gives way by 60 mm beside the flesh over it.
REGIONS: dict[str, Region] = {
    "pelvis": Region(30e3, 0.090),
    "abdomen": Region(12e3, 0.120),
    "thorax": Region(40e3, 0.110),
    "upper_arm": Region(29e3, 0.100),
    "forearm": Region(40e3, 0.025),
    "hand": Region(40e3, 0.020),
    "thigh": Region(40e3, 0.050),
    "shank": Region(50e3, 0.030),
    "foot": Region(60e3, 0.025),
}
DAMPING = 1.5  # s/m; choice: a body rebounds at 0.7 m/s at most, as falls on film show
FRICTION = 0.5  # of clothing on a road; 0.4 to 0.7 in slides of riders (general literature value)
RELAXATION = 2e-3  # s, damping over stiffness along the surface (choice: a body at rest is quiet)
STRAIGHT = 0.99  # largest share of the thickness on the hardening law
GROUND_STEP, SELF_STEP = 5e-5, 1e-4  # s; that resolve the stiffest tissue on a surface, on another


def region_of(name: str, scale: float) -> Region:
    """The region that a body segment belongs to, of a rider of a height over 1.75 m."""
    for start, region in REGIONS.items():
        if name.startswith(start):
            return region._replace(thickness=scale * region.thickness)
    raise KeyError(name)


def straight_share(stiffness: FloatArray, mass: FloatArray, step: float) -> FloatArray:
    """Share of its thickness beyond which a tissue of a stiffness [N/m] in front of a mass [kg]
    hardens no more, so that steps of ``step`` [s] resolve it."""
    steepest = mass * (RESOLVES / step) ** 2
    return np.minimum(STRAIGHT, 1.0 - np.sqrt(np.minimum(1.0, stiffness / steepest)))
