"""Head and helmet as the fine rate sees them, and the memory of the large step."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.force.bodies import Chains, Loads, chain_of, no_loads
from helmet_sim_ros.model.force.vector import Mat, Vec
from helmet_sim_ros.model.layout import Layout

SHORTEST, LONGEST = 5e-5, 4e-4  # s, bounds of the large step
#: Error of the head's speed that a large step may have [m/s], of its turning at this arm [m].
TOLERANCE, ARM = 5e-4, 0.1
GROWTH = 2.0  # from one large step to the next, at most


class Solid(NamedTuple):
    """A rigid body: mass [kg], centre in its frame [m], inertia about it [kg m^2] and inverse."""

    mass: float
    center: Vec
    inertia: Mat
    inverse: Mat


class Gauges(NamedTuple):
    """Where each sensor stands; ``neck_force`` is negative without a neck."""

    head_position: int
    head_orientation: int
    helmet_orientation: int
    head_velocity: int
    head_angular_velocity: int
    head_specific_force: int
    head_angular_acceleration: int
    neck_force: int
    neck_torque: int


class Carried(NamedTuple):
    """Head and helmet as the fine rate sees them.

    Attributes:
        head, helmet: bodies; of a spring helmet the latter is the struck shell.
        rest: what of the helmet is fixed to the head, and touches shoulders and chest.
        carrying: bodies of the helmet, which the body at the large step does not carry.
        chain: degrees of freedom that move the head.
        slide, slide_velocity: first of the six joint axes from head to helmet in qpos and qvel.
        spring, spring_velocity: first of the shell's three slides; negative: a foam helmet.
        skull: the head with what is fixed to it, head frame.
        inner: the helmet (spring: all but the struck shell), helmet frame.
        shell: of a spring helmet, which translates against ``inner``.
        gauges: sensors; ``neck_site``: where the neck's load is measured, head frame [m].
        gravity: [m/s^2].
    """

    head: int
    helmet: int
    rest: int
    carrying: NDArray[np.int64]
    chain: NDArray[np.int64]
    slide: int
    slide_velocity: int
    spring: int
    spring_velocity: int
    skull: Solid
    inner: Solid
    shell: Solid
    gauges: Gauges
    neck_site: Vec
    gravity: Vec


class Scratch(NamedTuple):
    """Six numbers each, angular then linear; working memory of the loop, which makes no arrays."""

    twist: FloatArray
    drift: FloatArray
    turning: FloatArray
    bias: FloatArray
    back: FloatArray
    rate: FloatArray
    wrench: FloatArray
    impulse: FloatArray
    impulses: FloatArray
    average: FloatArray


class Carrier(NamedTuple):
    """Working memory and state of the large step.

    Attributes:
        inertia, axes_rate, quaternion: views of MuJoCo's cinert, cdof_dot and xquat.
        position, velocity: at the start of the large step, (nq,), (nv,).
        mean: velocity over a part of the step, (nv,).
        latest: state: acceleration at the end of the step before, (nv,).
        jacobian: B, (6, nv): angular, then linear, head axes.
        response: M^-1 B^T, transposed, (6, nv); ``apparent``: A, (6, 6).
        before: state: A of the large step before.
        steps: state: fine steps done, of the next large step, and done at the next look at the
            kinetic energy; (3,).
        drift: state: of the head in the large step before (6), and that step's length [s]; (7,).
        slope: state: rate of change of the drift, (6,).
        held: state: what pushes the head and what is fixed to it from outside in this large step,
            world axes, moment about the head's origin, then force, (6,); ``holding``: state: its
            rate of change, (6,).
        rates: state: accelerations of the fine step before: of the head (6, head axes), of the
            helmet's middle and the shell (3 each, world axes), of the helmet's turning (3); (15,).
        tolerance: see ``TOLERANCE``; ``longest``: large step [s].
    """

    inertia: FloatArray
    axes_rate: FloatArray
    quaternion: FloatArray
    position: FloatArray
    velocity: FloatArray
    mean: FloatArray
    latest: FloatArray
    jacobian: FloatArray
    response: FloatArray
    apparent: FloatArray
    before: FloatArray
    steps: NDArray[np.int64]
    drift: FloatArray
    slope: FloatArray
    held: FloatArray
    holding: FloatArray
    rates: FloatArray
    tolerance: float
    longest: float
    scratch: Scratch


class Rates(NamedTuple):
    """What stepping at several rates needs beside the simulation.

    Attributes:
        carried: head and helmet.
        carrier: of the large step.
        loads: of the fine forces.
    """

    carried: Carried
    carrier: Carrier
    loads: Loads


def _solid(model: mujoco.MjModel, bodies: list[int]) -> Solid:
    """Bodies that are fixed to the first of them, frames aligned, as one."""
    masses = [float(model.body_mass[b]) for b in bodies]
    turns = [np.zeros(9) for _ in bodies]
    for turn, b in zip(turns, bodies, strict=True):
        mujoco.mju_quat2Mat(turn, model.body_iquat[b])
    mass = sum(masses)
    center = sum(m * model.body_ipos[b] for m, b in zip(masses, bodies, strict=True)) / mass
    inertia = np.zeros((3, 3))
    for m, b, turn in zip(masses, bodies, turns, strict=True):
        axes, off = turn.reshape(3, 3), model.body_ipos[b] - center
        inertia += axes @ np.diag(model.body_inertia[b]) @ axes.T
        inertia += m * (off @ off * np.eye(3) - np.outer(off, off))
    flat = [tuple(float(x) for x in a.ravel()) for a in (center, inertia, np.linalg.inv(inertia))]
    return Solid(mass, *flat)  # type: ignore[arg-type]


def rates(model: mujoco.MjModel, data: mujoco.MjData, layout: Layout, chains: Chains) -> Rates:
    """Of a simulation that starts."""
    chain = chain_of(chains, layout.head)
    return Rates(_carried(model, layout, chain), _carrier(model, data), no_loads(model))


def _carried(model: mujoco.MjModel, layout: Layout, chain: NDArray[np.int64]) -> Carried:
    """Head and helmet of a model; ``chain``: the degrees of freedom that move the head."""
    sprung = layout.slide >= 0
    inner = int(model.body("helmet_inside").id) if sprung else layout.helmet
    rest = int(model.body("helmet_rest").id)
    parts = [inner, layout.helmet] if sprung else [inner]
    shell_only, inside = _solid(model, [layout.helmet]), _solid(model, [inner])
    if sprung:  # the shell turns with what it slides on
        whole = np.reshape(inside.inertia, (3, 3)) + np.reshape(shell_only.inertia, (3, 3))
        inverse = np.linalg.inv(whole)
        inside = Solid(inside.mass, inside.center, tuple(whole.ravel()), tuple(inverse.ravel()))
    names = [name for name in Gauges._fields if name in layout.sensors]
    places = [layout.sensors[name][0] for name in names] + [-1] * (9 - len(names))
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, "neck_load")
    sx, sy, sz = (float(x) for x in (model.site_pos[site] if site >= 0 else np.zeros(3)))
    x, y, z = (float(g) for g in model.opt.gravity)
    return Carried(
        layout.head, layout.helmet, rest, np.array(parts, dtype=np.int64), chain, layout.fit,
        layout.fit_velocity, layout.slide, layout.slide_velocity,
        _solid(model, [layout.head, rest]), inside, shell_only, Gauges(*places),
        (sx, sy, sz), (x, y, z),
    )  # fmt: skip


def _carrier(model: mujoco.MjModel, data: mujoco.MjData) -> Carrier:
    """Working memory for a simulation that starts."""
    nv = model.nv
    return Carrier(
        data.cinert, data.cdof_dot, data.xquat, np.zeros(model.nq), np.zeros(nv), np.zeros(nv),
        np.zeros(nv), np.zeros((6, nv)), np.zeros((6, nv)), np.zeros((6, 6)),
        np.zeros((6, 6)), np.array([0, 1, 0], dtype=np.int64), np.zeros(7), np.zeros(6),
        np.zeros(6), np.zeros(6), np.zeros(15),
        TOLERANCE, LONGEST, Scratch(*np.zeros((10, 6))),
    )  # fmt: skip
