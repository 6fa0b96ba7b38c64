"""How bodies move, and what acts on them: between MuJoCo's arrays and every force of the model.

Forces act on bodies at points; along MuJoCo's kinematic tree they become generalised forces, the
same as MuJoCo does with ``xfrc_applied``, without a dense Jacobian per body.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.force.vector import Mat, Vec, add, cross, matrix, row, sub, turned

#: Rows of :attr:`Loads.surface`: what the surface does to the helmet, and to all other bodies.
HELMET, BODY = 0, 1
#: Columns there: force, its moment about the world origin, and the part of the force that is
#: friction; three each.
FORCE, MOMENT, FRICTION = 0, 3, 6
COLUMNS = 9


class Motion(NamedTuple):
    """Views of MuJoCo's arrays: where everything is and how fast it moves.

    Attributes:
        qpos, qvel: generalised positions and velocities.
        position: of the body frames, (bodies, 3) [m].
        rotation: body to world, rows of (bodies, 9).
        velocity: ``cvel``: angular and linear velocity of each body at ``origin``, (bodies, 6).
        origin: centre of mass of the tree, (3,) [m].
        center: mass centres of the bodies, (bodies, 3) [m].
        axes: ``cdof``: axes of motion of each degree of freedom at ``origin``, (nv, 6).
        ahead: by how long velocities are ahead of those that led from the last positions to these
            [s]; a path that is summed up from them is so much too long.
    """

    qpos: FloatArray
    qvel: FloatArray
    position: FloatArray
    rotation: FloatArray
    velocity: FloatArray
    origin: FloatArray
    center: FloatArray
    axes: FloatArray
    ahead: float = 0.0


class Rigid(NamedTuple):
    """Motion of one body as numbers, which compiled code passes in registers.

    Attributes:
        position: of its frame [m].
        rotation: body to world.
        spin: angular velocity [rad/s].
        speed: of the body's point at ``origin`` [m/s].
        origin: ``Motion.origin`` [m].
    """

    position: Vec
    rotation: Mat
    spin: Vec
    speed: Vec
    origin: Vec


class Loads(NamedTuple):
    """What the forces of one step add up to.

    Attributes:
        generalised: (nv,).
        wrenches: force and moment about ``Motion.origin`` on each body, (bodies, 6).
        coupling: force of the helmet on the head and its moment about the helmet frame's
            origin, head axes, (6,) [N], [N m].
        spring: the coupling spring's force on the shell, axes of its slides, (3,) [N].
        surface: see ``HELMET``, ``FORCE``; (2, 9) [N], [N m].
    """

    generalised: FloatArray
    wrenches: FloatArray
    coupling: FloatArray
    spring: FloatArray
    surface: FloatArray


class Chains(NamedTuple):
    """The kinematic tree.

    Attributes:
        last: the last degree of freedom that moves each body, -1: none; (bodies,).
        parent: the degree of freedom that each one hangs on, -1: none; (nv,).
    """

    last: NDArray[np.int64]
    parent: NDArray[np.int64]


def motion_of(data: mujoco.MjData, ahead: float = 0.0) -> Motion:
    """Views of a simulation's arrays; the tree is that of body 1; ``ahead``: see ``Motion``."""
    return Motion(
        data.qpos, data.qvel, data.xpos, data.xmat, data.cvel, data.subtree_com[1], data.xipos,
        data.cdof, ahead,
    )  # fmt: skip


def no_loads(model: mujoco.MjModel, generalised: FloatArray | None = None) -> Loads:
    """Loads of a model, all zero; ``generalised`` may be a view of ``qfrc_applied``."""
    return Loads(
        np.zeros(model.nv) if generalised is None else generalised,
        np.zeros((model.nbody, 6)), np.zeros(6), np.zeros(3), np.zeros((2, COLUMNS)),
    )  # fmt: skip


def chains(model: mujoco.MjModel) -> Chains:
    """The chains of degrees of freedom of a model."""
    last = np.full(model.nbody, -1, dtype=np.int64)
    first, count, parents = model.body_dofadr, model.body_dofnum, model.body_parentid
    for body in range(1, model.nbody):  # parents come first
        moves = count[body] > 0
        last[body] = first[body] + count[body] - 1 if moves else last[parents[body]]
    return Chains(last, model.dof_parentid.astype(np.int64))


