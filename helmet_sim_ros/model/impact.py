"""One impact, step by step or at once: the physics behind :func:`simulate`."""

from __future__ import annotations

from collections.abc import Iterator
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import (
    FloatArray,
    ImpactRecord,
    block_labels,
    to_block,
)
from helmet_sim_ros.biomech.rotation import matrices
from helmet_sim_ros.errors import DivergedError, PulseError
from helmet_sim_ros.model import coupling
from helmet_sim_ros.model.foam import residual_strains
from helmet_sim_ros.model.liner import POINT, THICKNESS, crush_depth, nothing_near
from helmet_sim_ros.model.loop import advance
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.world import build


def simulate(setup: ImpactSetup, crush: FloatArray | None = None) -> ImpactRecord:
    """Simulate one impact.

    Args:
        setup: the impact; its ``duration`` and ``time_step`` give the number of samples.
        crush: largest strain of each foam column in earlier impacts, ``extras["crush"]`` of the
            last one; unset: a new helmet.

    Returns:
        Every sample of the impact, SI units, from the first touch of the ground.

    Raises:
        DivergedError: the state stopped being finite.
    """
    impact = Impact(setup, crush)
    impact.advance(impact.total)
    return impact.record()


class Impact:
    """An impact that can be advanced in slices.

    Attributes:
        setup: the impact setup.
        total: number of samples of the whole impact.
        labels: column names of :meth:`block`.
        shapes: what may touch the ground, the helmet first.
        notes: what a user should know about this setup, in words.
    """

    def __init__(self, setup: ImpactSetup, crush: FloatArray | None = None) -> None:
        self.setup = setup
        self.total = setup.samples
        world = build(setup)
        self.notes = world.notes
        self._model, self._data, self._spec = world.parts.model, world.data, world.parts.spec
        model = self._model
        self._layout = layout = world.parts.layout
        self.labels = block_labels(layout.joints)
        spring = setup.helmet_config.spring
        self.shapes = shapes = world.shapes
        data = self._data
        # Views of MuJoCo's arrays and the history of spring and contacts, as the loop takes them.
        self._states = (data.qpos, data.qvel, data.qacc, data.qacc_smooth, data.sensordata)
        self._frames = (
            data.xpos, data.xmat, data.xipos, data.cvel, data.cdof, data.subtree_com[1]
        )  # fmt: skip
        self._forces = (data.qfrc_applied, data.xfrc_applied)
        self._inertia = (data.M, *world.parts.damped_diagonal)
        self._spring = (coupling.law_table(spring), spring.energy_loss, coupling.new_state())
        self._shapes = (
            shapes.body, shapes.center, shapes.semi_axes, shapes.law, shapes.new_state()
        )  # fmt: skip
        columns = world.parts.columns
        self._liner = (
            columns.geometry, columns.foam, setup.friction,
            np.zeros(len(columns)) if crush is None else np.array(crush, dtype=float),
            np.full(len(columns), -1.0), np.zeros((len(columns), 2)),
            columns.padding, np.zeros(2),
        )  # fmt: skip
        if self._liner[3].shape != (len(columns),):
            raise PulseError(f"crush: shape {self._liner[3].shape}, expected ({len(columns)},)")
        self._near = nothing_near(len(columns))
        self._substeps = world.substeps
        self._stops, self._chains = world.parts.stops, world.parts.chains
        self._samples = tuple(
            np.zeros((self.total, *columns))
            for columns in (
                (model.nq,), (model.nv,), (model.nsensordata,), (3,), (2, 6)
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
            self._model._address, self._data._address, self._model.opt.timestep,
            self._substeps, self._done, last,
            self._states, self._frames, self._forces, self._inertia, self._chains,
            self._layout.slides, self._spring, self._shapes, self._liner, self._near, self._stops,
            self._samples,
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

    @property
    def model(self) -> mujoco.MjModel:
        """The compiled model."""
        return self._model

    def states(self) -> Iterator[tuple[FloatArray, FloatArray]]:
        """MuJoCo's qpos and qvel of every finished sample."""
        yield from zip(self._samples[0][: self._done], self._samples[1][: self._done], strict=True)

    def model_xml(self) -> str:
        """The model as MJCF text, for provenance and replay in other tools."""
        return str(self._spec.to_xml())

    def _slice(self, first: int, last: int) -> ImpactRecord:
        q, v, sensors, spring_rows, ground = (rows[first:last] for rows in self._samples)
        layout, rider = self._layout, self.setup.rig == "rider"
        orientation = layout.read(sensors, "head_orientation")[:, [1, 2, 3, 0]]
        position = layout.read(sensors, "head_position")
        helmet_orientation = layout.read(sensors, "helmet_orientation")[:, [1, 2, 3, 0]]
        turn = matrices(orientation)
        if layout.slides[0] >= 0:
            displacement = q[:, layout.slides[0] : layout.slides[0] + 3]
            shell, force = position + _turned(turn, displacement), -spring_rows
        else:  # the crushed liner, in the same sense: the ground pushes the shell upwards
            shell_turn = matrices(helmet_orientation)
            depth = crush_depth(self.setup.helmet_config.shell, position, shell_turn)
            back = turn.transpose(0, 2, 1)
            displacement = _turned(back, np.array([[0.0, 0.0, 1.0]])) * depth[:, None]
            shell, force = position, _turned(back, ground[:, 0, :3])
        gravity = np.array([0.0, 0.0, -self.setup.gravity])
        zeros = np.zeros((len(q), 3))
        return ImpactRecord(
            time=np.arange(first, last, dtype=np.float64) * self.setup.time_step,
            # MuJoCo's framelinacc is specific force: inertial acceleration minus gravity.
            head_acceleration=layout.read(sensors, "head_specific_force") + gravity,
            head_angular_acceleration=layout.read(sensors, "head_angular_acceleration"),
            head_velocity=layout.read(sensors, "head_velocity"),
            head_angular_velocity=layout.read(sensors, "head_angular_velocity"),
            head_position=position,
            head_orientation=orientation,
            helmet_position=shell,
            helmet_orientation=helmet_orientation,
            ground_force=ground[:, 0, :3],
            ground_torque=ground[:, 0, 3:],
            coupling_force=force,
            coupling_torque=-layout.read(sensors, "coupling_torque"),
            coupling_displacement=displacement,
            body_ground_force=ground[:, 1, :3],
            neck_force=layout.read(sensors, "neck_force") if rider else zeros,
            neck_torque=layout.read(sensors, "neck_torque") if rider else zeros,
            joint_names=layout.joints,
            joint_positions=q.take(layout.qpos, axis=1),
            joint_velocities=v.take(layout.qvel, axis=1),
            setup=MappingProxyType(self.setup.described()),
            extras=MappingProxyType(self.extras()),
        )

    def extras(self) -> dict[str, Any]:
        """Notes, and of a foam helmet the crush map so far: ``crush`` (largest strain of each
        column), ``residual_crush`` [m], ``column_position`` (n, 3) [m] in the helmet frame."""
        extras: dict[str, Any] = {"notes": list(self.notes)}
        geometry, foam, _, largest, *_ = self._liner
        if len(geometry):
            extras |= {
                "crush": largest.copy(),
                "residual_crush": residual_strains(largest, foam) * geometry[:, THICKNESS],
                "column_position": geometry[:, POINT : POINT + 3].copy(),
            }
        return extras


def _turned(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Rotated vectors, shape (n, 3), term by term: a sample has the same bits in a slice of any
    length (``Rotation.apply`` sums a single row in another order)."""
    m = matrices
    x, y, z = (vectors[:, i : i + 1] for i in range(3))
    turned: FloatArray = m[:, :, 0] * x + m[:, :, 1] * y + m[:, :, 2] * z
    return turned
