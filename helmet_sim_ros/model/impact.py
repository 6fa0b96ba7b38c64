"""One impact, step by step or at once: the physics behind :func:`.simulate.simulate`."""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import (
    SHELL,
    FloatArray,
    ImpactRecord,
    block_labels,
    to_block,
)
from helmet_sim_ros.biomech.rotation import matrices
from helmet_sim_ros.errors import DivergedError, PulseError
from helmet_sim_ros.model.anvil_drops import on_its_surface
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.model.force.bodies import (
    BODY,
    COLUMNS,
    FORCE,
    FRICTION,
    HELMET,
    MOMENT,
    motion_of,
    no_loads,
)
from helmet_sim_ros.model.force.fit import Fit, fit
from helmet_sim_ros.model.force.foam import residual_strains
from helmet_sim_ros.model.force.laying import shell as shell_of
from helmet_sim_ros.model.force.liner import crushing_liner
from helmet_sim_ros.model.force.self_contact import started
from helmet_sim_ros.model.force.spring import CouplingSpring, coupling_spring
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.layout import Layout
from helmet_sim_ros.model.loop import Clock, Engine, Forces, Rows, Simulation, advance
from helmet_sim_ros.model.rates.parts import rates
from helmet_sim_ros.model.rates.several import advance_several
from helmet_sim_ros.model.rider.neck import overload
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.state import read_state
from helmet_sim_ros.model.watch import most_energy, overloaded
from helmet_sim_ros.model.world import build, specified


