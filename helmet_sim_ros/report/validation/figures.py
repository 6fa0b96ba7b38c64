"""The figures of docs/validation.md."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY
from helmet_sim_ros.study.validation.case import PUBLISHED, CaseResult
from helmet_sim_ros.study.validation.validate import Validation

#: The helmets of every pair of results, in their order.
NAMES = ("spring", "foam")


def histories_figure(table: Sequence[tuple[CaseResult, CaseResult]]) -> Figure:
    """Resultant head acceleration of the six cases (layout of the paper's Figs 7 to 9)."""
    figure = Figure(figsize=(10.0, 9.0))
    axes = figure.subplots(3, 2, sharex=True)
    for ax, (spring, foam) in zip(axes.flat, table, strict=True):
        for case, name, style in ((foam, "foam helmet", "-"), (spring, "spring helmet", "--")):
            magnitude = np.linalg.norm(case.record.head_acceleration, axis=1) / STANDARD_GRAVITY
            ax.plot(case.record.time * 1e3, magnitude, style, lw=1.4, label=name)
        for model, color in zip(PUBLISHED, ("#7f8c8d", "#c0392b", "#8e44ad"), strict=True):
            if foam.published:
                ax.axhline(foam.published["peak_g"][model], color=color, lw=0.8, ls=":",
                           label=f"paper {model}, peak")  # fmt: skip
        ax.set_title(
            f"v_n = {foam.setup.normal_velocity:g} m/s, "
            f"v_t = {foam.setup.tangential_velocity:g} m/s",
            fontsize=10,
        )
        ax.grid(alpha=0.3)
        ax.set_xlim(0.0, 30.0)
    for ax in axes[:, 0]:
        ax.set_ylabel("head acceleration [g]")
    for ax in axes[-1]:
        ax.set_xlabel("time [ms]")
    axes.flat[0].legend(fontsize=7)
    return figure


def peaks_figure(result: Validation) -> Figure:
    """Peak forces over compression of all drops (layout of the paper's Fig. 5)."""
    figure = Figure(figsize=(6.5, 4.5))
    ax = figure.subplots()
    markers = {"front": "o", "back": "s", "side": "^", "top": "D"}
    for i, (name, fill) in enumerate(zip(NAMES, ("none", "full"), strict=True)):
        for side, marker in markers.items():
            own = [pair[i].test for pair in result.drops if pair[i].test.direction == side]
            ax.plot(
                [t.peak_compression * 1e3 for t in own], [t.peak_force / 1e3 for t in own],
                marker=marker, fillstyle=fill, lw=0.8, ls="-" if i else "--",
                label=f"{side}, {name}",
            )  # fmt: skip
    ax.set_xlabel("approach of the head [mm]")
    ax.set_ylabel("peak force [kN]")
    ax.grid(alpha=0.3)
    ax.legend(fontsize=7, ncols=2)
    return figure
