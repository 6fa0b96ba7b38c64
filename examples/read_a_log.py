"""Read a log of ``helmet-sim run`` in Python: impacts, histories, criteria by another standard.

python examples/read_a_log.py [LOG.mcap]     # default: the newest in logs/
"""

# %% Which log.
import sys
from pathlib import Path

from helmet_sim_ros import open_log

logs = sorted(Path("logs").glob("*.mcap"), key=lambda path: path.stat().st_mtime)
if len(sys.argv) < 2 and not logs:
    sys.exit("no log in logs/: run `helmet-sim run oblique_table1` first, or name a log")
log = open_log(sys.argv[1] if len(sys.argv) > 1 else logs[-1])
print(f"{log.path.name}: complete impacts: {len(log)}, incomplete: {len(log.problems)}")

# %% Opening reads an index only; samples are read, bit for bit, when they are asked for.
for impact in log:
    speed = impact.setup["impact.normal_velocity"]
    force = impact.record.ground_force
    print(
        f"{impact.impact_id}: {impact.samples} samples, {speed:g} m/s normal, "
        f"ground force up to {force[:, 2].max() / 1e3:.1f} kN, "
        f"logged {impact.evaluation.peak_g.value:.0f} g {impact.evaluation.verdict}"
    )

# %% The same impacts by another standard, from the logged samples.
for impact in log:
    judged = impact.evaluate("ece_r22_06_linear_medium")
    print(f"{impact.impact_id}: {judged.title}: {judged.verdict}")
    for text in (*judged.messages, *judged.warnings):
        print(f"    {text}")
