"""What one impact leaves behind: named arrays, one row per sample, SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.errors import PulseError
from helmet_sim_ros.extra import need
from helmet_sim_ros.views import show

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]
HORIZONTAL = np.array([1.0, 1.0, 0.0])  # what of a force is friction on flat ground

#: Name in the extras of a record whose samples are not uniform: first and last (exclusive) sample
#: of each stretch at ``sim.time_step``.
DENSE = "dense"
#: Name, in the extras of a fall's record, of the displacement of a spring helmet's shell in its
#: coupling: helmet axes, (n, 3) [m].
SHELL = "shell_displacement"
#: Channels every record carries: name -> (component labels, unit).
CHANNELS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "head_acceleration": (("x", "y", "z"), "m/s^2"),
    "head_angular_acceleration": (("x", "y", "z"), "rad/s^2"),
    "head_velocity": (("x", "y", "z"), "m/s"),
    "head_angular_velocity": (("x", "y", "z"), "rad/s"),
    "head_position": (("x", "y", "z"), "m"),
    "head_orientation": (("x", "y", "z", "w"), "-"),
    "helmet_position": (("x", "y", "z"), "m"),
    "helmet_orientation": (("x", "y", "z", "w"), "-"),
    "ground_force": (("x", "y", "z"), "N"),
    "ground_torque": (("x", "y", "z"), "N m"),
    "ground_friction": (("x", "y", "z"), "N"),
    "coupling_force": (("x", "y", "z"), "N"),
    "coupling_torque": (("x", "y", "z"), "N m"),
    "coupling_displacement": (("x", "y", "z"), "m"),
    "body_ground_force": (("x", "y", "z"), "N"),
    "neck_force": (("x", "y", "z"), "N"),
    "neck_torque": (("x", "y", "z"), "N m"),
}

#: What some records hold in their extras with a row per sample: name -> (component labels, unit).
SAMPLED: Mapping[str, tuple[tuple[str, ...], str]] = {SHELL: (("x", "y", "z"), "m")}


@dataclass(frozen=True, repr=False)
class ImpactRecord:
    """All samples of one impact. Row ``i`` of every array belongs to ``time[i]``.

    Axes: *world* has z up and the ground at z = 0; *head* has its origin at the head's centre of
    gravity, x forward, y left, z up.

    Velocities, also those of the joints, are those of the integration step that led to the
    positions: half a step behind them, 25 us at most. With ``sim.rates: several`` they are of the
    same instant.

    Attributes:
        time: shape (n,) [s], uniform, 0 at the first touch of the ground; of a fall from its start
            on and at steps that follow what happens, see ``DENSE``.
        head_acceleration: inertial acceleration of the head's centre of gravity, world axes,
            shape (n, 3) [m/s^2]. At rest it is 0, in free fall -g.
        head_angular_acceleration: world axes, (n, 3) [rad/s^2].
        head_velocity: of the head's centre of gravity, world axes, (n, 3) [m/s].
        head_angular_velocity: world axes, (n, 3) [rad/s].
        head_position: of the head's centre of gravity, world axes, (n, 3) [m].
        head_orientation: head to world, unit quaternion x, y, z, w, (n, 4).
        helmet_position: origin of the helmet frame (it coincides with ``head`` while the coupling
            is not compressed), world axes, (n, 3) [m].
        helmet_orientation: helmet to world, unit quaternion x, y, z, w, (n, 4).
        ground_force: force of the surface ON the helmet, world axes, (n, 3) [N].
        ground_torque: its moment about the world origin, world axes, (n, 3) [N m].
        ground_friction: the part of ``ground_force`` that acts along the surface where it touches,
            world axes, (n, 3) [N]; the rest is normal to it. Unset: that of flat ground, x and y.
        coupling_force: force of the helmet ON the head, head axes, (n, 3) [N].
        coupling_torque: its moment about the helmet frame's origin, head axes, (n, 3) [N m].
        coupling_displacement: helmet against head, head axes, (n, 3) [m]: a blow on the front
            moves the helmet backwards, x < 0. For a foam liner, the crush in the same sense.
        body_ground_force: sum of the ground's forces on the body without head and helmet, world
            axes, (n, 3) [N].
        neck_force: force of the torso (neck) ON the head, head axes, (n, 3) [N]; 0 for a headform.
        neck_torque: its moment about the head-neck joint, head axes, (n, 3) [N m].
        joint_names: the m joint coordinates of the body below the head; a ball joint has three,
            ``NAME.x``, ``NAME.y`` and ``NAME.z``.
        joint_positions: (n, m) [rad, or m for a sliding joint]; of a ball joint the rotation
            vector of its child against its parent.
        joint_velocities: (n, m) [rad/s or m/s]; of a ball joint the angular velocity in the
            child's axes, which is not the derivative of the rotation vector.
        setup: the complete impact setup as plain data (JSON types).
        extras: further named results of plain data or arrays (notes, residual crush map...).
    """

    time: FloatArray
    head_acceleration: FloatArray
    head_angular_acceleration: FloatArray
    head_velocity: FloatArray
    head_angular_velocity: FloatArray
    head_position: FloatArray
    head_orientation: FloatArray
    helmet_position: FloatArray
    helmet_orientation: FloatArray
    ground_force: FloatArray
    ground_torque: FloatArray
    coupling_force: FloatArray
    coupling_torque: FloatArray
    coupling_displacement: FloatArray
    body_ground_force: FloatArray
    neck_force: FloatArray
    neck_torque: FloatArray
    ground_friction: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    joint_names: tuple[str, ...] = ()
    joint_positions: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    joint_velocities: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    setup: Mapping[str, Any] = field(default_factory=dict)
    extras: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.time)
        if not len(self.ground_friction) and np.shape(self.ground_force) == (n, 3):
            # Nothing said: the ground is flat (the only one that logs of 0.1.0 know).
            object.__setattr__(self, "ground_friction", self.ground_force * HORIZONTAL)
        for name in CHANNELS:
            expected = (n, len(CHANNELS[name][0]))
            if np.shape(getattr(self, name)) != expected:
                raise PulseError(
                    f"{name}: shape {np.shape(getattr(self, name))}, expected {expected}"
                )

    @property
    def time_step(self) -> float:
        """Sampling interval [s]."""
        return float(self.time[1] - self.time[0])

    @property
    def is_uniform(self) -> bool:
        """Whether all samples are one time step apart."""
        steps = np.diff(self.time)
        return bool(len(steps) == 0 or np.ptp(steps) <= 1e-6 * float(steps[0]))

    def uniform(self) -> ImpactRecord:
        """The same at its shortest time step throughout, linear between its samples: whoever asks
        for windows and frequencies needs that. Extras are left out where they are samples.

        Returns:
            This record, if its samples are that already.
        """
        if self.is_uniform:
            return self
        step = float(np.diff(self.time).min())
        count = int((self.time[-1] - self.time[0]) / step + 1e-6) + 1
        time = self.time[0] + step * np.arange(count)

        before = np.searchsorted(self.time, time, side="right") - 1
        before = np.minimum(before, len(self) - 2)
        share = ((time - self.time[before]) / (self.time[before + 1] - self.time[before]))[:, None]

        def at(samples: FloatArray) -> FloatArray:
            if not samples.size:  # no joints
                return np.zeros((count, 0))
            low = samples[before]
            between: FloatArray = low + share * (samples[before + 1] - low)
            return between

        arrays: dict[str, Any] = {name: at(getattr(self, name)) for name in CHANNELS}
        for name in ("head_orientation", "helmet_orientation"):
            turns = _same_side(getattr(self, name))
            between = at(turns)
            arrays[name] = between / np.linalg.norm(between, axis=1)[:, None]
        extras = {k: v for k, v in self.extras.items() if np.shape(v)[:1] != (len(self),)}
        return replace(
            self, time=time, joint_positions=at(self.joint_positions),
            joint_velocities=at(self.joint_velocities), extras=extras, **arrays,
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self.time)

    @property
    def labels(self) -> list[str]:
        """The columns of :func:`to_block` for this record."""
        return block_labels(self.joint_names, self._sampled)

    @property
    def units(self) -> list[str]:
        """The unit of each of them."""
        return block_units(self.joint_names, self._sampled)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader should know of this record, in words; from its extras."""
        return tuple(map(str, self.extras.get("notes", ())))

    @property
    def _sampled(self) -> tuple[str, ...]:
        return tuple(name for name in SAMPLED if name in self.extras)

    def frame(self) -> pd.DataFrame:
        """The samples as a pandas table, one column per component, the index is time [s].

        Units are in ``frame.attrs["units"]``, the setup in ``frame.attrs["setup"]``.

        Raises:
            MissingExtraError: pandas is not installed.
        """
        return show("sample_frame", self)

    def plot(self) -> Figure:
        """The histories of the impact as a matplotlib figure, which a notebook shows.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        need("matplotlib.figure", "report")
        return show("record_figure", self)  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        return str(show("record_text", self))

    def _repr_html_(self) -> str:
        return str(show("record_html", self))


def is_fall(setup: Mapping[str, Any]) -> bool:
    """Whether dotted names describe a fall, not an impact."""
    return any(name.startswith("fall.") for name in setup)


def _same_side(turns: FloatArray) -> FloatArray:
    """Quaternions of the same rotations, (n, 4), each on the side of the one before."""
    along = (turns[1:] * turns[:-1]).sum(axis=1)
    sides = np.cumprod(np.where(along < 0.0, -1.0, 1.0))
    chained: FloatArray = turns * np.concatenate([[1.0], sides])[:, None]
    return chained


def block_labels(joint_names: tuple[str, ...], sampled: tuple[str, ...] = ()) -> list[str]:
    """Column names of :func:`to_block`: ``time``, ``head_acceleration.x``, ...,
    ``joint_position.NAME``, ``joint_velocity.NAME``; and those of ``sampled`` extras."""
    labels = ["time"]
    for name, (components, _) in CHANNELS.items():
        labels += [f"{name}.{component}" for component in components]
    labels += [f"joint_position.{joint}" for joint in joint_names]
    labels += [f"joint_velocity.{joint}" for joint in joint_names]
    for name in sampled:
        labels += [f"{name}.{component}" for component in SAMPLED[name][0]]
    return labels


#: Joints that slide; all others turn.
SLIDING_JOINTS = frozenset({"neck_axial"})


def block_units(joint_names: tuple[str, ...], sampled: tuple[str, ...] = ()) -> list[str]:
    """The unit of each column of :func:`to_block`."""
    units = ["s"]
    for components, unit in CHANNELS.values():
        units += [unit] * len(components)
    angles = ["m" if joint in SLIDING_JOINTS else "rad" for joint in joint_names]
    units += angles + [f"{unit}/s" for unit in angles]
    for name in sampled:
        units += [SAMPLED[name][1]] * len(SAMPLED[name][0])
    return units


def to_block(record: ImpactRecord) -> FloatArray:
    """All samples as one array, shape (n, len(record.labels)), exact."""
    columns = [record.time[:, None]]
    columns += [getattr(record, name) for name in CHANNELS]
    joints = len(record.time), len(record.joint_names)  # a record made by hand may have none
    columns += [record.joint_positions.reshape(joints), record.joint_velocities.reshape(joints)]
    columns += [np.asarray(record.extras[name]) for name in SAMPLED if name in record.extras]
    return np.hstack(columns)


def from_block(
    labels: list[str],
    block: FloatArray,
    setup: Mapping[str, Any] | None = None,
    extras: Mapping[str, Any] | None = None,
) -> ImpactRecord:
    """The inverse of :func:`to_block`.

    Raises:
        PulseError: a channel of the record has no column, or the shapes disagree.
    """
    if block.ndim != 2 or block.shape[1] != len(labels):
        raise PulseError(f"samples: shape {block.shape}, expected (n, {len(labels)})")
    column = {label: i for i, label in enumerate(labels)}

    def read(*names: str) -> FloatArray:
        # In C order, as a simulation has them: sums of the same samples have the same bits.
        return np.ascontiguousarray(block[:, [column[name] for name in names]])

    arrays: dict[str, FloatArray] = {}
    try:
        arrays["time"] = block[:, column["time"]]
        for name, (components, _) in CHANNELS.items():
            if name == "ground_friction" and "ground_friction.x" not in column:
                continue
            arrays[name] = read(*(f"{name}.{c}" for c in components))
        prefix = "joint_position."
        joints = tuple(label[len(prefix) :] for label in labels if label.startswith(prefix))
        arrays["joint_positions"] = read(*(f"joint_position.{j}" for j in joints))
        arrays["joint_velocities"] = read(*(f"joint_velocity.{j}" for j in joints))
        sampled = {
            name: read(*(f"{name}.{c}" for c in components))
            for name, (components, _) in SAMPLED.items()
            if f"{name}.{components[0]}" in column
        }
    except KeyError as missing:
        raise PulseError(f"samples: no column {missing}") from None
    return ImpactRecord(
        **arrays,
        joint_names=joints,
        setup=dict(setup or {}),
        extras=dict(extras or {}) | sampled,
    )


def same_samples(a: ImpactRecord, b: ImpactRecord) -> bool:
    """Whether two records hold bit for bit the same samples."""
    arrays = [f.name for f in fields(ImpactRecord) if f.name not in ("setup", "extras")]
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in arrays)
