"""Drop tests: the peaks and energies of a headform drop on a flat anvil."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.force import fit
from helmet_sim_ros.model.force.columns import liner_rows
from helmet_sim_ros.model.force.foam import bottoming_strain
from helmet_sim_ros.model.head_surface import HeadSurface
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.identified import SIDES
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.study.scenario.matrix import load_scenario

#: Zone of the helmet that each striking part belongs to.
ZONES = {
    "front": "front",
    "back": "back",
    "left": "side",
    "right": "side",
    "side": "side",
    "top": "top",
}


@dataclass(frozen=True)
class DropTest:
    """One drop test.

    Attributes:
        direction: front, back, side or top.
        normal_velocity: impact speed [m/s].
        peak_force: of the anvil on the helmet [N].
        peak_compression: largest approach of the headform to the anvil after the first touch [m]:
            liner and shell together, what a laboratory integrates from the acceleration.
        peak_g: resultant head acceleration [g]; nan where not measured.
        hic: unlimited window [-]; nan where not measured.
        restitution: rebound over impact speed [-]; nan where not measured.
        energy_loss: share of the loading energy not given back [-]; nan where not measured.
        bottomed: whether the liner was crushed beyond its plateau; None where not known.
        source: where it comes from (a file and row, or the simulated helmet).
    """

    direction: str
    normal_velocity: float
    peak_force: float
    peak_compression: float
    peak_g: float = float("nan")
    hic: float = float("nan")
    restitution: float = float("nan")
    energy_loss: float = float("nan")
    bottomed: bool | None = None
    source: str = ""


def approach(record: ImpactRecord) -> FloatArray:
    """Approach of the head to the anvil since the first touch, shape (n,) [m]."""
    height = record.head_position[:, 2]
    distance: FloatArray = height[0] - height
    return distance


def loop_energy_loss(force: FloatArray, compression: FloatArray) -> float:
    """Share of the loading energy that a force-compression loop does not give back [-].

    Args:
        force, compression: histories of one impact, shape (n,) [N], [m].

    Returns:
        NaN for what is no loop: no work is done up to the largest compression.
    """
    turn = int(np.argmax(compression)) + 1
    loaded = trapezoid(force[:turn], compression[:turn])
    returned = -trapezoid(force[turn - 1 :], compression[turn - 1 :])
    return float(1.0 - returned / loaded) if loaded > 0.0 else float("nan")


@dataclass(frozen=True)
class SimulatedDrop:
    """A simulated drop: its setup, what was measured, and its force-compression loop.

    Attributes:
        loop: side, speed [m/s], approach of the head (n,) [m], force of the anvil (n,) [N].
    """

    setup: ImpactSetup
    test: DropTest
    loop: tuple[str, float, FloatArray, FloatArray]


def simulated_drops(speeds: Sequence[float] = (), **common: object) -> list[SimulatedDrop]:
    """Simulate the scenario ``drop_tests``.

    Args:
        speeds: other impact speeds than the scenario's [m/s].
        **common: see :func:`helmet_sim_ros.study.load_scenario`.
    """
    setups = list(load_scenario("drop_tests", **common).setups)
    if speeds:
        by_direction = {setup.direction: setup for setup in setups}
        setups = [
            s.replaced({"normal_velocity": float(v)})
            for s in by_direction.values() for v in sorted(speeds)
        ]  # fmt: skip
    return [_simulated(setup) for setup in setups]


def _simulated(setup: ImpactSetup) -> SimulatedDrop:
    record = simulate(setup)
    test = measure(record, setup)
    compression, force = approach(record), record.ground_force[:, 2]
    end = int(np.flatnonzero(force > 0.0)[-1]) + 2  # up to the loss of contact
    return SimulatedDrop(
        setup, test, (test.direction, test.normal_velocity, compression[:end], force[:end])
    )


def drop_test(setup: ImpactSetup) -> DropTest:
    """Simulate one drop and measure it.

    Raises:
        SetupError: the setup is no drop of a headform.
    """
    if setup.rig != "headform" or setup.tangential_velocity:
        raise SetupError.of("impact.rig", setup.rig, "must be headform, without tangential speed")
    return measure(simulate(setup), setup)


def measure(record: ImpactRecord, setup: ImpactSetup) -> DropTest:
    """The peaks of a recorded drop."""
    force, compression = record.ground_force[:, 2], approach(record)
    zone, liner = ZONES[setup.direction], setup.helmet_config.liner
    limit = bottoming_strain(liner_rows(liner, np.array([liner.zone_density(zone)]))[0])
    strain = _crush(record, setup, zone) / liner.zone_thickness(zone)
    result = evaluate(record)
    return DropTest(
        direction=zone,
        normal_velocity=setup.normal_velocity,
        peak_force=float(force.max()),
        peak_compression=float(compression.max()),
        peak_g=float(result.peak_g),
        hic=float(result.hic),
        restitution=max(0.0, float(record.head_velocity[:, 2].max())) / setup.normal_velocity,
        energy_loss=loop_energy_loss(force, compression),
        bottomed=strain > limit,
        source=setup.helmet,
    )


def padding_stroke(helmet: Helmet, side: str, force: FloatArray) -> FloatArray:
    """How far forces [N], (n,), press the head into the padding on one side, (n,) [m]."""
    sitting = fit.fit(helmet, HeadSurface(friction=0.0), 0, 0)  # pressed straight: nothing slides
    axis = np.array(SIDES[side])
    return np.array([fit.approach(sitting, axis, float(f)) for f in force])


def _crush(record: ImpactRecord, setup: ImpactSetup, zone: str) -> float:
    """Largest crush of the liner [m]: the displacement of the shell less the padding's."""
    displacement = np.linalg.norm(record.coupling_displacement, axis=1).max()
    peak = record.ground_force[:, 2].max(keepdims=True)
    return float(displacement - padding_stroke(setup.helmet_config, zone, peak)[0])
