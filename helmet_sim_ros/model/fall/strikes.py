"""Head strikes of a fall: what helmet or bare head touch, how fast, where, and how bad it is."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.record import CHANNELS, SHELL, FloatArray, ImpactRecord, is_fall
from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.biomech.rotation import matrices
from helmet_sim_ros.errors import PulseError, SetupError
from helmet_sim_ros.extra import need
from helmet_sim_ros.model.compiled import compiled
from helmet_sim_ros.model.fall.setup import Fall, fall_from_names, setup_or_fall
from helmet_sim_ros.model.fall.suffered import suffered
from helmet_sim_ros.model.force.columns import first_touch
from helmet_sim_ros.model.force.neck import CervicalSpine, elastic_length
from helmet_sim_ros.model.force.spring import compressions
from helmet_sim_ros.model.helmet import Spring
from helmet_sim_ros.model.placement import SITES, place_head
from helmet_sim_ros.model.setup import ImpactSetup, setup_from_names
from helmet_sim_ros.model.state import State, read_state
from helmet_sim_ros.model.surface.shapes import nearest
from helmet_sim_ros.model.world import World, build

if TYPE_CHECKING:
    import pandas as pd

#: Contacts that follow each other within this time are one strike: a rolling helmet lifts off for
#: moments, and the pulse of a head ends within 15 ms [s]; a choice.
GAP = 0.010
TAIL = 0.005  # s, that a strike's window goes on after the last touch
LONGEST = 2.0  # s, of a window: that of an ImpactSetup


class Location(NamedTuple):
    """Where the helmet is struck, from the head's centre of gravity.

    Attributes:
        azimuth_deg: 0 front, 90 left, 180 back.
        elevation_deg: 90 is the crown.
        zone: the nearest of front, back, left, right and top.
    """

    azimuth_deg: float
    elevation_deg: float
    zone: str


@dataclass(frozen=True)
class Strike:
    """One contact of helmet or bare head with anything.

    Attributes:
        time: of the first touch since the start of the fall [s].
        duration: until the last touch [s].
        normal_velocity: speed of the head's centre of gravity into what is struck, at first touch
            [m/s]; below 0 where the head rolls onto it while its centre moves away.
        tangential_velocity: along it [m/s].
        body_angle_deg: of the trunk to the struck surface, above 0 head down.
        location: on the helmet.
        struck: what is struck: the scene's name of the shape; ``shape``: its index there.
        point: where, world axes, (3,) [m]; ``normal``: outward there, (3,).
        state: of the rider in the last sample before the touch.
        samples: of its own window, from that one on, at the steps of the fall; their notes tell
            what helmet and neck suffered there beyond what they have.
    """

    time: float
    duration: float
    normal_velocity: float
    tangential_velocity: float
    body_angle_deg: float
    location: Location
    struck: str
    shape: int
    point: FloatArray = field(repr=False)
    normal: FloatArray = field(repr=False)
    state: State = field(repr=False)
    samples: ImpactRecord = field(repr=False)

    @cached_property
    def record(self) -> ImpactRecord:
        """The samples at one step throughout, as criteria need them, with their notes."""
        return replace(self.samples.uniform(), extras=self.samples.extras)

    @cached_property
    def evaluation(self) -> Evaluation:
        """All criteria over the window of the strike, by the default standard."""
        return evaluate(self.record)

    @property
    def peak_acceleration(self) -> float:
        """Of the head's centre of gravity [m/s^2]."""
        return float(np.linalg.norm(self.samples.head_acceleration, axis=1).max())

    @property
    def speed(self) -> float:
        """Of the head's centre of gravity over what is struck [m/s]."""
        return math.hypot(self.normal_velocity, self.tangential_velocity)

    @property
    def angle_deg(self) -> float:
        """Of that speed to the struck surface: 90 straight into it [deg]."""
        return math.degrees(math.atan2(self.normal_velocity, self.tangential_velocity))

    def setup(self) -> ImpactSetup:
        """The strike as an impact of its own: the same rider in the same pose and motion meets the
        same place, with a new helmet that sits as it was put on.

        Raises:
            SetupError: the centre of gravity does not move towards what is struck, so that there is
                no impact.
        """
        if self.normal_velocity <= 0.0:
            raise SetupError.of(
                "impact.normal_velocity", round(self.normal_velocity, 4),
                "must be above 0: here the head rolls onto what it touches",
            )  # fmt: skip
        values = dict(self.samples.setup)
        kept = {k: v for k, v in values.items() if k.startswith(("rider.", "helmet.", "head."))}
        window = float(self.samples.time[-1] - self.samples.time[0])
        step = float(values["sim.time_step"])
        kept |= {
            "sim.time_step": step,
            "sim.duration": min(max(window, 10.0 * step), LONGEST),
            "impact.normal_velocity": self.normal_velocity,
            "impact.tangential_velocity": self.tangential_velocity,
            "impact.state": list(self.state.numbers()),
        }
        if is_fall(values):
            kept |= {
                "impact.surface": fall_from_names(values).surface,
                "impact.friction": values["fall.friction"],
                "impact.gravity": values["fall.gravity"],
                "impact.neck_flexion_deg": fall_from_names(values).resolved_neck_flexion_deg,
            }
        else:
            names = ("surface", "friction", "gravity", "neck_flexion_deg")
            kept |= {f"impact.{name}": values[f"impact.{name}"] for name in names}
        return setup_from_names({k: v for k, v in kept.items() if v is not None})


