"""Judge a pulse that you measured, from a CSV file, by ECE R22.06.

    python examples/measured_pulse.py [PULSE.csv [SPEED]]

The file has a column ``time [ms]`` and ``acceleration_x [g]``, ``_y``, ``_z`` (or one column
``acceleration [g]``); see ``help(helmet_sim_ros.biomech.read_pulse)``.
"""

# %% The pulse: units are read from the file and checked, never guessed.
import sys
from pathlib import Path

from helmet_sim_ros import evaluate
from helmet_sim_ros.biomech import cfc, read_pulse

given = sys.argv[1:]
path = Path(given[0]) if given else Path(__file__).with_name("headform_drop.csv")
speed = float(given[1]) if len(given) > 1 else 7.5  # m/s, as your laboratory measured it
pulse = read_pulse(path, normal_velocity=speed)
print(f"{path.name}: {pulse}")

# %% Its criteria: the standard's limits apply to the signal after the CFC 1000 filter.
result = evaluate(pulse, "ece_r22_06_linear_medium")
for name in ("peak_g", "peak_g_cfc1000", "hic_cfc1000", "clip_3ms", "pulse_duration"):
    criterion = result.criteria[name]
    limit = "" if criterion.limit is None else f"  limit {criterion.limit:g}"
    print(f"{name:>16} {criterion.value:10.4g} {criterion.unit:4}{limit}  {criterion.verdict}")
print(f"{result.title}: {result.verdict}")
for text in (*result.messages, *result.warnings):
    print(f"    {text}")

# %% Each function also stands alone, on plain arrays.
filtered = cfc(pulse.acceleration, 1000, pulse.time[1] - pulse.time[0])
print(f"largest component after CFC 1000: {abs(filtered).max() / 9.80665:.1f} g")
