"""Figure of a study of falls: speeds, angles and places of the worst head strikes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from helmet_sim_ros.biomech.record import FloatArray


def falls_figure(columns: Mapping[str, Sequence[object]], title: str) -> Figure:
    """Speeds into and along what is struck, angle of the speed, and a map of the helmet.

    Args:
        columns: results of the study, with the measures of strikes and ``peak_g``.
        title: above it.
    """
    struck = [i for i, n in enumerate(columns["strikes"]) if n]

    def numbers(name: str) -> FloatArray:
        return np.array([columns[name][i] for i in struck], dtype=float)

    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    figure.suptitle(f"{title}: worst head strike of {len(struck)} falls", fontsize=10)
    speeds, angles, places = figure.subplots(1, 3, width_ratios=[1.0, 0.8, 1.6])
    peak = numbers("peak_g")
    along, into = numbers("strike_tangential_velocity"), numbers("strike_normal_velocity")
    speeds.scatter(along, into, c=peak, s=14, cmap="viridis")
    speeds.set(xlabel="along the surface [m/s]", ylabel="into the surface [m/s]")
    angles.hist(numbers("strike_angle_deg"), bins=np.arange(0.0, 91.0, 10.0), color="#1b6ca8")
    angles.set(xlabel="speed to the surface [deg]", ylabel="falls")
    drawn = places.scatter(
        numbers("strike_azimuth_deg"), numbers("strike_elevation_deg"), c=peak, s=18,
        cmap="viridis",
    )  # fmt: skip
    places.set(
        xlim=(180.0, -180.0), ylim=(-90.0, 90.0), yticks=[-90, -45, 0, 45, 90],
        xticks=[180, 90, 0, -90, -180], ylabel="elevation [deg]",
    )  # fmt: skip
    places.set_xticklabels(["back", "left", "front", "right", "back"])
    figure.colorbar(drawn, ax=places, label="peak g")
    for axes in (speeds, angles, places):
        axes.grid(alpha=0.3)
    return figure
