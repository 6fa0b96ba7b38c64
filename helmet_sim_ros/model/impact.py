"""One impact, step by step or at once: the physics behind :func:`simulate`."""

from __future__ import annotations

from types import MappingProxyType

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import (
    FloatArray,
    ImpactRecord,
    block_labels,
    from_block,
    to_block,
)
from helmet_sim_ros.errors import DivergedError
from helmet_sim_ros.model import coupling
from helmet_sim_ros.model.loop import advance
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.world import build


def simulate(setup: ImpactSetup) -> ImpactRecord:
    """Simulate one impact.

    Args:
        setup: the impact; its ``duration`` and ``time_step`` give the number of samples.

    Returns:
        Every sample of the impact, SI units, from the first touch of the ground.

    Raises:
        DivergedError: the state stopped being finite.
    """
    impact = Impact(setup)
    impact.advance(impact.total)
    return impact.record()


class Impact:
    """An impact that can be advanced in slices.

    Attributes:
        setup: the impact setup.
        total: number of samples of the whole impact.
        labels: column names of :meth:`block`.
        notes: what a user should know about this setup, in words.
    """

    def __init__(self, setup: ImpactSetup) -> None:
        self.setup = setup
        self.total = setup.samples
        world = build(setup)
        self.notes = world.notes
        self._model, self._data, self._spec = world.model, world.data, world.spec
        model = self._model
        self._joints = _Columns(model)
        self.labels = block_labels(self._joints.names)
        spring = setup.helmet_config.spring
        shapes = world.shapes
        data = self._data
        # Views of MuJoCo's arrays and the history of spring and contacts, as the loop takes them.
        self._states = (data.qpos, data.qvel, data.qacc, data.sensordata)
        self._frames = (data.xpos, data.xmat, data.xipos, data.cvel, data.subtree_com[1])
        self._forces = (data.qfrc_applied, data.xfrc_applied)
        self._spring = (coupling.law_table(spring), spring.energy_loss, coupling.new_state())
        self._shapes = (
            shapes.body, shapes.center, shapes.semi_axes, shapes.law, shapes.new_state()
        )  # fmt: skip
        self._samples = tuple(
            np.zeros((self.total, *columns))
            for columns in (
                (model.nq,), (model.nv,), (model.nv,), (model.nsensordata,), (3,), (2, 6),
            )
        )  # fmt: skip
        self._done = 0

    @property
    def done_samples(self) -> int:
        """Number of finished samples."""
        return self._done

    def advance(self, samples: int) -> int:
        """Step until up to ``samples`` more samples are finished.

        Returns:
            The number of finished samples.

        Raises:
            DivergedError: the state stopped being finite; earlier samples stay readable.
        """
        last = min(self._done + samples, self.total)
        self._done = advance(
            self._model._address, self._data._address, self.setup.time_step, self._done, last,
            self._states, self._frames, self._forces, self._joints.slides, self._spring,
            self._shapes, self._samples,
        )  # fmt: skip
        if self._done < last:
            raise DivergedError(self._done * self.setup.time_step, self.setup.described())
        return self._done

    def block(self, first: int, last: int) -> FloatArray:
        """Finished samples ``first`` to ``last`` (exclusive), shape (last - first, len(labels))."""
        if not 0 <= first <= last <= self._done:
            raise IndexError(f"samples {first} to {last} of {self._done} finished")
        return to_block(self._slice(first, last))

    def record(self) -> ImpactRecord:
        """All finished samples."""
        return self._slice(0, self._done)

    def model_xml(self) -> str:
        """The model as MJCF text, for provenance and replay in other tools."""
        return str(self._spec.to_xml())

    def _slice(self, first: int, last: int) -> ImpactRecord:
        q, v, a, sensors, spring_on_shell, ground = (rows[first:last] for rows in self._samples)
        columns, rider = self._joints, self.setup.rig == "rider"
        turn = _rotation_matrices(q[:, 3:7])
        zeros = np.zeros((len(q), 3))

        def read(name: str) -> FloatArray:
            start = int(self._model.sensor(name).adr[0])
            return sensors[:, start : start + 3]

        displacement = q[:, columns.slides[0] : columns.slides[0] + 3]
        orientation = q[:, [4, 5, 6, 3]]
        return ImpactRecord(
            time=np.arange(first, last) * self.setup.time_step,
            head_acceleration=a[:, 0:3],
            head_angular_acceleration=_rotated(turn, a[:, 3:6]),
            head_velocity=v[:, 0:3],
            head_angular_velocity=_rotated(turn, v[:, 3:6]),
            head_position=q[:, 0:3],
            head_orientation=orientation,
            helmet_position=q[:, 0:3] + _rotated(turn, displacement),
            helmet_orientation=orientation,
            ground_force=ground[:, 0, :3],
            ground_torque=ground[:, 0, 3:],
            coupling_force=-spring_on_shell,
            coupling_torque=-read("coupling_torque"),
            coupling_displacement=displacement,
            # MuJoCo's joint sensors read what the parent exerts on the child.
            neck_force=self._in_head_axes(q, -read("neck_force")) if rider else zeros,
            neck_torque=self._in_head_axes(q, -read("neck_torque")) if rider else zeros,
            body_ground_force=ground[:, 1, :3],
            joint_names=columns.names,
            joint_positions=q[:, columns.qpos],
            joint_velocities=v[:, columns.qvel],
            setup=MappingProxyType(self.setup.described()),
            extras=MappingProxyType({"notes": list(self.notes)}),
        )

    def _in_head_axes(self, q: FloatArray, vectors: FloatArray) -> FloatArray:
        """Vectors in the neck body's axes turned into head axes (three hinges between them)."""
        turn = np.broadcast_to(np.eye(3), (len(q), 3, 3))
        for joint in ("neck_upper_flexion", "neck_upper_lateral", "neck_upper_rotation"):
            axis = self._model.joint(joint).axis
            angle = q[:, int(self._model.joint(joint).qposadr[0])]
            turn = turn @ _axis_rotations(axis, angle)
        return _rotated(turn, vectors)


class _Columns:
    """Where the joints stand in MuJoCo's state vectors."""

    def __init__(self, model: mujoco.MjModel) -> None:
        first = model.joint("coupling_x")
        self.slides = (int(first.qposadr[0]), int(first.dofadr[0]))
        body = [j for j in range(model.njnt) if not model.joint(j).name.startswith("coupling_")]
        body = [j for j in body if model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE]
        self.names = tuple(model.joint(j).name for j in body)
        self.qpos = np.array([model.jnt_qposadr[j] for j in body], dtype=int)
        self.qvel = np.array([model.jnt_dofadr[j] for j in body], dtype=int)


def _rotation_matrices(quaternions: FloatArray) -> FloatArray:
    """Unit quaternions w, x, y, z, shape (n, 4), as matrices, shape (n, 3, 3)."""
    w, x, y, z = quaternions.T
    return np.stack(
        [
            1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
            2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
            2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
        ],
        axis=-1,
    ).reshape(-1, 3, 3)  # fmt: skip


def _axis_rotations(axis: FloatArray, angles: FloatArray) -> FloatArray:
    """Rotations about a fixed unit axis, shape (n, 3, 3)."""
    half = 0.5 * angles[:, None]
    return _rotation_matrices(np.hstack([np.cos(half), np.sin(half) * np.asarray(axis)]))


def _rotated(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    return np.einsum("nij,nj->ni", matrices, vectors)


__all__ = ["Impact", "ImpactRecord", "from_block", "simulate"]
