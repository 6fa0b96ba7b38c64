"""No result that cannot be: a bound on the energy while stepping, strokes beyond what there is."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.model.geometry import ZONES
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.layout import Layout
from helmet_sim_ros.model.loop import Forces, Rows
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.surface.compiled import Surface

MARGIN = 1.02  # of the initial kinetic energy, for the integrator's error
BOTTOMED = 0.95  # strain of a column beyond which its foam law is a guess


def most_energy(
    model: mujoco.MjModel, data: mujoco.MjData, setup: ImpactSetup | Fall, surface: Surface
) -> tuple[float, float, float]:
    """The most kinetic energy [J] at the start of an impact, how fast gravity can add to it [W],
    and the rate of change of that [W/s].

    Nothing but gravity g can speed the mass m up: it falls at most v t + g t^2 / 2. One tenth of a
    second's worth is added for what the posture's springs hold. What moves may throw the rider back
    twice as fast as it moves.
    """
    mass, speed = float(model.body_subtreemass[1]), float(np.linalg.norm(data.qvel[:3]))
    start = 0.5 * mass * speed**2
    if isinstance(setup, Fall) or setup.state is not None:  # not all move as one
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_energyVel(model, data)
        fastest = 2.0 * float(np.linalg.norm(surface.velocity, axis=1).max())
        speed = math.sqrt(2.0 * float(data.energy[1]) / mass) + fastest
        start = 0.5 * mass * speed**2
    weight = mass * setup.gravity
    return (
        MARGIN * start + 0.1 * weight * (1.0 + speed) + 1.0,
        weight * speed,
        0.5 * weight * setup.gravity,
    )


def overloaded(
    helmet: Helmet, forces: Forces, rows: Rows, done: int, layout: Layout
) -> tuple[str, ...]:
    """What the helmet suffered beyond what it has, in words."""
    if layout.slide < 0:
        largest = forces.liner.largest
        if not len(largest):
            return ()
        most = int(largest.argmax())
        return crushed(float(largest[most]), forces.liner.columns.point[most])
    stroke = np.linalg.norm(rows.qpos[:done, layout.slide : layout.slide + 3], axis=1)
    return compressed(float(stroke.max(initial=0.0)), helmet)


def crushed(strain: float, point: FloatArray) -> tuple[str, ...]:
    """A foam helmet's liner crushed beyond what foam has, in words.

    Args:
        strain: largest of any column.
        point: of the column, helmet frame, (3,) [m].
    """
    if strain <= BOTTOMED:
        return ()
    x, y, z = point * 1e3
    return (
        f"the liner is crushed by {100 * strain:.0f} % at ({x:.0f}, {y:.0f}, {z:.0f}) mm, more "
        "than foam has: do not rely on forces there",
    )


def compressed(stroke: float, helmet: Helmet) -> tuple[str, ...]:
    """A helmet's coupling spring compressed beyond what the liner has, in words.

    Args:
        stroke: longest of the shell against the head [m].
    """
    thickness = max(helmet.liner.zone_thickness(zone) for zone in ZONES)
    if stroke <= thickness:
        return ()
    return (
        f"the coupling spring was compressed by {stroke * 1e3:.0f} mm, more than the "
        f"{thickness * 1e3:.0f} mm that the liner has: use helmet.coupling foam beyond its range",
    )
