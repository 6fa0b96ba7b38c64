"""Figures of drop tests and of the springs identified from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.model.identified import SIDES
from helmet_sim_ros.study.identification.fit import Identification
from helmet_sim_ros.study.identification.history_fit import HistoryFit

SPEED_COLORS = ("#1b6ca8", "#3a9d5d", "#d98c1f", "#c0392b", "#7d3c98", "#566573")
Loop = tuple[str, float, FloatArray, FloatArray]  # side, speed, compression [m], force [N]


def histories_figure(result: HistoryFit) -> Figure:
    """Measured and fitted history of each drop, and what is left between them."""
    figure = Figure(figsize=(8.0, 2.4 * len(result.drops)), layout="constrained")
    axes = figure.subplots(len(result.drops), 2, squeeze=False, sharex="row")
    for (curves, rest), drop, fitted in zip(axes, result.drops, result.simulated, strict=True):
        time = 1e3 * drop.time
        curves.plot(time, drop.acceleration, "k-", lw=1, label="measured")
        curves.plot(time, fitted, color="#c0392b", lw=1, label="fitted")
        curves.set(title=f"{drop.source}: {drop.direction}, {drop.speed:g} m/s", ylabel="[g]")
        rest.plot(time, fitted - drop.acceleration, color="#1b6ca8", lw=1)
        rest.set(title="fitted less measured", ylabel="[g]")
        for ax in (curves, rest):
            ax.grid(alpha=0.3)
    for ax in axes[-1]:
        ax.set_xlabel("time [ms]")
    axes[0, 0].legend(fontsize=8)
    return figure


def identification_figure(result: Identification, loops: Sequence[Loop] = ()) -> Figure:
    """Measured peaks and identified law per side, over the loops where there are any."""
    figure = Figure(figsize=(10.0, 6.5))
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    for ax, fit in zip(axes.flat, result.fits, strict=True):
        _loops(ax, fit.side, loops)
        reach = np.linspace(0.0, 1.05 * float(fit.compression.max()), 200)
        law = fit.A * np.expm1(fit.B * reach)
        shell = law / result.helmet.shell.contact_stiffness
        ax.plot((reach + shell) * 1e3, law / 1e3, "k-", lw=1.6, label="identified law")
        bending = fit.force / result.helmet.shell.contact_stiffness
        ax.plot((fit.compression + bending) * 1e3, fit.force / 1e3, "o", color="#c0392b",
                label="measured peaks")  # fmt: skip
        worst = 100.0 * float(np.abs(fit.residual).max())
        ax.set_title(
            f"{fit.side}: A = {fit.A:.0f} N, B = {fit.B:.2f} 1/m, worst residual {worst:.1f} %",
            fontsize=9,
        )
        ax.grid(alpha=0.3)
    _label(axes)
    axes.flat[0].legend(fontsize=8)
    return figure


def loops_figure(
    loops: Mapping[str, Sequence[Loop]], sides: Sequence[str] = tuple(SIDES)
) -> Figure:
    """Force-compression loops per side for several helmets (layout of the paper's Figs 3 and 4)."""
    figure = Figure(figsize=(10.0, 6.5))
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    for ax, side in zip(axes.flat, sides, strict=True):
        for (name, own), style in zip(loops.items(), ("-", "--", ":"), strict=False):
            _loops(ax, side, own, style, name)
        ax.set_title(side, fontsize=10)
        ax.grid(alpha=0.3)
    _label(axes)
    axes.flat[0].legend(fontsize=7)
    return figure


def _loops(
    ax: object, side: str, loops: Sequence[Loop], style: str = "-", name: str = "drop"
) -> None:
    own = [loop for loop in loops if loop[0] == side]
    for (_, speed, compression, force), color in zip(own, SPEED_COLORS, strict=False):
        ax.plot(  # type: ignore[attr-defined]
            compression * 1e3, force / 1e3, style, color=color, lw=1.0,
            label=f"{name}, {speed:g} m/s",
        )  # fmt: skip


def _label(axes: object) -> None:
    for ax in axes[-1]:  # type: ignore[index]
        ax.set_xlabel("approach of the head [mm]")
    for ax in axes[:, 0]:  # type: ignore[index]
        ax.set_ylabel("force [kN]")
