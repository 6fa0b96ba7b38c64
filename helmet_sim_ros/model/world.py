"""The MuJoCo model of one impact: ground, head, helmet and body."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.anvil_drops import PATCH, unevenness
from helmet_sim_ros.model.fall.start import start_fall
from helmet_sim_ros.model.fall.values import FallValues
from helmet_sim_ros.model.force.bodies import Chains, chains
from helmet_sim_ros.model.force.columns import Columns, columns, no_columns
from helmet_sim_ros.model.force.contact import Contact
from helmet_sim_ros.model.force.fit import ELASTIC, LINEAR_FROM, STIFFEST
from helmet_sim_ros.model.force.friction import RELAXATION
from helmet_sim_ros.model.force.neck import CervicalSpine
from helmet_sim_ros.model.force.self_contact import SelfContact
from helmet_sim_ros.model.force.spring import deepest, law_table, unloading_exponent
from helmet_sim_ros.model.force.stops import Stops, joint_stops
from helmet_sim_ros.model.headform import Headform
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.layout import Layout
from helmet_sim_ros.model.numbers import Numbers
from helmet_sim_ros.model.placement import place, resume
from helmet_sim_ros.model.rest import AtRest
from helmet_sim_ros.model.rider import tissue
from helmet_sim_ros.model.rider.anthropometry import Segment, anthropometry
from helmet_sim_ros.model.rider.body import add_body
from helmet_sim_ros.model.rider.neck import cervical_spine, set_rest
from helmet_sim_ros.model.rider.posing import Posing
from helmet_sim_ros.model.rider.properties import Rider
from helmet_sim_ros.model.rider.self_contact import self_contact
from helmet_sim_ros.model.setup import ImpactSetup, Rig
from helmet_sim_ros.model.state import read_state
from helmet_sim_ros.model.surface.compiled import Surface
from helmet_sim_ros.model.surface.config import SurfaceConfig
from helmet_sim_ros.model.surface.drawing import add_geoms

MAX_STEP = 5e-5  # s, largest integration step: peaks within 1 % (test_model_impact)
MIN_STEP = 2e-6  # s; a shell so light or stiff that it needs less may diverge, and says so
STABLE_SHARE = 0.9
BODY_MARGIN = 1.3  # energy the body feeds into the spring, over that of head and helmet
OF_THE_SURFACE = -1.0  # friction of the shell: whatever it strikes has its own
POINT_INERTIA = 1e-9  # kg m^2, of a mass that only translates; MuJoCo takes no zero
HELD = 1e4  # inertia of a head that a monorail does not let turn, over its own
ARENA = 1 << 16  # bytes of working memory per simulation; 2 kB of it are used at most
HELMET_COLOR = (0.20, 0.36, 0.62, 0.9)
GROUND_COLOR = (0.55, 0.55, 0.55, 1.0)


class Plan(NamedTuple):
    """What the model of a setup is made from; setups of the same plan share its parts.

    Attributes:
        rig, rider, helmet, surface, posing: of the setup.
        neck_flexion_deg: at rest [deg].
        gravity: downwards [m/s^2].
        step: of the integration [s].
        form: what takes the place of the rider's head; None: nothing does.
    """

    rig: Rig
    rider: Rider
    helmet: Helmet
    neck_flexion_deg: float
    gravity: float
    step: float
    surface: SurfaceConfig
    form: Headform | None
    posing: Posing | None


@dataclass(frozen=True)
class Kind:
    """What decides on the structure of a model; ``plan``: one of this kind."""

    rig: Rig
    coupling: str
    surface: SurfaceConfig
    plan: Plan = field(compare=False)


@dataclass(frozen=True)
class Structure:
    """What models of one :class:`Kind` share.

    Attributes:
        model: of one of them, compiled; not to be changed.
        chains: the kinematic tree.
        layout: where named quantities stand in the model's vectors.
        spare: data that nobody uses now.
    """

    model: mujoco.MjModel
    chains: Chains
    layout: Layout
    spare: list[mujoco.MjData]

    def data_of(self, model: mujoco.MjModel) -> mujoco.MjData:
        """Data of a model of this kind, as new."""
        if not self.spare:
            return mujoco.MjData(model)
        data = self.spare.pop()
        mujoco.mj_resetData(model, data)
        return data


@dataclass(frozen=True)
class Parts:
    """What setups of one :class:`Plan` share; nothing here may be changed.

    Attributes:
        plan: what they share it by.
        structure: of the model.
        model: compiled model.
        contact: what may touch the surface by a stiff contact, as long as nothing has moved.
        columns: the foam helmet's columns, none for a spring helmet.
        stops: of the body's hinges.
        neck: of the rider, as long as it has not yielded.
        own: contact of the rider with himself.
        damped_diagonal: where the diagonal of M stands in MuJoCo's data, and what the damping of
            the joints adds to it in an implicit step, (nv,) each.
    """

    plan: Plan
    structure: Structure
    model: mujoco.MjModel
    contact: Contact
    columns: Columns
    stops: Stops
    neck: CervicalSpine
    own: SelfContact
    damped_diagonal: tuple[NDArray[np.int64], FloatArray]


@dataclass(frozen=True)
class World:
    """The model of one impact with its state at the first touch.

    Attributes:
        parts: shared with other impacts.
        data: holds the initial state.
        surface: what is struck, with the friction of this setup.
        contact: ``parts.contact`` with a state of its own.
        substeps: integration steps per sample.
        notes: what a user should know about this setup, in words.
    """

    parts: Parts
    data: mujoco.MjData
    surface: Surface
    contact: Contact
    substeps: int
    notes: tuple[str, ...]


def build(setup: ImpactSetup | FallValues, helmet: Helmet, dented: bool = False) -> World:
    """Compile the model of a setup and place it: at the first touch of the surface, or where a
    fall starts.

    Args:
        setup: of the impact or fall.
        helmet: as it is simulated.
        dented: whether earlier blows have crushed its liner.

    Raises:
        SetupError: a rider who starts inside something, or cannot be placed on the surface.
    """
    steps = substeps(setup, helmet)
    plan = Plan(
        setup.rig, setup.rider, helmet, setup.resolved_neck_flexion_deg, setup.gravity,
        setup.time_step / steps, setup.surface_config, setup.headform, setup.posing,
    )  # fmt: skip
    parts = _parts(plan)
    data, notes = parts.structure.data_of(parts.model), ()  # type: tuple[mujoco.MjData, tuple[str, ...]]
    state = setup.state if isinstance(setup, ImpactSetup) else None
    time = 0.0 if state is None else read_state(state).time
    surface = setup.surface_config.moving(setup.friction, time)
    contact = parts.contact.fresh(len(surface.kind))
    if isinstance(setup, FallValues):
        start_fall(parts.model, data, contact, surface, setup)
    elif state is not None:
        notes = resume(
            parts.model, data, parts.structure.layout, surface, setup, None if dented else helmet
        )
    else:
        notes = place(parts.model, data, contact, surface, setup, helmet)
        notes += _not_flat(setup, helmet)
    return World(parts, data, surface, contact, steps, notes)


def _not_flat(setup: ImpactSetup, helmet: Helmet) -> tuple[str, ...]:
    """What a helmet does not know of a surface that is not flat."""
    spring = helmet.coupling == "spring"
    bends = helmet.shell.material.bending_stiffness > 0.0
    gap = unevenness(setup.surface_config)
    if gap == 0.0 or (bends and not spring):
        return ()
    falls = f"{setup.surface} falls {gap * 1e3:.0f} mm away {PATCH * 1e3:.0f} mm beside the target"
    if spring and helmet.spring.identified:
        return (
            f"{falls}: the coupling spring was identified there, from drops of its foam at this "
            "pose; where the helmet rolls to another place it is the same",
        )
    if spring:
        return (
            f"the coupling spring stands for flat ground, and {falls}: its peaks are those of a "
            "flat blow; helmet.coupling = foam has the local crush",
        )
    return (
        f"{falls}, and a liner without a shell lets each column alone: too soft a blow; "
        "helmet.shell.material.modulus and .thickness let the shell spread it",
    )


@lru_cache(maxsize=8)
def _parts(plan: Plan) -> Parts:
    rider, helmet, body = plan.rider, plan.helmet, anthropometry(plan.rider)
    structure = _structure(Kind(plan.rig, helmet.coupling, plan.surface, plan))
    model = numbered(structure, plan)
    if plan.rig == "rider":
        set_rest(model, math.radians(plan.neck_flexion_deg))
    if plan.posing is not None:
        plan.posing.set(model)
    data, foam = structure.data_of(model), helmet.coupling == "foam"
    rest = AtRest(model, data)
    parts = Parts(
        plan, structure, model, _ellipsoids(model, helmet, body.scale, rest),
        columns(helmet) if foam else no_columns(),
        joint_stops(model, rest), cervical_spine(model, rider.neck),
        self_contact(model, helmet, body, rest), _damped_diagonal(model),
    )  # fmt: skip
    structure.spare.append(data)
    return parts


@lru_cache(maxsize=8)
def _structure(kind: Kind) -> Structure:
    model = specified(kind.plan).compile()
    return Structure(model, chains(model), Layout(model), [])


def numbered(structure: Structure, plan: Plan) -> mujoco.MjModel:
    """The model of a plan: bit for bit what :func:`specified` compiles to, but for ``stat``, by
    which viewers choose their scale: it stays that of the first model of the kind."""
    model = copy.copy(structure.model)
    model.opt.timestep, model.opt.gravity = plan.step, [0.0, 0.0, -plan.gravity]
    _add_bodies(Numbers(model), plan)  # told as a specification is
    data = structure.data_of(model)
    mujoco.mj_setConst(model, data)
    structure.spare.append(data)
    return model


def specified(plan: Plan) -> mujoco.MjSpec:
    """The model of a plan as an editable specification."""
    spec = _empty_world(plan.gravity, plan.step)
    add_geoms(spec, plan.surface, GROUND_COLOR)
    _add_bodies(spec.worldbody, plan)
    _add_sensors(spec, plan.rig, "head" if plan.helmet.coupling == "none" else "helmet")
    return spec


def _add_bodies(world: mujoco.MjsBody, plan: Plan) -> None:
    """Rider or head alone, and helmet."""
    if plan.rig == "rider":
        head = add_body(world, plan.rider, anthropometry(plan.rider))
    else:
        head = world.add_body(name="head")
        head.add_freejoint(name="root")
    segment = _head(plan.rider, plan.form)
    held = HELD if plan.rig == "monorail" else 1.0
    _rigid(head, segment.mass, [0.0, 0.0, 0.0], [held * i for i in segment.inertia])
    _add_helmet(head, plan.helmet)


def _head(rider: Rider, form: Headform | None) -> Segment:
    """The rider's head, or what takes its place: at the same depth below the crown."""
    own = anthropometry(rider).segments["head"]
    if form is None:
        return own
    return replace(own, mass=form.mass.value, inertia=form.inertia.value)


