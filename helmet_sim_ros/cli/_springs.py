"""Identified coupling springs, as a table."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from helmet_sim_ros.study.identification.fit import Identification


def show(result: Identification, console: Console) -> None:
    """Print the laws with their confidence and residuals."""
    view = Table(title="identified spring, F = A (exp(B d) - 1)", title_justify="left",
                 box=SIMPLE_HEAD, pad_edge=False)  # fmt: skip
    for header in ("side", "A [N]", "B [1/m]", "95 %", "A B [kN/m]", "95 %", "residuals [%]"):
        view.add_column(header, justify="left" if header == "side" else "right")
    for fit in result.fits:
        view.add_row(
            fit.side, f"{fit.A:.0f}", f"{fit.B:.2f}", _span(fit.B_interval),
            f"{fit.stiffness / 1e3:.0f}", _span(fit.stiffness_interval, 1e3),
            " ".join(f"{100 * r:+.1f}" for r in fit.residual),
        )  # fmt: skip
    console.print(view)
    console.print(f"energy loss per cycle {result.energy_loss:.3f}")
    for note in result.notes:
        console.print(f"note: {note}")


def _span(interval: tuple[float, float], unit: float = 1.0) -> str:
    low, high = interval
    return f"{low / unit:.0f}..{high / unit:.0f}"
