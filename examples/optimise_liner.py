"""A small search for a lighter liner: what mass does a lower peak acceleration cost?

Density and thickness of the whole liner are free; two drops per design, limits with a margin. The
search lives in a folder and goes on where it was; a real one is
``helmet-sim optimise lighter_ece_22_05``.
"""

# %% The search, as a file: what may vary, what is to be small, and within which limits.
import sys
from pathlib import Path

from helmet_sim_ros import optimise

STUDY = """
description: density and thickness of the liner, two drops per design
common:
  helmet: {name: fullface, coupling: foam}
  impact: {rig: headform, normal_velocity: 7.5}
  sim.duration: 0.02
product:
  impact.direction: [front, left]
variables:
  helmet.liner.density: [30.0, 80.0]      # kg/m^3
  helmet.liner.thickness: [0.035, 0.050]  # m
objectives:
  - {minimise: helmet_mass}
  - {minimise: worst peak_g}
constraints:
  - {of: worst hic, at_most: 2300.0}
trials: 40
batch: 20
best: 4
"""


def main() -> int:
    """Write the file, search, and print the best designs."""
    file = Path("liner.yaml")
    file.write_text(STUDY, encoding="utf-8")
    result = optimise(file, "liner.optimisation", workers=1)
    print(f"{len(result.trials)} designs, {result.computed} of them computed now\n")
    print("design     mass [kg]  worst peak g  worst HIC   density  thickness [mm]")
    for trial in (result.reference, *result.best):
        name = "reference" if trial.number < 0 else f"{trial.number:04d}"
        of = trial.responses
        values = trial.values
        drawn = (
            f"{values['helmet.liner.density']:8.1f}  {values['helmet.liner.thickness'] * 1e3:12.1f}"
            if values
            else ""
        )
        print(
            f"{name:10} {of['helmet_mass']:8.3f}  {of['worst peak_g']:12.0f}  "
            f"{of['worst hic']:9.0f}  {drawn}"
        )
    print(f"\ndrawn: {result.folder / 'pareto.png'}; helmets: {result.folder / 'designs'}")
    return 0


# %% Workers are fresh processes, which import this file: hence the guard.
if __name__ == "__main__":
    sys.exit(main())
