"""Contact of convex shapes with the flat ground: stiff normal law, Coulomb friction that sticks.

Normal force: F_n = k d (1 + c d'), never negative (Hunt & Crossley, J. Appl. Mech. 42, 1975).
Friction: an elastic tangential deflection s with F_t = -k_t (s + tau s'), limited to mu F_n by
letting s slip (Cundall & Strack, Geotechnique 29, 1979), so |F_t| / F_n never exceeds mu.

MuJoCo's own contacts are not used: their convex friction cone couples the normal force to the
slip speed. In a headform drop at 5 m/s it more than doubled the first force peak when 20 m/s of
tangential speed were added, which Coulomb friction cannot do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.tree import WORLD_ORIGIN, add_force

TANGENTIAL_SHARE = 0.8  # k_t / k; Mindlin: 2 (1 - nu) / (2 - nu), 0.82 for nu = 0.3
RELAXATION = 5e-5  # s, tau: damps the stick oscillation of a light shell

#: Columns of a law row.
STIFFNESS, DAMPING, FRICTION = 0, 1, 2


@dataclass(frozen=True)
class Shapes:
    """Ellipsoids (spheres among them) that may touch the ground; row i belongs to shape i.

    Attributes:
        body: MuJoCo body that carries the shape, shape (n,).
        center: in that body's frame, (n, 3) [m].
        semi_axes: along the body's axes, (n, 3) [m].
        law: normal stiffness k [N/m], damping c [s/m], friction mu [-]; (n, 3).
    """

    body: NDArray[np.int64]
    center: FloatArray
    semi_axes: FloatArray
    law: FloatArray

    def new_state(self) -> FloatArray:
        """No stick deflection yet: (n, 2) [m], world x and y."""
        return np.zeros((len(self.body), 2))

    def lowest_points(self, xpos: FloatArray, xmat: FloatArray) -> FloatArray:
        """Height of each shape's lowest point above the ground, shape (n,) [m].

        Args:
            xpos, xmat: MuJoCo's body positions (bodies, 3) and rotations (bodies, 9).
        """
        vertical = xmat[self.body, 6:9]
        reach = np.linalg.norm(self.semi_axes * vertical, axis=1)
        heights: FloatArray = (
            xpos[self.body, 2] + np.einsum("ij,ij->i", vertical, self.center) - reach
        )
        return heights


@njit(cache=True, nogil=True)
def normal_force(stiffness: float, damping: float, depth: float, rate: float) -> float:
    """F_n = k d (1 + c d') [N] for depth d [m] and its rate d' [m/s]; 0 without contact."""
    if depth <= 0.0:
        return 0.0
    return max(0.0, stiffness * depth * (1.0 + damping * rate))


@njit(cache=True, nogil=True)
def friction_force(
    stiffness: float,
    relaxation: float,
    limit: float,
    slip_x: float,
    slip_y: float,
    step: float,
    stick: FloatArray,
) -> tuple[float, float]:
    """Friction [N] along world x and y for a slip velocity [m/s]; updates the stick deflection.

    Args:
        stiffness: tangential stiffness k_t [N/m].
        relaxation: tau [s], damping over stiffness.
        limit: mu F_n [N].
        step: time step [s].
        stick: elastic deflection, shape (2,) [m]; changed in place.
    """
    stick[0] += slip_x * step
    stick[1] += slip_y * step
    x = stiffness * (stick[0] + relaxation * slip_x)
    y = stiffness * (stick[1] + relaxation * slip_y)
    trial = (x * x + y * y) ** 0.5
    if trial > limit:  # slips: the deflection follows so that the force stays on the limit
        scale = limit / trial
        x *= scale
        y *= scale
        stick[0] = x / stiffness - relaxation * slip_x
        stick[1] = y / stiffness - relaxation * slip_y
        length = (stick[0] ** 2 + stick[1] ** 2) ** 0.5
        if length * stiffness > limit:
            stick *= limit / (length * stiffness)
    return -x, -y


@njit(cache=True, nogil=True)
def ground_contact(
    helmet: int,
    body: NDArray[np.int64],
    center: FloatArray,
    semi_axes: FloatArray,
    law: FloatArray,
    stick: FloatArray,
    step: float,
    xpos: FloatArray,
    xmat: FloatArray,
    cvel: FloatArray,
    origin: FloatArray,
    applied: FloatArray,
    wrench: FloatArray,
) -> None:
    """Add the ground's forces on all shapes.

    Args:
        helmet: MuJoCo's index of the helmet body.
        body, center, semi_axes, law, stick: see :class:`Shapes`.
        step: time step [s].
        xpos, xmat, cvel: MuJoCo's body frames and velocities.
        origin: point [m] to which ``cvel`` refers (centre of mass of the whole tree).
        applied: forces on the bodies and their moments about that point, (bodies, 6); added to.
        wrench: force [N] and moment about the world origin [N m], shape (2, 6): row 0 for the
            helmet, row 1 for the sum of all others; written.
    """
    wrench[:] = 0.0
    for i in range(len(body)):
        b = body[i]
        m = xmat[b]
        ax, ay, az = semi_axes[i]
        cx, cy, cz = center[i]
        height = xpos[b, 2] + m[6] * cx + m[7] * cy + m[8] * cz
        if height >= max(ax, ay, az):  # out of reach in any orientation
            stick[i, 0] = stick[i, 1] = 0.0
            continue
        # World down in body axes, scaled to the support point of the ellipsoid.
        dx, dy, dz = -m[6], -m[7], -m[8]
        scale = 1.0 / ((ax * dx) ** 2 + (ay * dy) ** 2 + (az * dz) ** 2) ** 0.5
        lx = cx + ax * ax * dx * scale
        ly = cy + ay * ay * dy * scale
        lz = cz + az * az * dz * scale
        pz = xpos[b, 2] + m[6] * lx + m[7] * ly + m[8] * lz
        if pz >= 0.0:
            stick[i] = 0.0
            continue
        px = xpos[b, 0] + m[0] * lx + m[1] * ly + m[2] * lz
        py = xpos[b, 1] + m[3] * lx + m[4] * ly + m[5] * lz
        wx, wy, wz = cvel[b, 0], cvel[b, 1], cvel[b, 2]
        rx, ry, rz = px - origin[0], py - origin[1], pz - origin[2]
        vx = cvel[b, 3] + wy * rz - wz * ry
        vy = cvel[b, 4] + wz * rx - wx * rz
        vz = cvel[b, 5] + wx * ry - wy * rx
        fz = normal_force(law[i, STIFFNESS], law[i, DAMPING], -pz, -vz)
        fx, fy = friction_force(
            TANGENTIAL_SHARE * law[i, STIFFNESS], RELAXATION, law[i, FRICTION] * fz, vx, vy, step,
            stick[i],
        )  # fmt: skip
        add_force(applied[b], origin, px, py, pz, fx, fy, fz)
        add_force(wrench[0 if b == helmet else 1], WORLD_ORIGIN, px, py, pz, fx, fy, fz)
