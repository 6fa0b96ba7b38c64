"""The figure of a foam's tests with the table and the law that were made of them."""

from __future__ import annotations

from matplotlib.figure import Figure

from helmet_sim_ros.study.foams.fitting import FoamFit


def foam_figure(fit: FoamFit) -> Figure:
    """Stress over strain: tests, table, law."""
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.add_subplot()
    for curve in fit.curves:
        label = "test" if curve.rate is None else f"test at {curve.rate:g} 1/s"
        axes.plot(100 * curve.strain, 1e-6 * curve.stress, "o", markersize=3, label=label)
    axes.plot(100 * fit.strain, 1e-6 * fit.stress, "k-", linewidth=1, label="table")
    axes.plot(100 * fit.strain, 1e-6 * fit.law_stress(fit.strain), "k--", linewidth=1,
              label=f"law, error {100 * fit.error:.1f} % of the plateau")  # fmt: skip
    plateau = 1e-6 * float(fit.foam.yield_stress or 0.0)
    axes.set(xlabel="strain [%]", ylabel="stress [MPa]", xlim=(0, None), ylim=(0, 6 * plateau))
    axes.legend(frameon=False)
    return figure