class Impact:
    """An impact that can be advanced in slices.

    Attributes:
        setup: the impact setup, or the fall.
        helmet: what is worn.
        total: number of samples of the whole impact.
        labels: column names of :meth:`block`.
        surface: what is struck.
        contact: what may touch it by a stiff contact.
        neck: constants of the rider's neck.
        notes: what a user should know about this setup, in words.
    """

    def __init__(
        self,
        setup: ImpactSetup | Fall,
        crush: FloatArray | None = None,
        helmet: Helmet | None = None,
    ) -> None:
        """Args: see :func:`.simulate.simulate`; ``helmet`` takes the place of the setup's."""
        self.setup = setup
        helmet = helmet or setup.helmet_config
        if isinstance(setup, ImpactSetup) and setup.state is None:
            helmet = on_its_surface(setup, helmet)
        self.helmet = helmet
        self.total = setup.samples
        world = build(setup, helmet, crush is not None)
        parts, data = world.parts, world.data
        self.notes, self.surface, self.contact = world.notes, world.surface, world.contact
        self.neck = parts.neck
        self._model, self._data, self._plan = parts.model, data, parts.plan
        weakref.finalize(self, parts.structure.spare.append, data)
        self._layout = layout = parts.structure.layout
        self._tells_shell = isinstance(setup, Fall) and layout.slide >= 0
        self.labels = block_labels(layout.joints, (SHELL,) if self._tells_shell else ())
        columns, shapes = parts.columns, len(world.surface.kind)
        count = len(columns.area)
        largest = np.zeros(count) if crush is None else np.array(crush, dtype=float)
        if largest.shape != (count,):
            raise PulseError(f"crush: shape {largest.shape}, expected ({count},)")
        self._several = isinstance(setup, ImpactSetup) and setup.rates == "several"
        motion = motion_of(data, 0.5 * parts.model.opt.timestep if self._several else 0.0)
        liner = crushing_liner(columns, helmet, layout.helmet, shapes, largest)
        shell, body = world.contact.parts(1 if helmet.coupling == "spring" else 0)
        forces = Forces(
            world.surface,
            self.fresh_spring(),
            parts.stops.fresh(),
            parts.neck.fresh(),
            world.contact,
            body,
            shell,
            liner,
            shell_of(helmet, liner),
            self.fresh_fit(),
            started(parts.own, motion),
        )
        if isinstance(setup, ImpactSetup) and setup.state is not None:
            state = read_state(setup.state)
            spring, now = forces.spring, float(np.linalg.norm(state.shell))
            spring.past[:] = max(float(state.compressed[0]), now), now
            spring.behind[:] = spring.past[0] - now
            forces.neck.yielded[0] = float(state.yielded[0])
        engine = Engine(
            parts.model._address, data._address, data.qacc_smooth, data.qacc, data.xfrc_applied,
            data.sensordata, data.M, parts.damped_diagonal[0], parts.model.opt.timestep,
            parts.damped_diagonal[1], parts.structure.chains, data.energy,
        )  # fmt: skip
        clock = Clock(
            parts.model.opt.timestep,
            world.substeps,
            *most_energy(parts.model, data, setup, world.surface),
        )
        loads = no_loads(parts.model, data.qfrc_applied)
        self._simulation = Simulation(engine, motion, loads, forces, clock)
        widths = (parts.model.nq, parts.model.nv, parts.model.nsensordata, 6, 3, (2, COLUMNS), 3)
        rows = 0 if isinstance(setup, Fall) else self.total  # a fall makes room as it goes on
        self._rows = Rows(*(np.zeros((rows, *np.atleast_1d(w))) for w in widths))
        self._time = np.arange(self.total, dtype=np.float64) * setup.time_step
        self._done = self._computed = 0
        if self._several:
            self._rates = rates(parts.model, data, layout, parts.structure.chains)

    @property
    def done_samples(self) -> int:
        """Number of finished samples."""
        return self._done

    @property
    def is_over(self) -> bool:
        """Whether every sample is finished."""
        return self._done == self.total

    @property
    def time(self) -> float:
        """Of the last finished sample [s]; 0 before the first."""
        return float(self._time[self._done - 1]) if self._done else 0.0

    def advance(self, samples: int) -> int:
        """Step until up to ``samples`` more samples are finished.

        Returns:
            The number of finished samples.

        Raises:
            DivergedError: the state stopped being finite; earlier samples stay readable.
        """
        last = min(self._done + samples, self.total)
        if self._computed < last:
            self._computed = self._stepped(last)
        self._done = min(self._computed, last)
        if self._done < last:
            raise DivergedError(self._done * self.setup.time_step, self.setup.described())
        return self._done

    def run(self) -> None:
        """Step to the end.

        Raises:
            DivergedError: see :meth:`advance`.
        """
        self.advance(self.total)

    def _stepped(self, last: int) -> int:
        """Step until sample ``last``; a large step may go beyond it."""
        if self._several:
            return advance_several(self._simulation, self._rates, self._rows, last)
        return advance(self._simulation, self._rows, self._computed, last)

    @property
    def layout(self) -> Layout:
        """Where named quantities stand in the model's vectors."""
        return self._layout

    def fresh_spring(self) -> CouplingSpring:
        """The coupling spring before the first touch."""
        layout, helmet = self._layout, self.helmet
        return coupling_spring(
            helmet.spring, helmet.shell.semi_axes, layout.slide, layout.slide_velocity,
            layout.helmet,
        )  # fmt: skip

    def fresh_fit(self) -> Fit:
        """How the head sits in the helmet at the first touch."""
        layout = self._layout
        return fit(self.helmet, self.setup.head_surface, layout.fit, layout.fit_velocity)

    def block(self, first: int, last: int) -> FloatArray:
        """Finished samples ``first`` to ``last`` (exclusive), shape (last - first, len(labels))."""
        if not 0 <= first <= last <= self._done:
            raise IndexError(f"samples {first} to {last} of {self._done} finished")
        return to_block(self._slice(first, last, self._sampled(first, last)))

    def record(self) -> ImpactRecord:
        """All finished samples."""
        return self._slice(0, self._done, self.extras())

    @property
    def model(self) -> mujoco.MjModel:
        """The compiled model."""
        return self._model

    def states(self) -> Iterator[tuple[FloatArray, FloatArray]]:
        """MuJoCo's qpos and qvel of every finished sample."""
        yield from zip(self._rows.qpos[: self._done], self._rows.qvel[: self._done], strict=True)

    def model_xml(self) -> str:
        """The model as MJCF text, for provenance and replay in other tools."""
        spec = specified(self._plan)
        spec.compile()
        return str(spec.to_xml())

    def _slice(self, first: int, last: int, extras: Mapping[str, Any]) -> ImpactRecord:
        rows = Rows(*(array[first:last] for array in self._rows))
        q, v, sensors, helmet_load = rows.qpos, rows.qvel, rows.sensors, rows.surface[:, HELMET]
        layout, rider = self._layout, self.setup.rig == "rider"
        orientation = layout.read(sensors, "head_orientation")[:, [1, 2, 3, 0]]
        position = layout.read(sensors, "head_position")
        helmet_orientation = layout.read(sensors, "helmet_orientation")[:, [1, 2, 3, 0]]
        turn, helmet_turn = matrices(orientation), matrices(helmet_orientation)
        back = turn.transpose(0, 2, 1)
        shift, push, moment = np.zeros((len(q), 3)), rows.coupling[:, :3], rows.coupling[:, 3:]
        if layout.fit >= 0:
            shift = q[:, layout.fit : layout.fit + 3]
        if layout.slide >= 0:
            sprung = q[:, layout.slide : layout.slide + 3]
            sprung = _turned(back, _turned(helmet_turn, sprung))
            shift = shift + sprung
            displacement = shift
            moment = moment - np.cross(sprung, push)  # it was about the liner's inside
        else:  # the crushed liner in the same sense: the surface pushes the shell inwards
            displacement = shift + _turned(back, rows.crush)
        helmet_position = position + _turned(turn, shift)
        gravity = np.array([0.0, 0.0, -self.setup.gravity])
        zeros = np.zeros((len(q), 3))
        return ImpactRecord(
            time=self._time[first:last],
            # MuJoCo's framelinacc is specific force: inertial acceleration minus gravity.
            head_acceleration=layout.read(sensors, "head_specific_force") + gravity,
            head_angular_acceleration=layout.read(sensors, "head_angular_acceleration"),
            head_velocity=layout.read(sensors, "head_velocity"),
            head_angular_velocity=layout.read(sensors, "head_angular_velocity"),
            head_position=position,
            head_orientation=orientation,
            helmet_position=helmet_position,
            helmet_orientation=helmet_orientation,
            ground_force=_part(helmet_load, FORCE),
            ground_torque=_part(helmet_load, MOMENT),
            ground_friction=_part(helmet_load, FRICTION),
            coupling_force=push,
            coupling_torque=moment,
            coupling_displacement=displacement,
            body_ground_force=_part(rows.surface[:, BODY], FORCE),
            neck_force=layout.read(sensors, "neck_force") if rider else zeros,
            neck_torque=layout.read(sensors, "neck_torque") if rider else zeros,
            joint_names=layout.joints,
            joint_positions=layout.positions(q),
            joint_velocities=v.take(layout.qvel, axis=1),
            setup=MappingProxyType(self.setup.described()),
            extras=MappingProxyType(extras),
        )

    def extras(self) -> dict[str, Any]:
        """Notes, and of a foam helmet the crush map so far: ``crush`` (largest strain of each
        column), ``residual_crush`` [m], ``column_position`` (n, 3) [m] in the helmet frame."""
        suffered = overload(self.neck, self._rows.qpos[: self._done])
        suffered += overloaded(
            self.helmet, self._simulation.forces, self._rows, self._done, self._layout
        )
        extras: dict[str, Any] = {"notes": [*self.notes, *suffered]}
        extras |= self._sampled(0, self._done)
        liner = self._simulation.forces.liner
        if len(liner.largest):
            strains = residual_strains(liner.largest, liner.columns.foam)
            extras |= {
                "crush": liner.largest.copy(),
                "residual_crush": strains * liner.columns.thickness,
                "column_position": liner.columns.point.copy(),
            }
        if liner.measured and len(liner.largest):  # a log must tell the helmet without its file
            columns = liner.columns
            extras |= {
                "column_normal": columns.normal.copy(),
                "column_area": columns.area.copy(),
                "column_thickness": columns.thickness.copy(),
            }
        return extras

    def _sampled(self, first: int, last: int) -> dict[str, FloatArray]:
        """What stands in the extras of a fall's record with a row per sample."""
        if not self._tells_shell:
            return {}
        slide = self._layout.slide
        return {SHELL: self._rows.qpos[first:last, slide : slide + 3].copy()}


def _part(loads: FloatArray, start: int) -> FloatArray:
    part: FloatArray = loads[:, start : start + 3]
    return part


def _turned(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Rotated vectors, shape (n, 3), term by term: a sample has the same bits in a slice of any
    length (``Rotation.apply`` sums a single row in another order)."""
    m = matrices
    x, y, z = (vectors[:, i : i + 1] for i in range(3))
    turned: FloatArray = m[:, :, 0] * x + m[:, :, 1] * y + m[:, :, 2] * z
    return turned