def _damped_diagonal(model: mujoco.MjModel) -> tuple[NDArray[np.int64], FloatArray]:
    diagonal = model.M_rowadr + model.M_rownnz - 1
    return diagonal.astype(np.int64), model.opt.timestep * model.dof_damping


def substeps(setup: ImpactSetup | FallValues, helmet: Helmet) -> int:
    """Integration steps per sample, so that the explicit forces stay stable.

    The stiffest modes are those of the two light masses m on either side of the spring, whose
    unloading path has the slope C F: the struck shell on its contact (unloading stiffness k,
    damping c F at force F), and the liner's inside on the padding (unloading stiffness F / w,
    damping c E A at most), or sheared across it. Of a foam helmet it is both masses on the padding.
    An explicit step must stay below 2/w (sqrt(1 + z^2) - z), w^2 = (k + C F) / m,
    z = c F / (2 m w). F is bounded by the energy of head and helmet at the impact speed, with a
    margin for what the body adds.
    """
    step, pad, shell = MAX_STEP, helmet.padding, helmet.shell
    own = _head(setup.rider, setup.headform).mass
    if helmet.coupling == "none":
        stiffness = shell.contact_stiffness / shell.contact_returned
        force = math.sqrt(shell.contact_stiffness * own) * setup.closing_speed
        step = min(step, _longest(own, stiffness, shell.contact_damping * force))
        return math.ceil(setup.time_step / max(step, MIN_STEP) - 1e-9)
    inside = np.sort(np.array(shell.semi_axes) - helmet.liner.thickness)
    area = math.pi * inside[1] * inside[2]  # the largest that is pressed at once
    sheared = pad.shear_modulus / (1.0 - LINEAR_FROM)  # with its pores closed
    padding = area * max(pad.modulus, sheared) / pad.thickness
    rubbing = area * pad.modulus * pad.damping
    if helmet.coupling == "foam":
        mass = shell.effective_mass + helmet.liner.effective_mass
        step = min(step, _longest(mass, max(padding, area * STIFFEST), rubbing))
    else:
        loss = helmet.spring.energy_loss
        energy = 0.5 * BODY_MARGIN * (own + helmet.mass) * setup.closing_speed**2
        for scale, exponent in law_table(helmet.spring):
            depth, force = deepest(scale, exponent, energy)
            spring = unloading_exponent(exponent, depth, loss) * force
            contact = shell.contact_stiffness / shell.contact_returned
            for mass, other, rubbed in (
                (shell.effective_mass, contact, shell.contact_damping * force),
                (helmet.liner.effective_mass, max(padding, force / ELASTIC), rubbing),
            ):
                step = min(step, _longest(mass, spring + other, rubbed))
    return math.ceil(setup.time_step / max(step, MIN_STEP) - 1e-9)


