"""Crushable EPS foam: stress over strain and density, with a memory of the largest strain.

Loading: elastic rise to the dynamic yield stress, then a plateau that stiffens as the cell gas is
compressed and the walls meet (Gibson & Ashby, Cellular Solids, 2nd ed. 1997, ch. 5; used for
helmet liners by Mills, Polymer Foams Handbook, 2007, ch. 16)::

    s = min(E e, s_y) + p0 e / (1 - r - e)

with p0 the atmospheric pressure and r = density / 1050 kg/m^3 the relative density of EPS.
Yield stress and modulus follow powers of the density. Unloading from the largest strain is a
straight line that returns a stated share of the loading energy; the rest of the strain stays.

All stresses follow a power of the strain rate, s = s(``RATE``) (rate / ``RATE``)^m. Impact tests
of foams are told by the rate at which they start, and so are the constants here: the rate that
counts is the fastest of a contact, which in an impact is that of the first touch.

A foam that was tested has a table of its loading path instead, in the same row behind the
constants: stresses at equally spaced strains, and the energies up to them.
"""

from __future__ import annotations

import math

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.compiled import allocating, compiled
from helmet_sim_ros.model.foams import POINTS, Foam

SOLID_DENSITY = 1050.0  # kg/m^3, polystyrene (Gibson & Ashby, table 3.1)
GAS_PRESSURE = 101_325.0  # Pa, cell gas at the start
#: Dynamic yield stress [Pa] at 40 kg/m^3 and exponent of density: through 0.30-0.45 MPa at 40,
#: 0.60-0.70 at 62 and 0.90 at 80 kg/m^3 (general literature values).
YIELD_AT_40 = 0.42e6
YIELD_EXPONENT = 1.10
#: Young's modulus [Pa] at 40 kg/m^3: 3.5 % strain at yield (general literature value: 3 to 5 %).
MODULUS_AT_40 = 12.0e6
#: Strain rate that the constants stand for [1/s]: 5 m/s start 44 mm of liner at 114.
RATE = 100.0
#: Power of the rate that stresses follow, 5 % per decade. Derived here: a dynamic yield stress of
#: 0.375 MPa at 40 kg/m^3 (general) over the static table of ``config/references/eps.yaml``, brought
#: to that density, gives 7 and 5 % per decade at 5 and 10 % strain, and less by the 10 to 15 % that
#: typical foam exceeds the table's minima; solid polystyrene yields 5 to 8 % higher per decade
#: (general literature value).
RATE_EXPONENT = 0.021
POISSON = 0.1  # EPS (general literature value): G = E / (2 (1 + nu))
SLOWEST = 1e-3  # 1/s, of compression tests; slower is as slow
#: Share of the densification strain 1 - r beyond which the law goes on as a straight line.
LINEAR_FROM = 0.95

#: Columns of a foam row: yield stress [Pa], modulus [Pa], gas pressure [Pa], densification strain
#: [-], share of the energy returned [-], power of the strain rate [-].
YIELD, MODULUS, GAS, LIMIT, RETURNED, POWER = range(6)
CONSTANTS = 6


def foam_row(density: float, energy_returned: float) -> FloatArray:
    """Constants of EPS of a density [kg/m^3], shape (6,)."""
    row: FloatArray = foam_rows(np.array([density]), energy_returned)[0]
    return row


def foam_rows(density: FloatArray, energy_returned: float) -> FloatArray:
    """Constants of EPS of each density, shape (n,) [kg/m^3]; shape (n, 6)."""
    scale = (density / 40.0) ** YIELD_EXPONENT
    rows = np.empty((len(density), CONSTANTS))
    rows[:, YIELD] = YIELD_AT_40 * scale
    rows[:, MODULUS] = MODULUS_AT_40 * scale
    rows[:, GAS] = GAS_PRESSURE
    rows[:, LIMIT] = 1.0 - density / SOLID_DENSITY
    rows[:, RETURNED] = energy_returned
    rows[:, POWER] = RATE_EXPONENT
    return rows