def chain_of(chains: Chains, body: int) -> NDArray[np.int64]:
    """The degrees of freedom that move a body, in the order of the tree."""
    found, dof = [], int(chains.last[body])
    while dof >= 0:
        found.append(dof)
        dof = int(chains.parent[dof])
    return np.array(found[::-1], dtype=np.int64)


@compiled
def clear(loads: Loads) -> None:
    """Set all loads to zero."""
    loads.generalised[:] = 0.0
    loads.wrenches[:] = 0.0
    loads.coupling[:] = 0.0
    loads.spring[:] = 0.0
    loads.surface[:] = 0.0


@inlined
def rigid(motion: Motion, body: int) -> Rigid:
    """The motion of one body."""
    v, o = motion.velocity, motion.origin
    return Rigid(
        row(motion.position, body),
        matrix(motion.rotation, body),
        (v[body, 0], v[body, 1], v[body, 2]),
        (v[body, 3], v[body, 4], v[body, 5]),
        (o[0], o[1], o[2]),
    )


@inlined
def world_point(body: Rigid, point: Vec) -> Vec:
    """World coordinates [m] of a point in a body's frame [m]."""
    return add(body.position, turned(body.rotation, point))


@inlined
def velocity_at(body: Rigid, point: Vec) -> Vec:
    """Velocity [m/s] of the point of a body that is at a world point [m]."""
    return add(body.speed, cross(body.spin, sub(point, body.origin)))


@compiled
def push(motion: Motion, loads: Loads, body: int, point: Vec, force: Vec) -> None:
    """Add a force [N] at a world point [m] to the load of a body."""
    o = motion.origin
    load(loads, body, force, cross(sub(point, (o[0], o[1], o[2])), force))


@compiled
def load(loads: Loads, body: int, force: Vec, moment: Vec) -> None:
    """Add a force [N] and its moment [N m] about ``Motion.origin`` to the load of a body."""
    for k in range(3):
        loads.wrenches[body, k] += force[k]
        loads.wrenches[body, 3 + k] += moment[k]


@compiled
def count_surface(loads: Loads, receiver: int, force: Vec, moment: Vec, friction: Vec) -> None:
    """Add a force of the surface to its sum on helmet or body.

    Args:
        receiver: ``HELMET`` or ``BODY``.
        force: [N]; ``friction``: the part of it along the surface.
        moment: about the world origin [N m].
    """
    for k in range(3):
        loads.surface[receiver, FORCE + k] += force[k]
        loads.surface[receiver, MOMENT + k] += moment[k]
        loads.surface[receiver, FRICTION + k] += friction[k]


@compiled
def add_generalised(motion: Motion, loads: Loads, chains: Chains) -> None:
    """Add what the wrenches do along each degree of freedom to the generalised forces."""
    wrenches, axes, generalised = loads.wrenches, motion.axes, loads.generalised
    last, parent = chains.last, chains.parent
    for body in range(len(wrenches)):
        fx, fy, fz, mx, my, mz = wrenches[body]
        if fx == 0.0 and fy == 0.0 and fz == 0.0 and mx == 0.0 and my == 0.0 and mz == 0.0:
            continue
        dof = last[body]
        while dof >= 0:
            c = axes[dof]
            generalised[dof] += (
                c[0] * mx + c[1] * my + c[2] * mz + c[3] * fx + c[4] * fy + c[5] * fz
            )
            dof = parent[dof]


@compiled
def about_mass_centers(motion: Motion, loads: Loads, moved: FloatArray) -> None:
    """The wrenches as ``xfrc_applied``, which MuJoCo's force sensors read.

    Args:
        moved: the wrenches about the bodies' mass centres, (bodies, 6); written.
    """
    o, wrenches, center = motion.origin, loads.wrenches, motion.center
    for body in range(len(wrenches)):
        fx, fy, fz, mx, my, mz = wrenches[body]
        c = center[body]
        ax, ay, az = cross((o[0] - c[0], o[1] - c[1], o[2] - c[2]), (fx, fy, fz))
        moved[body, 0] = fx
        moved[body, 1] = fy
        moved[body, 2] = fz
        moved[body, 3] = mx + ax
        moved[body, 4] = my + ay
        moved[body, 5] = mz + az
