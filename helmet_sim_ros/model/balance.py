"""Momentum and energy of a recorded impact, recomputed from its samples: checks on the solver."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.force import fit, spring
from helmet_sim_ros.model.force.bodies import FORCE, FRICTION, HELMET, motion_of, no_loads
from helmet_sim_ros.model.force.contact import elastic_energy
from helmet_sim_ros.model.force.friction import TANGENTIAL_SHARE
from helmet_sim_ros.model.force.neck import stored_energy
from helmet_sim_ros.model.impact import Impact


@dataclass(frozen=True)
class Balance:
    """Histories over the samples of one impact.

    Attributes:
        momentum: of the whole system, world axes, shape (n, 3) [N s].
        impulse: integral of ground forces and gravity since the first sample, (n, 3) [N s].
        kinetic: [J], (n,).
        potential: gravity, joint springs and neck [J], (n,).
        coupling: what the coupling spring would still give back [J], (n,); 0 for a foam liner,
            whose small elastic share is not counted.
        fit: what padding, chin strap and their friction hold [J], (n,); see
            :func:`helmet_sim_ros.model.force.fit.held_energy`.
        contact: elastic energy of the ground contacts [J], (n,); of the friction's stick
            deflection only the helmet's, from its force.
    """

    momentum: FloatArray
    impulse: FloatArray
    kinetic: FloatArray
    potential: FloatArray
    coupling: FloatArray
    fit: FloatArray
    contact: FloatArray

    @property
    def momentum_error(self) -> float:
        """Largest |change of momentum - impulse| over the largest |change of momentum| [-]."""
        change = self.momentum - self.momentum[0]
        error = np.linalg.norm(change - self.impulse, axis=1).max()
        return float(error / np.linalg.norm(change, axis=1).max())

    @property
    def mechanical(self) -> FloatArray:
        """Kinetic, potential and every recoverable energy [J], (n,)."""
        return self.kinetic + self.potential + self.coupling + self.fit + self.contact

    @property
    def energy_growth(self) -> float:
        """Largest rise of the mechanical energy above its lowest value so far, over the initial
        kinetic energy [-]."""
        energy = self.mechanical
        return float((energy - np.minimum.accumulate(energy)).max() / self.kinetic[0])


def balance(impact: Impact) -> Balance:
    """Momentum and energy of the finished samples of an impact."""
    model, record = impact.model, impact.record()
    data = mujoco.MjData(model)
    n = len(record)
    momentum, kinetic, potential = np.zeros((n, 3)), np.zeros(n), np.zeros(n)
    contact, held = np.zeros(n), np.zeros(n)
    mass = float(model.body_subtreemass[1])
    motion, touching = motion_of(data), impact.contact.fresh(len(impact.surface.kind))
    fitted, sprung, loads = impact.fresh_fit(), impact.fresh_spring(), no_loads(model)
    slide, stored, has_spring = impact.layout.slide, np.zeros(n), impact.helmet.coupling == "spring"
    for i, (position, velocity) in enumerate(impact.states()):
        data.qpos[:], data.qvel[:] = position, velocity
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        momentum[i] = mass * data.subtree_linvel[1]
        potential[i], kinetic[i] = data.energy
        contact[i] = elastic_energy(touching, impact.surface, motion)
        fit.apply(fitted, record.time_step, motion, loads)  # carries the padding's state on
        held[i] = fit.held_energy(fitted, position)
        if has_spring:
            loads.surface[HELMET, FORCE : FORCE + 3] = record.ground_force[i]
            loads.surface[HELMET, FRICTION : FRICTION + 3] = record.ground_friction[i]
            spring.apply(sprung, record.time_step, motion, loads)
            stored[i] = spring.recoverable_energy(sprung, position[slide : slide + 3])
    potential += stored_energy(impact.neck, np.array([q for q, _ in impact.states()]))
    force = record.ground_force + record.body_ground_force + mass * model.opt.gravity
    steps = 0.5 * (force[1:] + force[:-1]) * record.time_step
    impulse = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    if has_spring:
        friction = np.linalg.norm(record.ground_friction, axis=1)
        contact += 0.5 * friction**2 / (TANGENTIAL_SHARE * impact.helmet.shell.contact_stiffness)
    return Balance(momentum, impulse, kinetic, potential, stored, held, contact)