#: Columns of a table of strikes: name, unit, and what of a strike stands there.
COLUMNS = (
    ("time", "s"), ("struck", "-"), ("normal_velocity", "m/s"), ("tangential_velocity", "m/s"),
    ("body_angle_deg", "deg"), ("zone", "-"), ("azimuth_deg", "deg"), ("elevation_deg", "deg"),
    ("duration", "s"),
)  # fmt: skip


class HeadStrikes(tuple[Strike, ...]):
    """The strikes of one fall in their order; empty where the head touched nothing."""

    __slots__ = ()

    @property
    def worst(self) -> Strike | None:
        """The strike with the highest peak acceleration of the head; None: no head contact."""
        return max(self, key=lambda strike: strike.peak_acceleration, default=None)

    def rows(self, criteria: Iterable[str] = ("peak_g", "hic", "bric")) -> list[dict[str, object]]:
        """One mapping per strike: the names of ``COLUMNS``, then the criteria."""
        found = []
        for strike in self:
            place = strike.location._asdict()
            row: dict[str, object] = {
                name: place[name] if name in place else getattr(strike, name) for name, _ in COLUMNS
            }
            results = strike.evaluation.criteria
            row |= {n: results[n].value if n in results else None for n in criteria}
            found.append(row)
        return found

    def frame(self) -> pd.DataFrame:
        """The strikes as a pandas table, one row each.

        Raises:
            MissingExtraError: pandas is not installed.
        """
        pandas = need("pandas", "study")
        names = [name for name, _ in COLUMNS]
        table = pandas.DataFrame(self.rows(), columns=[*names, "peak_g", "hic", "bric"])
        table.attrs["units"] = dict(COLUMNS) | {"peak_g": "g", "hic": "-", "bric": "-"}
        return table

    def __repr__(self) -> str:
        if not self:
            return "no head contact"
        lines = [
            f"{s.time:7.3f} s  {s.struck}: {s.normal_velocity:.1f} m/s into it, "
            f"{s.tangential_velocity:.1f} m/s along it, on {s.location.zone}, "
            f"{s.evaluation.peak_g.value:.0f} g"
            + "".join(f"\n{' ' * 11}{n}" for n in s.samples.notes)
            for s in self
        ]
        return "\n".join(lines)


def head_strikes(record: ImpactRecord, setup: Fall | ImpactSetup | None = None) -> HeadStrikes:
    """Every contact of helmet or bare head in a fall, each judged over its own window.

    Contacts less than 10 ms apart are one strike. A fall without any is a result: an empty tuple,
    shown as "no head contact".

    Args:
        record: of :func:`simulate`, or read from a log.
        setup: that of the record, where it is at hand; otherwise it is made from the record's.

    Raises:
        SetupError: the record's setup is not that of a fall or impact of a rider.
        PulseError: a record without samples.
    """
    if not len(record):
        raise PulseError("the record has no samples")
    touching = np.flatnonzero(np.abs(record.ground_force).max(axis=1) > 0.0)
    if not len(touching):
        return HeadStrikes()
    apart = np.flatnonzero(np.diff(record.time[touching]) > GAP)
    firsts = touching[np.concatenate([[0], apart + 1])]
    lasts = touching[np.concatenate([apart, [len(touching) - 1]])]
    setup = setup or setup_or_fall(record.setup)
    world = build(setup, setup.helmet_config)
    return HeadStrikes(
        _strike(record, setup, world, int(first), int(last))
        for first, last in zip(firsts, lasts, strict=True)
    )


def _strike(
    record: ImpactRecord, setup: Fall | ImpactSetup, world: World, first: int, last: int
) -> Strike:
    """The strike whose first and last touching samples are given."""
    before = max(first - 1, 0)
    time = float(record.time[first])
    force = record.ground_force[first] - record.ground_friction[first]
    normal = force / float(np.linalg.norm(force))
    turn = matrices(record.helmet_orientation[before : before + 1])[0]
    touch = first_touch(setup.helmet_config, turn.T @ -normal)
    point = record.helmet_position[before] + turn @ touch
    surface = setup.surface_config.moving(None, time)
    shape = nearest(surface, *(float(v) for v in point))[0]
    velocity = record.head_velocity[before] - surface.velocity[shape]
    into = -float(velocity @ normal)
    x, y, z = touch
    azimuth = math.degrees(math.atan2(y, x))
    elevation = math.degrees(math.atan2(z, math.hypot(x, y)))
    sine = -float(_body_axis(record, before, world) @ normal)
    state = _state(record, before, point, normal, setup, world)
    window = _window(record, before, last)
    notes = suffered(
        record, slice(before, last + 1), setup.helmet_config, world, float(state.yielded[0])
    )
    return Strike(
        time,
        float(record.time[last]) - time,
        into,
        float(np.linalg.norm(velocity + into * normal)),
        math.degrees(math.asin(max(-1.0, min(1.0, sine)))),
        Location(azimuth, elevation, _zone(azimuth, elevation)),
        setup.surface_config.name_of(shape),
        shape,
        point,
        normal,
        state,
        replace(window, extras=MappingProxyType({"notes": list(notes)})),
    )


