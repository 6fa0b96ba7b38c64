"""Soft tissue under pressure: it hardens towards its thickness, resists speed, gives little back.

Elastic: F = k d / (1 - d / L), which no force presses together by more than its thickness L; close
to L it goes on as a straight line, as steep as a step resolves. Times 1 + c d' within 0 and
``FAST``: so a rebound is slower than 1 / c whatever the impact, and damping never pulls.
"""

from __future__ import annotations

import math

from helmet_sim_ros.model.compiled import inlined

#: Fast over slow stiffness. Dynamic over static: 2.7 for the thorax (Lobdell et al. 1973, general),
#: 1.4 for cervical joints (Voo et al. 1998); a choice between.
FAST = 2.0
RESOLVES = 0.7  # of the square root of mass over stiffness, that a step may be; choice


@inlined
def elastic_force(stiffness: float, thickness: float, straight: float, depth: float) -> float:
    """Force [N] of tissue pressed slowly by ``depth`` [m].

    Args:
        stiffness: of the first contact [N/m].
        thickness: [m]; infinite: a linear spring.
        straight: share of the thickness beyond which the law is a straight line, below 1.
    """
    share = depth / thickness
    if share <= straight:
        return stiffness * depth / (1.0 - share)
    over = depth - straight * thickness
    return stiffness / (1.0 - straight) * (straight * thickness + over / (1.0 - straight))


@inlined
def elastic_energy(stiffness: float, thickness: float, straight: float, depth: float) -> float:
    """Integral of :func:`elastic_force` [J]."""
    if thickness == math.inf:
        return 0.5 * stiffness * depth * depth
    share = min(depth / thickness, straight)
    energy: float = stiffness * thickness * thickness * (-share - math.log(1.0 - share))
    over = depth - straight * thickness
    if over > 0.0:
        energy += (
            stiffness / (1.0 - straight) * over
            * (straight * thickness + 0.5 * over / (1.0 - straight))
        )  # fmt: skip
    return energy


@inlined
def resisting(elastic: float, damping: float, rate: float, step: float, mass: float) -> float:
    """Force [N] (torque [N m]) of a damped elastic one, ``elastic`` (1 + c d'), within 0 and
    ``FAST`` times it; implicit in the damping, so that it brakes a light part but never shakes it.

    Args:
        elastic: [N], 0 or more.
        damping: c [s/m].
        rate: of the deflection [m/s].
        step: time step [s].
        mass: that moves least against the force [kg]; of a joint, its inertia [kg m^2].
    """
    eased = damping / (1.0 + damping * elastic * step / mass)
    return elastic * min(FAST, max(0.0, 1.0 + eased * rate))


@inlined
def resolving_step(
    stiffness: float, thickness: float, straight: float, depth: float, mass: float
) -> float:
    """The step [s] that resolves tissue pressed by ``depth`` [m] in front of a mass [kg]; see
    :func:`elastic_force`."""
    softer = 1.0 - min(depth / thickness, straight)
    longest: float = RESOLVES * softer * (mass / stiffness) ** 0.5
    return longest
