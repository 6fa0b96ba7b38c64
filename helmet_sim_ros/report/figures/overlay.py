"""Histories of the impacts of two logs, one over the other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from matplotlib.figure import Figure

from helmet_sim_ros.biomech.helmet import compression, ground_components
from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY, FloatArray, magnitude
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.report.review.compare import Pair


def overlay_figure(pairs: Sequence[Pair], names: tuple[str, str]) -> Figure:
    """Acceleration, ground force and compression of each pair, one row per pair."""
    both = [pair for pair in pairs if pair.a is not None and pair.b is not None]
    figure = Figure(figsize=(12.0, 2.7 * max(len(both), 1) + 0.6), layout="constrained")
    grid = figure.subplots(max(len(both), 1), 3, sharex=True, squeeze=False)
    for row, pair in zip(grid, both, strict=False):
        for impact, name, style in zip((pair.a, pair.b), names, ("-", "--"), strict=True):
            assert impact is not None
            record = impact.record
            for ax, (_, history) in zip(row, _histories(record), strict=True):
                ax.plot(record.time * 1e3, history, style, lw=1.3, label=name)
        for ax, (unit, _) in zip(row, _histories(record), strict=True):
            ax.set_ylabel(unit, fontsize=8)
            ax.grid(alpha=0.3)
        row[0].set_title(pair.label, fontsize=9, loc="left")
        row[0].legend(fontsize=7)
    for ax in grid[-1]:
        ax.set_xlabel("time [ms]")
    return figure


def _histories(record: ImpactRecord) -> Iterable[tuple[str, FloatArray]]:
    normal, _ = ground_components(record.ground_force, record.ground_friction)
    return (
        ("head acceleration [g]", magnitude(record.head_acceleration) / STANDARD_GRAVITY),
        ("normal ground force [kN]", normal / 1e3),
        ("compression [mm]", compression(record.coupling_displacement) * 1e3),
    )