def _longest(mass: float, stiffness: float, damping: float) -> float:
    """The longest stable explicit step [s] of a damped mass on a spring, with a margin."""
    frequency = math.sqrt(stiffness / mass)
    share = 0.5 * damping / (mass * frequency)
    return STABLE_SHARE * 2.0 / frequency * (math.hypot(1.0, share) - share)


def _empty_world(gravity: float, step: float) -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    spec.modelname = "impact"
    spec.compiler.degree = False
    option = spec.option
    option.timestep = step
    option.gravity = [0.0, 0.0, -gravity]
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    # Implicit in the joints' damping, the only force of the model's own that needs it.
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    # A diverged state must be seen, not silently reset.
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    # Ground and joint stops act through model/force/contact.py and model/force/stops.py.
    option.disableflags |= int(
        mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    )
    spec.memory = ARENA  # no contact, no constraint
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1920, 1080
    return spec


def _add_helmet(head: mujoco.MjsBody, helmet: Helmet) -> None:
    """The helmet on the head, with six degrees of freedom.

    A rigid shell of the whole mass would be stopped at once by the ground and then struck by the
    head: only a part of a real helmet is. So what lies between head and ground turns as the whole
    helmet, but carries in translation the mass of its struck part only; the rest is carried by the
    head. Of a spring helmet the struck shell moves on three slides against the liner's inside.
    """
    if helmet.coupling == "none":
        return
    center = list(helmet.shell.center if helmet.mass_center is None else helmet.mass_center)
    spring = helmet.coupling == "spring"
    struck, inside = helmet.shell.effective_mass, helmet.liner.effective_mass
    carried = head.add_body(name="helmet_rest")
    _rigid(carried, helmet.mass - struck - inside, center, [POINT_INERTIA] * 3)
    fitted = head.add_body(name="helmet_inside" if spring else "helmet")
    _slides(fitted, "fit")
    fitted.add_joint(name="fit_turn", type=mujoco.mjtJoint.mjJNT_BALL)
    shell = fitted
    if spring:
        _rigid(fitted, inside, center, [i - POINT_INERTIA for i in helmet.inertia])
        shell = fitted.add_body(name="helmet")
        _slides(shell, "coupling")
        _rigid(shell, struck, center, [POINT_INERTIA] * 3)
    else:
        _rigid(fitted, struck + inside, center, list(helmet.inertia))
    shell.add_geom(
        name="shell", type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, size=list(helmet.shell.semi_axes),
        pos=list(helmet.shell.center), mass=0.0, rgba=list(HELMET_COLOR),
    )  # fmt: skip


