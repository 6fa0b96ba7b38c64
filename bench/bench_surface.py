"""Time of the two questions that body and helmet ask of a surface, and of impacts on surfaces.

    python bench/bench_surface.py

For every kind of shape: distance and normal at a point; deepest point of a helmet's shell that
slides through the shape, from a warm start and from none. Then the stepping of one 40 ms impact on
anvils over that on flat ground, at most 1.25 of it: of the rider (left) and of the headform
(top), with either helmet form, and with foam under a shell without bending stiffness.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numba import njit

from helmet_sim_ros import ImpactSetup
from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.surface.compiled import Surface
from helmet_sim_ros.model.surface.config import compile_parts
from helmet_sim_ros.model.surface.deepest import deepest_point
from helmet_sim_ros.model.surface.parts import part_of
from helmet_sim_ros.model.surface.shapes import signed_distance

COUNT = 20_000
ANVILS = ("ground", "kerbstone", "hemisphere", "incline_45")
LIMP = {"helmet.coupling": "foam", "helmet.shell.material.modulus": 0.0}
FORMS: dict[str, dict[str, object]] = {
    "spring": {}, "foam": {"helmet.coupling": "foam"}, "foam, limp shell": LIMP,
}  # fmt: skip
REPEATS = 5
SHELL = (0.13, 0.11, 0.12)  # m
#: Shape and height of its top [m].
SHAPES: dict[str, tuple[dict[str, object], float]] = {
    "half_space": ({}, 0.0),
    "sphere": ({"radius": 0.048}, 0.048),
    "capsule": ({"radius": 0.02, "length": 0.4, "rotation_deg": (0.0, 90.0, 0.0)}, 0.02),
    "box": ({"half_sizes": (0.1, 0.06, 0.05), "edge_radius": 0.01}, 0.05),
    "disc": ({"radius": 0.065, "height": 0.05, "edge_radius": 0.002}, 0.025),
    "wedge": (
        {"half_angle_deg": 52.5, "edge_radius": 0.015, "length": 0.155, "height": 0.06}, 0.0,
    ),
    "ellipsoid": ({"semi_axes": (0.2, 0.13, 0.09)}, 0.09),
}  # fmt: skip


@njit
def distances(surface: Surface, points: FloatArray) -> float:
    total = 0.0
    for p in points:
        total += signed_distance(surface, 0, p[0], p[1], p[2])[0]
    return total


@njit
def deepest(surface: Surface, centers: FloatArray, rotation: FloatArray, warm: bool) -> float:
    guess, total = np.zeros(3), 0.0
    for c in centers:
        if not warm:
            guess[:] = 0.0
        total += deepest_point(surface, 0, (c[0], c[1], c[2]), rotation, SHELL, guess)[0]
    return total


def nanoseconds(call: Callable[[], object]) -> float:
    """Least time per item of five runs, compilation left out."""
    call()
    times = []
    for _ in range(5):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return 1e9 * min(times) / COUNT


def stepping(setup: ImpactSetup) -> float:
    """Time of this thread that the stepping of one impact takes [ms]."""
    impact = Impact(setup)
    start = time.thread_time()
    impact.advance(impact.total)
    return 1e3 * (time.thread_time() - start)


def impacts() -> None:
    """Print the stepping of impacts on flat ground, and that on anvils over it."""
    print("stepping [ms]".ljust(28) + "ground" + "".join(f"{name:>12}" for name in ANVILS[1:]))
    for rig, direction in (("rider", "left"), ("headform", "top")):
        for form, overrides in FORMS.items():
            setups = [
                ImpactSetup(rig=rig, direction=direction, surface=name, overrides=overrides)
                for name in ANVILS
            ]
            for setup in setups:  # finds springs and loads machine code
                stepping(setup)
            # In turn, so that what else the machine does falls on all alike.
            times = np.array([[stepping(setup) for setup in setups] for _ in range(REPEATS)])
            least = times.min(axis=0)
            ratios = "".join(f"{ratio:>12.2f}" for ratio in least[1:] / least[0])
            print(f"  {rig + ', ' + form:<25}{least[0]:>7.1f}{ratios}")


def main() -> None:
    random = np.random.default_rng(1)
    angle = 0.3
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c])
    print("ns per call     distance   deepest, warm   cold")
    for kind, (sizes, top) in SHAPES.items():
        surface = compile_parts((part_of({"kind": kind, **sizes}, kind),))
        points = random.normal(size=(COUNT, 3)) * 0.003 + [0.0, 0.0, top - 0.005]
        share = np.linspace(0.0, 1.0, COUNT)
        path = np.column_stack([0.02 * share, 0.03 * share, top + SHELL[2] - 0.01 * share])
        found = (
            nanoseconds(lambda a=surface, p=points: distances(a, p)),  # type: ignore[misc]
            nanoseconds(lambda a=surface, p=path: deepest(a, p, rotation, True)),  # type: ignore[misc]
            nanoseconds(lambda a=surface, p=path: deepest(a, p, rotation, False)),  # type: ignore[misc]
        )
        print(f"  {kind:<12} {found[0]:>9.1f} {found[1]:>15.0f} {found[2]:>6.0f}")
    impacts()


if __name__ == "__main__":
    main()
