"""A whole fall: long steps where nothing happens, those of an impact where the head strikes.

The scheme is that of :mod:`helmet_sim_ros.model.loop`, for steps that change: velocities are those
of half a step ago, so that positions are accurate to second order (leapfrog). In flight, and where
a sample of long steps is written, they are brought to the time of the positions and on from there.
Longer steps do not resolve the quick motion of the stiff joints between head, liner and shell: they
add to the inertia there what h^2 K has beyond a share of it, which slows it down, and, where a
strike has loaded them, solve (M + h D + h^2 K) a = F - h K v, which also damps it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import DENSE, FloatArray
from helmet_sim_ros.errors import DivergedError
from helmet_sim_ros.model.compiled import compiled, inlined
from helmet_sim_ros.model.energy import mechanical_energy
from helmet_sim_ros.model.fall.flight import Flight, begin, correct, on_ground
from helmet_sim_ros.model.fall.pace import TINY, Limits, Pace, wanted
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.model.force import liner, shell
from helmet_sim_ros.model.force.bodies import (
    FORCE,
    HELMET,
    Loads,
    Motion,
    add_generalised,
    clear,
)
from helmet_sim_ros.model.force.fit import ELASTIC, Fit
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.loop import (
    WATCHED,
    Engine,
    Forces,
    Rows,
    Simulation,
    acceleration_,
    com_pos,
    energy_vel,
    factor_m,
    fast_forces,
    has_foam,
    integrate_pos,
    kinematics,
    make_m,
    mujoco_function,
    sample,
    slow_forces,
    velocity_,
)
from helmet_sim_ros.model.rest import AtRest
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.surface.carrier import carry
from helmet_sim_ros.model.surface.compiled import Surface

_com_vel = mujoco_function("mj_comVel")

THIN = 2e-3  # s between samples where the head does not strike; choice
LOOKS = 8  # fine steps from one look ahead to the next; choice
ROWS = 4096  # rows at first; doubled when they are full
ROUNDING = 1e-9  # s, of the sum of all steps
PIECE = 1e-4  # s, steps of what moves and gives way around the rider
RELEASED = 0.05  # s, in which spring and padding let go after a strike; choice
STILL_SPEED = 0.005  # m/s, of the whole rider (root mean square), below which he is at rest; choice
STILL = 0.1  # s, for how long he is before the fall ends; choice
#: Times the first stiffness of padding and spring: what long steps assume, and what more where a
#: strike has loaded them. Choices: 1.5 and 0 diverged in 3 of 24 falls, 1.5 and 10 in none.
PADDED, HELD = 1.5, 10.0
#: Of an inertia, h^2 K that a step follows without adding to it (choice; leapfrog: below 4).
RESOLVED = 0.5


class Progress(NamedTuple):
    """Where a fall is; state, one number each.

    Attributes:
        time: [s]; ``due``: of the next thin sample [s].
        fine_until: time up to which steps are fine [s].
        step: steps since the fine ones began, or -1: they are long.
        struck: force on the helmet, or in its spring, in the last step [N].
        before: the last step [s].
        moved: when anything last moved [s].
        taken: number of fine, short and long steps, (3,).
    """

    time: FloatArray
    due: FloatArray
    fine_until: FloatArray
    step: NDArray[np.int64]
    struck: FloatArray
    before: FloatArray
    moved: FloatArray
    taken: NDArray[np.int64]


class Log(NamedTuple):
    """Samples and what belongs to each.

    Attributes:
        rows: see :class:`Rows`.
        time: [s]; ``dense``: whether it is of fine steps; ``energy`` [J], (n,), or no rows.
    """

    rows: Rows
    time: FloatArray
    dense: NDArray[np.bool_]
    energy: FloatArray


class Course(NamedTuple):
    """What stepping a fall needs beside the simulation.

    Attributes:
        pace: how long steps may be.
        flight: what the present flight began with; state.
        progress: where the fall is; state.
    """

    pace: Pace
    flight: Flight
    progress: Progress


@compiled
def apply_forces(forces: Forces, step: float, motion: Motion, loads: Loads) -> None:
    """Every force of the model in the present state, in the order of the stepping loop."""
    clear(loads)
    slow_forces(forces, step, motion, loads)
    bends = shell.spreads(forces.shell, forces.surface)
    fast_forces(forces, has_foam(forces), bends, step, motion, loads)


@compiled
def acts(surface: FloatArray) -> bool:
    """Whether there is any force among rows of ``Loads.surface``, (n, 9)."""
    total = 0.0
    for load in surface.flat:
        total += abs(load)
    return total > 0.0


@inlined
def firmness(pace: Pace, fit: Fit) -> float:
    """How many times stiffer than long steps assume the padding is at most, as it is pressed."""
    if fit.slide_velocity < 0:
        return 1.0
    firm: float = fit.pressing[0] / (ELASTIC * pace.stiffness[fit.slide_velocity])
    return max(1.0, firm)


@compiled
def accelerate(simulation: Simulation, pace: Pace, step: float, kick: float, pressed: bool) -> bool:
    """Accelerations of the next step under the present forces; False: they are not finite.

    A short step after a long one is still a long time for the velocities.

    Args:
        step: the next one [s].
        kick: for how long they act on the velocities [s].
        pressed: whether the helmet was struck a short time ago, or is pressed.
    """
    engine, motion, loads, forces, _ = simulation
    mass, diagonal = engine.mass, engine.diagonal
    long = max(step, kick)
    for k in range(len(diagonal)):
        mass[diagonal[k]] += kick * pace.damping[k]
    if long > pace.fine + TINY:
        padded, firm = forces.fit.slide_velocity, firmness(pace, forces.fit)
        for k in range(len(diagonal)):
            stiffness = pace.stiffness[k]
            if stiffness == 0.0:
                continue
            if padded <= k < padded + 6:
                stiffness *= firm
            added = kick * long * stiffness
            if pressed:
                mass[diagonal[k]] += added + kick * long * pace.pressed[k]
                loads.generalised[k] -= long * pace.pressed[k] * motion.qvel[k]
            else:
                mass[diagonal[k]] += max(0.0, added - RESOLVED * pace.inertia[k])
    factor_m(engine.model, engine.data)
    acceleration_(engine.model, engine.data)
    return bool(abs(engine.acceleration.sum()) < 1e12)  # false for NaN


@inlined
def push_on(engine: Engine, qvel: FloatArray, time: float) -> None:
    """Let the present accelerations act on the velocities for a time [s]."""
    for k in range(len(qvel)):
        qvel[k] += time * engine.acceleration[k]


@inlined
def length_of(force: FloatArray) -> float:
    """Of a vector, (3,)."""
    return float((force[0] ** 2 + force[1] ** 2 + force[2] ** 2) ** 0.5)


@compiled
def energy_of(simulation: Simulation, late: float) -> float:
    """Mechanical energy of this instant [J], see :mod:`.model.energy`, where the velocities are
    those of ``late`` [s] ago."""
    engine, motion, loads, forces, _ = simulation
    qvel, kept = motion.qvel, loads.generalised  # the loads have done what they are for
    for k in range(len(qvel)):
        kept[k] = qvel[k]
    push_on(engine, qvel, late)
    make_m(engine.model, engine.data)  # the step has added to it
    _com_vel(engine.model, engine.data)
    energy: float = mechanical_energy(engine, forces, motion)
    for k in range(len(qvel)):
        qvel[k] = kept[k]
    return energy


@inlined
def is_held(progress: Progress, flying: bool) -> bool:
    """Whether long steps damp what moves between head and shell: after it was struck."""
    struck = progress.fine_until[0] > 0.0
    return struck and (not flying or progress.time[0] < progress.fine_until[0] + RELEASED)


@inlined
def is_still(pace: Pace, kinetic: float, surface: Surface) -> bool:
    """Whether the rider, of that kinetic energy [J], and what is around him are at rest."""
    moving = 0.0
    for speed in surface.velocity.flat:
        moving += abs(speed)
    return kinetic < pace.still and moving < STILL_SPEED


@inlined
def has_ended(progress: Progress, duration: float) -> bool:
    """Whether the duration [s] is reached, or all has been at rest for long enough."""
    now: float = progress.time[0]
    return now > duration or now - progress.moved[0] > STILL


@compiled
def advance_fall(
    simulation: Simulation, course: Course, log: Log, first: int, last: int, duration: float
) -> int:
    """Step until row ``last`` is reached, or the end (:func:`has_ended`); ``first``: the next row.

    Returns:
        The number of rows, negative less 1 where the state left physics.
    """
    engine, motion, loads, forces, clock = simulation
    pace, flight, progress = course
    model, data = engine.model, engine.data
    time, steps, row = progress.time, progress.step, first
    while row < last and not has_ended(progress, duration):
        flying = flight.since[0] >= 0.0
        kinematics(model, data)
        com_pos(model, data)
        make_m(model, data)
        velocity_(model, data)

        touches = acts(loads.surface[HELMET : HELMET + 1])  # in the last step
        pressed = touches or is_held(progress, flying)
        step = pace.fine
        if time[0] >= progress.fine_until[0] or steps[0] % LOOKS == 0:
            step = wanted(
                pace, forces.contact, forces.liner, forces.surface, motion, engine.acceleration,
                progress.struck[0], pressed,
            )  # fmt: skip
            if step <= pace.fine:
                progress.fine_until[0] = max(progress.fine_until[0], time[0] + pace.limits.after)
        if time[0] < progress.fine_until[0]:
            step = pace.fine
            steps[0] += 1
        else:
            steps[0] = -1
        apply_forces(forces, step, motion, loads)
        add_generalised(motion, loads, engine.chains)
        before = progress.before[0]
        flies = not acts(loads.surface)
        progress.struck[0] = max(
            length_of(loads.surface[HELMET, FORCE : FORCE + 3]), length_of(loads.spring)
        )

        fine = steps[0] >= 0
        kept = time[0] >= progress.due[0]
        if fine:
            kept = steps[0] % pace.substeps == 0
        if kept and (not fine or row % WATCHED == 0):
            energy_vel(model, data)
            since, kinetic = time[0], engine.energy[1]
            if kinetic > clock.energy + since * (clock.power + since * clock.growth):
                return -1 - row
            if fine or flies or not is_still(pace, kinetic, forces.surface):
                progress.moved[0] = since
        late, kick = 0.5 * before, 0.5 * (step + before)
        if not accelerate(simulation, pace, step, kick, pressed):
            return -1 - row
        if flies or (kept and not fine):
            push_on(engine, motion.qvel, late)
            late = 0.0
            _com_vel(model, data)
        if flies and flying:
            correct(flight, motion, time[0])
        elif flies:
            begin(flight, motion, time[0])
        else:
            flight.since[0] = -1.0
        if kept:
            sample(engine, motion, loads, log.rows, row)
            if has_foam(forces):
                liner.crush(forces.liner, forces.surface, motion, log.rows.crush[row])
            log.time[row] = time[0]
            log.dense[row] = fine
            progress.due[0] = time[0] + pace.thin
            if len(log.energy):
                log.energy[row] = energy_of(simulation, late)
            row += 1
        push_on(engine, motion.qvel, late + 0.5 * step)
        integrate_pos(model, motion.qpos.ctypes.data, motion.qvel.ctypes.data, step)
        pieces = max(1, round(step / PIECE))
        for _ in range(pieces):
            carry(forces.surface, step / pieces)
        progress.before[0] = step
        time[0] += step
        progress.taken[0 if fine else 1 if step < 0.9 * pace.limits.free else 2] += 1
    return row


class Falling(Impact):
    """A fall that can be advanced in slices: an impact whose steps follow what happens.

    Attributes:
        total: number of samples: so far while it falls, of all when it is over.
        is_over: whether the duration is reached, or all is at rest.
        dense: first and last (exclusive) samples of each stretch of fine steps, at
            ``setup.time_step``; elsewhere samples are ``thin`` apart or more.
    """

    def __init__(
        self,
        setup: ImpactSetup | Fall,
        crush: FloatArray | None = None,
        helmet: Helmet | None = None,
        *,
        thin: float = THIN,
        energy: bool = False,
        limits: Limits | None = None,
    ) -> None:
        """Args: see :class:`Impact`; ``thin`` [s]; ``energy``: keep the mechanical energy."""
        super().__init__(setup, crush, helmet)
        self._wants_energy = energy
        self._rows = Rows(*(_room(array, 0, ROWS) for array in self._rows))
        self._log = Log(
            self._rows, np.zeros(ROWS), np.zeros(ROWS, dtype=bool), np.zeros(ROWS * energy)
        )
        self._time = self._log.time
        self._course = Course(
            pace_of(self, thin, limits or Limits()), on_ground(self._model, self._data), at_start()
        )
        self.total = 0

    @property
    def is_over(self) -> bool:
        """Whether the duration is reached, or all is at rest."""
        return bool(has_ended(self._course.progress, self.setup.duration + ROUNDING))

    @property
    def dense(self) -> tuple[tuple[int, int], ...]:
        """See :class:`Falling`."""
        fine, time = np.flatnonzero(self._log.dense[: self._done]), self._time
        if not len(fine):
            return ()
        # Fine steps may end and begin again between two thin samples.
        apart = np.diff(time[fine]) > 1.5 * self.setup.time_step
        firsts, lasts = fine[np.r_[True, apart]], fine[np.r_[apart, True]]
        return tuple((int(a), int(b) + 1) for a, b in zip(firsts, lasts, strict=True))

    @property
    def energy(self) -> FloatArray:
        """Mechanical energy of the finished samples [J], (n,), if it was wanted."""
        return self._log.energy[: self._done]

    def advance(self, samples: int) -> int:
        """Step until up to ``samples`` more samples are finished, or the fall is over.

        Returns:
            The number of finished samples.

        Raises:
            DivergedError: the state left physics; earlier samples stay readable.
        """
        last = self._done + samples
        while self._done < last and not self.is_over:
            if self._done == len(self._time):
                self._grow()
            done = advance_fall(
                self._simulation, self._course, self._log, self._done, min(last, len(self._time)),
                self.setup.duration + ROUNDING,
            )  # fmt: skip
            self._done = self.total = done if done >= 0 else -1 - done
            if done < 0:
                raise DivergedError(float(self._course.progress.time[0]), self.setup.described())
        return self._done

    def extras(self) -> dict[str, Any]:
        """See :meth:`Impact.extras`; with ``dense``."""
        return super().extras() | {DENSE: self.dense}

    def run(self) -> None:
        """Step to the end."""
        while not self.is_over:
            self.advance(ROWS)

    def _grow(self) -> None:
        size = 2 * len(self._time)
        self._rows = Rows(*(_room(array, self._done, size) for array in self._rows))
        log = self._log
        self._log = Log(
            self._rows, _room(log.time, self._done, size), _room(log.dense, self._done, size),
            _room(log.energy, self._done, size) if self._wants_energy else log.energy,
        )  # fmt: skip
        self._time = self._log.time


def _room(array: Any, done: int, size: int) -> Any:
    """An array with room for more rows, the first ones kept."""
    larger = np.zeros((size, *array.shape[1:]), dtype=array.dtype)
    larger[:done] = array[:done]
    return larger


def at_start() -> Progress:
    """Of a fall that has not begun."""
    return Progress(
        np.zeros(1), np.zeros(1), np.full(1, -1.0), np.full(1, -1, dtype=np.int64), np.zeros(1),
        np.zeros(1), np.zeros(1), np.zeros(3, dtype=np.int64),
    )  # fmt: skip


def pace_of(fall: Falling, thin: float, limits: Limits) -> Pace:
    """What the choice of the step knows of a fall."""
    model, layout, setup, helmet = fall._model, fall.layout, fall.setup, fall.helmet
    forces, substeps = fall._simulation.forces, fall._simulation.clock.substeps
    stiffness, pressed = np.zeros(model.nv), np.zeros(model.nv)
    if helmet.coupling != "none":
        padding, axes = helmet.padding, np.array(helmet.shell.semi_axes)
        section = np.pi * np.sort(axes)[1:].prod()
        around = section * padding.modulus / padding.thickness
        dof = layout.fit_velocity
        stiffness[dof : dof + 3] = around
        stiffness[dof + 3 : dof + 6] = around * float(np.min(axes)) ** 2
    if layout.slide_velocity >= 0:
        law = forces.spring.law
        slides = slice(layout.slide_velocity, layout.slide_velocity + 3)
        stiffness[slides] = float((law[:, 0] * law[:, 1]).max())
        pressed[slides] = helmet.shell.contact_stiffness / helmet.shell.contact_returned
    pressed += HELD * stiffness
    stiffness *= PADDED
    balls = (forces.neck.qvel[:, None] + np.arange(3)).ravel()
    return Pace(
        setup.time_step / substeps, substeps, thin,
        np.isin(fall.contact.body, [layout.helmet, layout.head]),
        stiffness, pressed, AtRest(model, mujoco.MjData(model)).joint_inertia(),
        model.dof_damping.copy(), np.r_[forces.stops.qvel, balls],
        0.5 * float(model.body_mass.sum()) * STILL_SPEED**2, limits,
    )  # fmt: skip
