"""How dense and how thick should the liner be? A map of the peak acceleration of the head.

A headform falls at 7.5 m/s on its side, in the foam form of the full-face helmet. Too soft a liner
bottoms out, too hard a one stops the head too soon; between them lies a valley that gets deeper
with thickness. Draws the map to ``liner_study.png``.
"""

# %% What is varied, and what stays.
import numpy as np
from matplotlib.figure import Figure

from helmet_sim_ros import ImpactSetup, evaluate, simulate

DENSITY = np.linspace(25.0, 90.0, 10)  # kg/m^3
THICKNESS = np.linspace(0.030, 0.050, 6)  # m


def peak_g(density: float, thickness: float) -> float:
    """The peak acceleration of the head in one drop [g]."""
    setup = ImpactSetup(
        rig="headform",
        direction="side",
        normal_velocity=7.5,
        duration=0.020,
        overrides={
            "helmet.coupling": "foam",
            "helmet.liner.density": density,
            "helmet.liner.thickness": thickness,
        },
    )
    return evaluate(simulate(setup), criteria=["peak_g"]).peak_g.value


# %% Sixty impacts, a second or two on one core.
peaks = np.array([[peak_g(d, t) for d in DENSITY] for t in THICKNESS])

print("peak g            density [kg/m³]")
print("thickness [mm] " + "".join(f"{d:6.0f}" for d in DENSITY))
for thickness, row in zip(THICKNESS, peaks, strict=True):
    print(f"{thickness * 1e3:14.0f} " + "".join(f"{value:6.0f}" for value in row))
for thickness, row in zip(THICKNESS, peaks, strict=True):
    best = DENSITY[row.argmin()]
    print(f"{thickness * 1e3:.0f} mm: least at {best:.0f} kg/m³ with {row.min():.0f} g")

# %% The figure, with the limit of 275 g of ECE R22.05 as a line.
figure = Figure(figsize=(6.4, 4.4), layout="constrained")
axes = figure.subplots()
drawn = axes.contourf(DENSITY, THICKNESS * 1e3, peaks, levels=14, cmap="viridis_r")
figure.colorbar(drawn, label="peak acceleration of the head [g]")
if peaks.min() < 275.0 < peaks.max():
    line = axes.contour(DENSITY, THICKNESS * 1e3, peaks, levels=[275.0], colors="crimson")
    axes.clabel(line, fmt="275 g")
best = DENSITY[peaks.argmin(axis=1)]
axes.plot(best, THICKNESS * 1e3, "ko", clip_on=False, label="least peak")
axes.set(xlabel="density of the liner [kg/m³]", ylabel="thickness of the liner [mm]")
axes.set_title("Headform on its side at 7.5 m/s, flat anvil")
axes.legend(loc="upper right")
figure.savefig("liner_study.png", dpi=130)
print("drawn: liner_study.png")
