"""One impact of a helmeted rider: what goes in, what comes out, and whether it passes.

Draws the head's acceleration with its HIC window to ``first_impact.png``.
"""

# %% The setup: every value has a default, a range and a unit; a wrong one is refused by name.
from matplotlib.figure import Figure

from helmet_sim_ros import ImpactSetup, Rider, evaluate, simulate
from helmet_sim_ros.errors import SetupError

setup = ImpactSetup(
    direction="side",
    normal_velocity=5.0,  # m/s, into the ground
    tangential_velocity=10.0,  # m/s, along it
    rider=Rider(height=1.80, mass=80.0),  # m, kg
)
try:
    ImpactSetup(normal_velocity=50.0)
except SetupError as error:
    print(f"refused: {error}\n")

# %% The record: every sample as arrays in SI units, world axes with z up.
record = simulate(setup)
print(f"{len(record)} samples, one every {record.time_step * 1e6:g} µs")
print(f"ground force at its peak: {record.ground_force[:, 2].max() / 1e3:.1f} kN\n")

# %% The evaluation: each criterion with unit, window, limit and verdict.
result = evaluate(record)
for name in ("peak_g", "hic", "hic15", "clip_3ms", "peak_angular_acceleration", "bric"):
    criterion = result.criteria[name]
    limit = "" if criterion.limit is None else f"  limit {criterion.limit:g}"
    print(f"{name:>26} {criterion.value:9.4g} {criterion.unit:8}{limit}  {criterion.verdict}")
print(f"\n{result.title}: {result.verdict}")

# %% The figure.
acceleration = (record.head_acceleration**2).sum(axis=1) ** 0.5 / 9.80665  # g
figure = Figure(figsize=(6.4, 4.0), layout="constrained")
axes = figure.subplots()
axes.plot(record.time * 1e3, acceleration, label="resultant")
axes.axvspan(*(1e3 * t for t in result.hic.window), alpha=0.15, label="HIC window")
axes.set(xlabel="time [ms]", ylabel="head acceleration [g]")
axes.set_title(f"Side impact, 5 m/s normal and 10 m/s tangential: {result.peak_g.value:.0f} g")
axes.legend()
figure.savefig("first_impact.png", dpi=130)
print("drawn: first_impact.png")