def rows_of(foam: Foam, density: FloatArray, energy_returned: float) -> FloatArray:
    """Constants of a foam at each density, shape (n,) [kg/m^3]; (n, 6), with its table (n, 134)."""

    def or_eps(value: float | None, of_eps: float) -> float:
        return of_eps if value is None else value

    power = or_eps(foam.rate_exponent, RATE_EXPONENT)
    scale = (density / foam.density) ** or_eps(foam.yield_exponent, YIELD_EXPONENT)
    scale = scale * (RATE / foam.rate) ** power
    yielding = or_eps(foam.yield_stress, YIELD_AT_40)
    if foam.stress is not None and foam.limit is not None:
        table, limit = np.array(foam.stress), foam.limit
        scales, which = np.unique(scale, return_inverse=True)
        made = [table_row(s * table, limit, s * yielding, energy_returned, power) for s in scales]
        return np.array(made)[which]
    rows = np.empty((len(density), CONSTANTS))
    rows[:, YIELD] = yielding * scale
    rows[:, MODULUS] = or_eps(foam.modulus, MODULUS_AT_40) * scale
    rows[:, GAS] = or_eps(foam.gas_pressure, GAS_PRESSURE)
    rows[:, LIMIT] = 1.0 - density / or_eps(foam.solid_density, SOLID_DENSITY)
    rows[:, RETURNED] = energy_returned
    rows[:, POWER] = power
    return rows