def _slides(body: mujoco.MjsBody, name: str) -> None:
    for letter, axis in (("x", (1, 0, 0)), ("y", (0, 1, 0)), ("z", (0, 0, 1))):
        body.add_joint(name=f"{name}_{letter}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=list(axis))


def _rigid(body: mujoco.MjsBody, mass: float, at: list[float], inertia: list[float]) -> None:
    body.mass, body.ipos, body.inertia = mass, at, inertia
    body.explicitinertial = True


def _add_sensors(spec: mujoco.MjSpec, rig: str, helmet: str) -> None:
    """Motion of the head frame and of the body ``helmet``, and what the neck transmits (MuJoCo:
    parent on child)."""
    kind, frame, site = mujoco.mjtSensor, mujoco.mjtObj.mjOBJ_XBODY, mujoco.mjtObj.mjOBJ_SITE
    sensors = [
        ("head_position", kind.mjSENS_FRAMEPOS, frame, "head"),
        ("head_orientation", kind.mjSENS_FRAMEQUAT, frame, "head"),
        ("helmet_orientation", kind.mjSENS_FRAMEQUAT, frame, helmet),
        ("head_velocity", kind.mjSENS_FRAMELINVEL, frame, "head"),
        ("head_angular_velocity", kind.mjSENS_FRAMEANGVEL, frame, "head"),
        ("head_specific_force", kind.mjSENS_FRAMELINACC, frame, "head"),
        ("head_angular_acceleration", kind.mjSENS_FRAMEANGACC, frame, "head"),
    ]
    if rig == "rider":
        sensors += [
            ("neck_force", kind.mjSENS_FORCE, site, "neck_load"),
            ("neck_torque", kind.mjSENS_TORQUE, site, "neck_load"),
        ]
    for name, sensor, objtype, objname in sensors:
        spec.add_sensor(name=name, type=sensor, objtype=objtype, objname=objname)


def _ellipsoids(model: mujoco.MjModel, helmet: Helmet, scale: float, rest: AtRest) -> Contact:
    """The shell of a spring helmet or the bare head, and every geom of the body; a capsule touches
    with the spheres at its ends."""
    shell = int(model.body("head" if helmet.coupling == "none" else "helmet").id)
    geoms = np.flatnonzero((model.geom_bodyid != 0) & (model.geom_bodyid != shell))
    capsule = model.geom_type[geoms] == int(mujoco.mjtGeom.mjGEOM_CAPSULE)
    ends = np.concatenate([[-1.0, 1.0] if both else [0.0] for both in capsule] or [[]])
    geoms, capsule = (np.repeat(array, np.where(capsule, 2, 1)) for array in (geoms, capsule))
    w, x, y, z = model.geom_quat[geoms].T
    axis = np.column_stack(
        [2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z]
    )
    size = model.geom_size[geoms]
    body = model.geom_bodyid[geoms].astype(np.int64)
    center = model.geom_pos[geoms] + (ends * size[:, 1])[:, None] * axis
    semi_axes = np.where(capsule[:, None], size[:, :1], size)
    mass = rest.lightest_masses(body, center)
    regions = {b: tissue.region_of(model.body(b).name, scale) for b in np.unique(body)}
    stiffness, thickness = np.array([regions[b] for b in body]).reshape(-1, 2).T
    same = np.ones(len(body))
    law = np.column_stack([
        stiffness, tissue.DAMPING * same, same, tissue.FRICTION * same, thickness,
        tissue.straight_share(stiffness, mass, tissue.GROUND_STEP), mass, tissue.RELAXATION * same,
    ])  # fmt: skip
    if helmet.coupling != "foam":
        own = helmet.shell
        body = np.concatenate([[shell], body])
        center = np.vstack([own.center, center])
        semi_axes = np.vstack([own.semi_axes, semi_axes])
        mine = (
            own.contact_stiffness, own.contact_damping, own.contact_returned, OF_THE_SURFACE,
            math.inf, 1.0, own.effective_mass, RELAXATION,
        )  # fmt: skip
        law = np.vstack([mine, law])
    state = np.zeros((len(body), 0, 3))
    stiffness, damping, returned, friction, thickness, straight, mass, relaxation = (
        np.ascontiguousarray(column) for column in law.T
    )
    return Contact(
        shell, body, center, semi_axes, semi_axes.max(axis=1, initial=0.0), stiffness, damping,
        returned, friction, thickness, straight, mass, relaxation, state, state[:, :, 0], state,
    )  # fmt: skip