@compiled
def kept_shortening(neck: CervicalSpine, lengths: FloatArray) -> float:
    """Shortening that a neck keeps [m] after its slide went through some lengths [m]."""
    yielded = 0.0
    for length in lengths:
        yielded = -length - elastic_length(neck, -length, yielded)
    return yielded


def _state(
    record: ImpactRecord,
    i: int,
    point: FloatArray,
    normal: FloatArray,
    setup: Fall | ImpactSetup,
    world: World,
) -> State:
    """How rider and helmet move in sample i."""
    model, layout = world.parts.model, world.parts.structure.layout
    rests = layout.positions(model.qpos_spring[None])[0]
    factors = np.ones(len(rests))
    if isinstance(setup, Fall):
        for name, factor in setup.posing.stiffened:
            factors[layout.joints.index(name)] = factor
    elif setup.state is not None:
        factors = read_state(setup.state).joint_factors
    shortened = record.joint_positions[: i + 1, record.joint_names.index("neck_axial")]
    yielded = kept_shortening(world.parts.neck, np.ascontiguousarray(shortened))
    near = slice(max(i - 1, 0), i + 2)
    back = matrices(record.head_orientation[near]).transpose(0, 2, 1)
    away = record.helmet_position[near] - record.head_position[near]
    shells = np.zeros((len(record.time[near]), 3))
    so_far = 0.0
    if SHELL in record.extras:
        shells = np.array(record.extras[SHELL])[near]
        counted = _compressions(record, i, setup.helmet_config.spring)
        so_far = float(np.linalg.norm(record.extras[SHELL][i]) + counted.max() - counted[-1])
    shifts = np.einsum("nij,nj->ni", back, away)
    head = Rotation.from_quat(record.head_orientation[near])
    turns = (head.inv() * Rotation.from_quat(record.helmet_orientation[near])).as_rotvec()
    at = i - near.start
    span = float(record.time[near][-1] - record.time[near][0])
    helmet = Rotation.from_rotvec(turns)
    shifts = shifts - helmet.apply(shells)
    return State(
        float(record.time[i]), point, normal, record.head_position[i], record.head_orientation[i],
        record.head_velocity[i], record.head_angular_velocity[i], shifts[at], turns[at],
        (shifts[-1] - shifts[0]) / span, (turns[-1] - turns[0]) / span, shells[at],
        (shells[-1] - shells[0]) / span, np.array([so_far]), np.array([yielded]),
        record.joint_positions[i], record.joint_velocities[i], rests, factors,
    )  # fmt: skip


def _compressions(record: ImpactRecord, i: int, spring: Spring) -> FloatArray:
    """Of the coupling spring in the samples up to i, (i + 1,) [m]."""
    until = slice(0, i + 1)
    pressed = record.ground_force[until] - record.ground_friction[until]
    back = matrices(record.helmet_orientation[until]).transpose(0, 2, 1)
    shells = np.array(record.extras[SHELL])[until]
    return compressions(spring, shells, np.einsum("nij,nj->ni", back, pressed))


def _zone(azimuth: float, elevation: float) -> str:
    def direction(azimuth: float, elevation: float) -> FloatArray:
        a, e = math.radians(azimuth), math.radians(elevation)
        return np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])

    struck = direction(azimuth, elevation)
    return max(SITES, key=lambda zone: float(direction(*SITES[zone]) @ struck))


def _body_axis(record: ImpactRecord, i: int, world: World) -> FloatArray:
    """Unit vector from the hips to the top of the trunk, world axes."""
    model, data = world.parts.model, world.data
    world.parts.structure.layout.pose(data.qpos, record.joint_names, record.joint_positions[i])
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, record.head_orientation[i][[3, 0, 1, 2]])
    place_head(model, data, record.head_position[i], turn.reshape(3, 3))
    hips = 0.5 * (data.body("thigh_left").xpos + data.body("thigh_right").xpos)
    axis: FloatArray = data.body("thorax").xpos - hips
    return axis / float(np.linalg.norm(axis))


def _window(record: ImpactRecord, first: int, last: int) -> ImpactRecord:
    """The samples of a strike and of a moment after it."""
    until = min(float(record.time[last]) + TAIL, float(record.time[first]) + LONGEST)
    end = int(np.searchsorted(record.time, until, side="right"))
    end = min(max(end, first + 11), len(record))
    cut = slice(max(0, min(first, end - 11)), end)
    arrays = {name: getattr(record, name)[cut] for name in CHANNELS}
    return replace(
        record, time=record.time[cut], joint_positions=record.joint_positions[cut],
        joint_velocities=record.joint_velocities[cut], setup=record.setup,
        extras=MappingProxyType({}), **arrays,
    )  # fmt: skip
