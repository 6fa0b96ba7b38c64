"""Mechanical energy of the present state: kinetic, potential, and all that forces hold elastically.

Of a foam liner nothing is counted: what it gives back is small.
"""

from __future__ import annotations

from helmet_sim_ros.model.compiled import compiled
from helmet_sim_ros.model.force import contact, fit, neck, self_contact, spring, stops
from helmet_sim_ros.model.force.bodies import Motion
from helmet_sim_ros.model.loop import Engine, Forces, energy_vel, mujoco_function

_energy_pos = mujoco_function("mj_energyPos")


@compiled
def mechanical_energy(engine: Engine, forces: Forces, motion: Motion) -> float:
    """[J], just after the forces were applied in this state."""
    _energy_pos(engine.model, engine.data)
    energy_vel(engine.model, engine.data)
    qpos = motion.qpos
    energy: float = engine.energy[0] + engine.energy[1] + held_elastically(forces, motion)
    if forces.spring.slide >= 0:
        slide = forces.spring.slide
        energy += spring.recoverable_energy(forces.spring, qpos[slide : slide + 3])
    return energy


@compiled
def held_elastically(forces: Forces, motion: Motion) -> float:
    """What joints, tissue, contacts and padding would give back [J]."""
    qpos = motion.qpos
    return float(
        stops.stored_energy(forces.stops, qpos)
        + neck.held_energy(forces.neck, qpos)
        + contact.elastic_energy(forces.contact, forces.surface, motion)
        + contact.stick_energy(forces.contact)
        + fit.held_energy(forces.fit, qpos)
        + self_contact.stored_energy(forces.own, motion)
    )