def table_row(
    stress: FloatArray,
    limit: float,
    yield_stress: float,
    energy_returned: float,
    rate_exponent: float = RATE_EXPONENT,
) -> FloatArray:
    """Constants and table of a tested foam, shape (6 + 2 ``POINTS``,).

    Args:
        stress: at ``POINTS`` equally spaced strains from 0 to ``limit``, rising [Pa].
        limit: the last strain.
        yield_stress: of the plateau [Pa].
        energy_returned: share of the loading energy that unloading gives back.
        rate_exponent: power of the strain rate.
    """
    spacing = limit / (POINTS - 1)
    energy = np.concatenate([[0.0], np.cumsum(0.5 * spacing * (stress[1:] + stress[:-1]))])
    modulus = float(np.max(np.diff(stress)[: POINTS // 4]) / spacing)
    constants = np.array([yield_stress, modulus, 0.0, limit, energy_returned, rate_exponent])
    return np.concatenate([constants, stress, energy])


def in_series(outer: FloatArray, inner: FloatArray, share: float) -> FloatArray:
    """Tables of two layers on each other, which bear the same stress while their strains add.

    Args:
        outer: a row for each column, (n, 6) or (n, 134).
        inner: of the inner layer, (6,) or (134,).
        share: of the thickness that is the inner layer.

    Returns:
        rows with tables, (n, 134).
    """
    inner_strain, inner_stress = _path(inner)
    made: dict[bytes, FloatArray] = {}
    for row in outer:
        key = row.tobytes()
        if key in made:
            continue
        strain, stress = _path(row)
        common = np.union1d(stress, inner_stress)
        common = common[common <= min(stress[-1], inner_stress[-1])]
        both = (1.0 - share) * np.interp(common, stress, strain)
        both += share * np.interp(common, inner_stress, inner_strain)
        limit = float(both[-1])
        table = np.interp(np.linspace(0.0, limit, POINTS), both, common)
        softer = min(float(row[YIELD]), float(inner[YIELD]))
        made[key] = table_row(table, limit, softer, float(row[RETURNED]), float(row[POWER]))
    return np.array([made[row.tobytes()] for row in outer])


def _path(row: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The loading path of a row as points, strains and stresses; the yield point is one of them."""
    strain = np.linspace(0.0, LINEAR_FROM * row[LIMIT], 400)
    if len(row) == CONSTANTS:
        strain = np.union1d(strain, [row[YIELD] / row[MODULUS]])
    return strain, loading_stresses(strain, row)


def bottoming_strain(foam: FloatArray) -> float:
    """Strain at which compressed gas and touching walls have doubled the yield stress.

    From there the liner stiffens steeply: an impact that goes beyond has bottomed it out.
    """
    if len(foam) > CONSTANTS:
        stress = foam[CONSTANTS : CONSTANTS + POINTS]
        return float(np.interp(2.0 * foam[YIELD], stress, np.linspace(0.0, foam[LIMIT], POINTS)))
    return float(foam[LIMIT] * foam[YIELD] / (foam[GAS] + foam[YIELD]))


@compiled
def place_in_table(strain: float, limit: float) -> tuple[int, float, float]:
    """Interval of a table that holds a strain (the last one: all beyond), the way into it, and
    the spacing."""
    spacing = limit / (POINTS - 1)
    i = min(max(int(strain / spacing), 0), POINTS - 2)
    return i, strain - i * spacing, spacing


@compiled
def table_stress(strain: float, foam: FloatArray) -> float:
    """:func:`loading_stress` of a row with a table."""
    i, way, spacing = place_in_table(strain, foam[LIMIT])
    start = foam[CONSTANTS + i]
    stress: float = start + (foam[CONSTANTS + i + 1] - start) * (way / spacing)
    return stress


@compiled
def table_energy(strain: float, foam: FloatArray) -> float:
    """Energy per volume [J/m^3] from strain 0 on the loading path of a row with a table."""
    i, way, _ = place_in_table(strain, foam[LIMIT])
    mean = 0.5 * (foam[CONSTANTS + i] + table_stress(strain, foam))
    energy: float = foam[CONSTANTS + POINTS + i] + way * mean
    return energy


@compiled
def rate_factor(rate: float, foam: FloatArray) -> float:
    """Stress at a strain rate [1/s] over that at ``RATE`` [-]."""
    return math.exp(foam[POWER] * math.log(max(rate, SLOWEST) / RATE))


@compiled
def loading_stress(strain: float, foam: FloatArray) -> float:
    """Stress [Pa] on the loading path."""
    if len(foam) > CONSTANTS:
        return table_stress(strain, foam)
    edge = LINEAR_FROM * foam[LIMIT]
    e = min(strain, edge)
    stress: float = min(foam[MODULUS] * e, foam[YIELD]) + foam[GAS] * e / (foam[LIMIT] - e)
    if strain > edge:
        slope = foam[GAS] * foam[LIMIT] / (foam[LIMIT] - edge) ** 2
        stress += slope * (strain - edge)
    return stress


@allocating
def loading_stresses(strain: FloatArray, foam: FloatArray) -> FloatArray:
    """:func:`loading_stress` at each strain, (n,)."""
    stress = np.empty(len(strain))
    for i in range(len(strain)):
        stress[i] = loading_stress(strain[i], foam)
    return stress


@compiled
def energy_between(low: float, high: float, foam: FloatArray) -> float:
    """Energy per volume [J/m^3] on the loading path from one strain to a higher one, the integral
    of :func:`loading_stress`."""
    if len(foam) > CONSTANTS:
        return table_energy(high, foam) - table_energy(low, foam)
    edge = LINEAR_FROM * foam[LIMIT]
    start, end = min(low, edge), min(high, edge)
    at_yield = foam[YIELD] / foam[MODULUS]
    from_, to = min(start, at_yield), min(end, at_yield)
    energy: float = 0.5 * foam[MODULUS] * (to * to - from_ * from_)
    energy += foam[YIELD] * (end - start - to + from_)
    narrowed = (foam[LIMIT] - end) / (foam[LIMIT] - start)
    energy += foam[GAS] * (start - end - foam[LIMIT] * math.log(narrowed))
    if high > edge:
        low = max(low, edge)
        energy += 0.5 * (loading_stress(low, foam) + loading_stress(high, foam)) * (high - low)
    return energy


@compiled
def residual_strain(largest: float, foam: FloatArray) -> float:
    """Strain that stays after unloading from ``largest``."""
    if largest <= foam[YIELD] / foam[MODULUS] * 1e-3:
        return 0.0
    width: float = (
        2.0 * foam[RETURNED] * energy_between(0.0, largest, foam) / loading_stress(largest, foam)
    )
    return max(0.0, largest - width)


@allocating
def residual_strains(largest: FloatArray, foam: FloatArray) -> FloatArray:
    """:func:`residual_strain` of each column, shape (n,), of the strains (n,) and rows (n, 6)."""
    rest = np.empty(len(largest))
    for i in range(len(largest)):
        rest[i] = residual_strain(largest[i], foam[i])
    return rest


@compiled
def unloading_stress(strain: float, largest: float, rest: float, foam: FloatArray) -> float:
    """Stress [Pa] at a strain below ``largest``, whose :func:`residual_strain` is ``rest``."""
    if strain <= rest:
        return 0.0
    return loading_stress(largest, foam) * (strain - rest) / (largest - rest)


@compiled
def mean_over_point(low: float, high: float, foam: FloatArray) -> float:
    """Loading stress averaged over strains ``low`` to ``high``, over that at their middle [-]."""
    if high - low < 1e-6:
        return 1.0
    mean = energy_between(low, high, foam) / (high - low)
    return mean / loading_stress(0.5 * (low + high), foam)
