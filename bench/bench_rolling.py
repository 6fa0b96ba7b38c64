"""Angular velocity after oblique impacts, against rolling without slip.

    python bench/bench_rolling.py

A helmeted headform that sticks to a surface and gets nothing back along it leaves it rolling: about
the touched point its angular momentum is kept, so it turns at m h v_t / (I + m h^2), with the mass
m of head and helmet, their moment of inertia I about the axis that they turn about, and the height
h of the head's centre of gravity over the surface, taken where it is least. Faster is what padding
and liner give back along the surface; slower is slip between surface, helmet and head.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.model.impact import Impact

BICYCLE = {"normal_velocity": 3.5, "tangential_velocity": 2.5, "helmet": "bicycle"}  # as O5
MOTORCYCLE = {"normal_velocity": 5.65685, "tangential_velocity": 5.65685, "helmet": "fullface"}
CASES = (
    (BICYCLE, "nocsae_medium"), (BICYCLE, "hybrid_iii"), (MOTORCYCLE, "en960_j"),
    (MOTORCYCLE, "cellbond"), (MOTORCYCLE, "hybrid_iii"),
)  # fmt: skip
SITES = (("front", 0.0), ("front", 90.0), ("left", 0.0), ("left", 90.0))
CHANGES = {
    "as shipped": {},
    "rigid in shear": {"helmet.padding.shear_modulus": 1e8, "head.friction": 2.0},
    "head without friction": {"head.friction": 0.0},
}


def main() -> None:
    print("peak angular velocity over rolling, of four sites; in brackets its rad/s\n")
    for speeds, form in CASES:
        for name, changes in CHANGES.items():
            found = [ratio(site, heading, form, speeds, changes) for site, heading in SITES]
            cells = "  ".join(f"{share:4.2f} ({peak:4.1f})" for share, peak in found)
            print(f"{speeds['helmet']:9s} {form:14s} {name:22s} {cells}")


def ratio(site: str, heading: float, form: str, speeds: dict, changes: dict) -> tuple[float, float]:
    """Peak angular velocity over that of rolling, and the peak [rad/s]."""
    setup = ImpactSetup(
        rig="headform", surface="bar_anvil_45", direction=site, tangential_heading_deg=heading,
        time_step=2e-5, overrides={"head.form": form, "helmet.coupling": "foam", **changes},
        **speeds,
    )  # fmt: skip
    record = simulate(setup)
    spin = record.head_angular_velocity
    i = int(np.linalg.norm(spin, axis=1).argmax())

    axis = Rotation.from_quat(record.head_orientation[i]).inv().apply(spin[i])
    axis /= np.linalg.norm(axis)
    model, helmet = Impact(setup).model, setup.helmet_config
    inertia = float((model.body("head").inertia + np.array(helmet.inertia)) @ axis**2)
    mass = float(model.body("head").mass[0]) + helmet.mass
    target, frame = setup.surface_config.frame
    height = float(((record.head_position - target) @ frame[:, 2]).min())
    rolling = mass * height * setup.tangential_velocity / (inertia + mass * height**2)
    peak = float(evaluate(record).peak_angular_velocity)
    return peak / rolling, peak


if __name__ == "__main__":
    main()
