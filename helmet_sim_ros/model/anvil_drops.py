"""The coupling spring on what is not flat: identified from drops of the liner and its shell there.

A spring that was identified on flat ground would give a kerb the peak of flat ground. The foam
helmet, at the pose of the impact and free to move along the surface's normal alone, is dropped on
the surface at four speeds (Hyncik & Bonkowski, section 2.2, with another anvil); the law through
the peaks holds for every side of the head, since only the struck one is asked.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.force import laying, liner, shell
from helmet_sim_ros.model.force.bodies import FORCE, HELMET, Loads, Motion, clear
from helmet_sim_ros.model.force.columns import columns, first_touch
from helmet_sim_ros.model.force.foam import bottoming_strain
from helmet_sim_ros.model.helmet import Helmet, Spring, SpringLaw
from helmet_sim_ros.model.identified import FASTEST, HEAD_MASS, SPEEDS, exponential_through
from helmet_sim_ros.model.placement import head_in_frame
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.surface.config import SurfaceConfig

STEP = 5e-5  # s; half of it moves no peak by more than 0.5 %
LONGEST = 0.03  # s, until a drop has left the surface again
PATCH = 0.05  # m, radius of the shell that a usual blow flattens: sqrt(2 R d)
UNEVEN = 2e-3  # m, that a surface may fall away within it and still count as flat
SLOWER = 0.85  # of the fastest drop, as long as that bottoms the liner out


class Drop(NamedTuple):
    """One drop: crush [m] and force [N] at the greatest force, speeds up over down [-] (0 where it
    was not followed so far), and the largest strain over that at which the foam bottoms out [-]."""

    crush: float
    force: float
    restitution: float
    bottomed: float


def unevenness(surface: SurfaceConfig) -> float:
    """How far a surface falls away about its target [m]; 0: no more than counts as flat."""
    if surface.is_flat_ground:
        return 0.0
    gap = surface.falls_away(PATCH)
    return gap if gap >= UNEVEN else 0.0


def on_its_surface(setup: ImpactSetup, helmet: Helmet) -> Helmet:
    """The helmet of a setup with the spring that its liner has on what is struck.

    A spring that a file gives is left as it is.
    """
    follows = helmet.coupling == "spring" and helmet.spring.identified
    if not follows or unevenness(setup.surface_config) == 0.0:
        return helmet
    rotation = setup.surface_config.frame[1] @ head_in_frame(setup)
    spring = identified_there(helmet, setup.surface_config, rotation)
    adapted: Helmet = helmet.model_copy(update={"spring": spring})
    return adapted


def identified_there(helmet: Helmet, surface: SurfaceConfig, rotation: FloatArray) -> Spring:
    """The spring of a helmet on a surface.

    Costs 0.3 to 1 s, once per helmet, surface, pose and process.

    Args:
        helmet: whose liner and shell are dropped.
        surface: on its target.
        rotation: head to world at the first touch, (3, 3).
    """
    rounded = np.round(rotation, 9)  # poses that differ by rounding share a spring
    return _identified(helmet, surface, tuple(rounded.ravel()))


@lru_cache(maxsize=64)
def _identified(helmet: Helmet, surface: SurfaceConfig, rotation: tuple[float, ...]) -> Spring:
    turn = np.array(rotation).reshape(3, 3)
    fastest = FASTEST
    while _drop(helmet, surface, turn, fastest).bottomed > 1.0 and fastest > 1.0:
        fastest *= SLOWER
    drops = [_drop(helmet, surface, turn, share * fastest) for share in SPEEDS[:-1]]
    drops.append(_drop(helmet, surface, turn, fastest, back=True))
    force = np.array([drop.force for drop in drops])
    crush = np.array([drop.crush for drop in drops]) - force / helmet.shell.contact_stiffness
    stiffness, exponent, _ = exponential_through(crush, force)
    law = SpringLaw(A=stiffness / exponent, B=exponent)
    loss = 1.0 - drops[-1].restitution ** 2
    return Spring(
        front=law,
        back=law,
        side=law,
        top=law,
        strap=helmet.spring.strap,
        energy_loss=min(loss, 0.98),
        bears=helmet.spring.bears,
        identified=True,
    )


def _drop(
    helmet: Helmet, surface: SurfaceConfig, turn: FloatArray, speed: float, back: bool = False
) -> Drop:
    """A drop of head and helmet as one mass that moves along the normal of the target; ``back``:
    until it has left the surface again."""
    foam = helmet.model_copy(update={"coupling": "foam"})
    struck, table = surface.compiled(), columns(foam)
    crushing = liner.crushing_liner(table, foam, 0, len(struck.kind), np.zeros(len(table.area)))
    outside = laying.shell(foam, crushing)
    bends = shell.spreads(outside, struck)
    target, frame = surface.frame
    normal = frame[:, 2]
    place, velocity = np.zeros((1, 3)), np.zeros((1, 6))
    none = np.zeros(0)
    motion = Motion(
        none, none, place, turn.reshape(1, 9).copy(), velocity, np.zeros(3), place,
        np.zeros((0, 6)),
    )  # fmt: skip
    loads = Loads(none, np.zeros((1, 6)), np.zeros(6), np.zeros(3), np.zeros((2, 9)))
    start = target - turn @ first_touch(foam, turn.T @ -normal)
    mass, depth, down, most = HEAD_MASS + foam.mass, 0.0, speed, (0.0, 0.0)
    for _ in range(round(LONGEST / STEP)):
        place[0] = start - depth * normal
        velocity[0, 3:] = -down * normal
        clear(loads)
        if bends:
            shell.apply(outside, crushing, struck, STEP, motion, loads)
        else:
            liner.apply(crushing, struck, STEP, motion, loads)
        force = float(loads.surface[HELMET, FORCE : FORCE + 3] @ normal)
        if force > most[1]:
            most = (depth, force)
        if down < 0.0 and (force <= 0.0 or not back):
            break
        down -= STEP * force / mass
        depth += STEP * down
    limits = np.array([bottoming_strain(row) for row in table.foam])
    return Drop(
        *most, max(0.0, -down) / speed if back else 0.0, float((crushing.largest / limits).max())
    )
