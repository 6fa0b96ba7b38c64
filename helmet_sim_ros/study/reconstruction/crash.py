"""Crashes as points of a parameter space, and the residual crush that each leaves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import DivergedError
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup

#: What is searched: speed into the surface, speed along it in two directions (towards the crown,
#: and to the left of that seen from outside) [m/s], and where on the helmet, as angles about the
#: place that the map itself points at [rad].
NAMES = ("normal", "along_x", "along_y", "place_u", "place_v")
DURATION = 0.02  # s; liners are crushed within 10 to 15 ms


@dataclass(frozen=True)
class Scene:
    """What is known of a crash.

    Attributes:
        setup: helmet, surface, headform; its speeds and site are replaced.
        place: where the map says that the helmet was struck, from the head's centre, (3,).
        low, high: of the parameters, (5,); the prior is uniform between them.
    """

    setup: ImpactSetup
    place: FloatArray
    low: FloatArray
    high: FloatArray


def scene(setup: ImpactSetup, place: FloatArray, fastest: float, along: float) -> Scene:
    """A scene with the usual bounds: up to these speeds, and 20 degrees about the place."""
    reach = math.radians(20.0)
    return Scene(
        setup, place / np.linalg.norm(place),
        np.array([0.5, -along, -along, -reach, -reach]),
        np.array([fastest, along, along, reach, reach]),
    )  # fmt: skip


def site(scene: Scene, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Azimuth and elevation [deg] of places at small angles u (to the left) and v (upwards) [rad]
    from the scene's, (n,) each."""
    middle = scene.place
    left = np.cross([0.0, 0.0, 1.0], middle)
    if np.linalg.norm(left) < 0.1:  # at the crown
        left = np.array([0.0, 1.0, 0.0])
    left = left - (left @ middle) * middle
    left /= np.linalg.norm(left)
    up = np.cross(middle, left)
    point = middle + np.outer(np.tan(u), left) + np.outer(np.tan(v), up)
    point /= np.linalg.norm(point, axis=1)[:, None]
    azimuth = np.degrees(np.arctan2(point[:, 1], point[:, 0]))
    return azimuth, np.degrees(np.arcsin(np.clip(point[:, 2], -1.0, 1.0)))


def setup_of(scene: Scene, parameters: FloatArray) -> ImpactSetup:
    """The impact of one point of the space, (5,)."""
    normal, x, y, u, v = parameters.tolist()
    azimuth, elevation = site(scene, np.array([u]), np.array([v]))
    return scene.setup.replaced(  # type: ignore[no-any-return]
        {
            "normal_velocity": normal,
            "tangential_velocity": math.hypot(x, y),
            "tangential_heading_deg": math.degrees(math.atan2(y, x)),
            "azimuth_deg": float(azimuth[0]),
            "elevation_deg": float(elevation[0]),
        }
    )


def residual_crush(scene: Scene, points: Sequence[FloatArray] | FloatArray) -> FloatArray:
    """Residual crush of every cell after each crash, (crashes, cells) [m]; nan where a simulation
    diverged."""

    def one(parameters: FloatArray) -> FloatArray:
        impact = Impact(setup_of(scene, parameters))
        try:
            impact.run()
        except DivergedError:
            return np.full(len(impact.extras()["residual_crush"]), np.nan)
        crush: FloatArray = impact.extras()["residual_crush"]
        return crush

    with ThreadPoolExecutor(2) as pool:  # the compiled loop leaves the interpreter free
        return np.array(list(pool.map(one, points)))
