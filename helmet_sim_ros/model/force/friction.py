"""The laws of a contact: a stiff normal force, and Coulomb friction that sticks elastically.

Normal force: F_n = k d (1 + c d'), never negative (Hunt & Crossley, J. Appl. Mech. 42, 1975).
Friction: an elastic tangential deflection s with F_t = -k_t (s + tau s'), limited to mu F_n by
letting s slip (Cundall & Strack, Geotechnique 29, 1979), so |F_t| / F_n never exceeds mu.
"""

from __future__ import annotations

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import inlined
from helmet_sim_ros.model.force.vector import Vec

TANGENTIAL_SHARE = 0.8  # k_t / k; Mindlin: 2 (1 - nu) / (2 - nu), 0.82 for nu = 0.3
RELAXATION = 5e-5  # s, tau: damps the stick oscillation of a light shell


@inlined
def normal_force(stiffness: float, damping: float, depth: float, rate: float) -> float:
    """F_n = k d (1 + c d') [N] for depth d [m] and its rate d' [m/s]; 0 without contact."""
    if depth <= 0.0:
        return 0.0
    return max(0.0, stiffness * depth * (1.0 + damping * rate))


@inlined
def friction_force(
    stiffness: float,
    relaxation: float,
    limit: float,
    slip: Vec,
    normal: Vec,
    step: float,
    stick: FloatArray,
) -> Vec:
    """Friction [N] for a slip velocity [m/s]; updates the stick deflection.

    Args:
        stiffness: tangential stiffness k_t [N/m].
        relaxation: tau [s], damping over stiffness.
        limit: mu F_n [N].
        slip: velocity across the normal [m/s].
        normal: of the contact, unit vector; the deflection turns with it.
        step: time step [s].
        stick: elastic deflection, shape (3,) [m]; changed in place.
    """
    nx, ny, nz = normal
    off = stick[0] * nx + stick[1] * ny + stick[2] * nz
    sx = stick[0] - off * nx + slip[0] * step
    sy = stick[1] - off * ny + slip[1] * step
    sz = stick[2] - off * nz + slip[2] * step
    x = stiffness * (sx + relaxation * slip[0])
    y = stiffness * (sy + relaxation * slip[1])
    z = stiffness * (sz + relaxation * slip[2])
    trial = (x * x + y * y + z * z) ** 0.5
    if trial > limit:  # slips: the deflection follows so that the force stays on the limit
        scale = limit / trial
        x *= scale
        y *= scale
        z *= scale
        over = 1.0 / stiffness
        sx = x * over - relaxation * slip[0]
        sy = y * over - relaxation * slip[1]
        sz = z * over - relaxation * slip[2]
        length = (sx * sx + sy * sy + sz * sz) ** 0.5
        if length * stiffness > limit:
            shrink = limit / (length * stiffness)
            sx *= shrink
            sy *= shrink
            sz *= shrink
    stick[0] = sx
    stick[1] = sy
    stick[2] = sz
    return -x, -y, -z


@inlined
def yielding_force(
    stiffness: float,
    hardening: float,
    limit: float,
    slip: Vec,
    normal: Vec,
    step: float,
    ahead: float,
    sheared: FloatArray,
) -> Vec:
    """Friction [N] through a layer that yields in shear and hardens with its plastic path.

    The elastic deflection carries at most ``hardening`` times the plastic path so far, and never
    more than friction: what a layer has taken up it does not give back but for the elastic part
    (isotropic linear hardening with radial return, Simo & Hughes, Computational Inelasticity,
    1998, sec. 3.2).

    Args:
        stiffness: elastic, of the layer in shear [N/m].
        hardening: secant stiffness of the plastic path [N/m].
        limit: mu F_n [N].
        slip: velocity across the normal [m/s].
        normal: of the contact, unit vector.
        step: time step [s].
        ahead: by how long the slip is ahead of the path [s], see ``Motion.ahead``.
        sheared: elastic deflection (3) and plastic path, shape (4,) [m]; changed in place.
    """
    nx, ny, nz = normal
    off = sheared[0] * nx + sheared[1] * ny + sheared[2] * nz
    sx = sheared[0] - off * nx + slip[0] * (step - ahead)
    sy = sheared[1] - off * ny + slip[1] * (step - ahead)
    sz = sheared[2] - off * nz + slip[2] * (step - ahead)
    trial = stiffness * (sx * sx + sy * sy + sz * sz) ** 0.5
    bound = hardening * sheared[3]
    if trial > bound and bound < limit:
        sheared[3] += (trial - bound) / (stiffness + hardening)
        bound = hardening * sheared[3]
    bound = min(bound, limit)
    if trial > bound:
        shrink = bound / trial
        sx *= shrink
        sy *= shrink
        sz *= shrink
    sheared[0] = sx + slip[0] * ahead
    sheared[1] = sy + slip[1] * ahead
    sheared[2] = sz + slip[2] * ahead
    return -stiffness * sx, -stiffness * sy, -stiffness * sz
