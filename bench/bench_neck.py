"""The neck against published loads and motions.

    python bench/bench_neck.py

Prints the full-body front impact of Ghajari et al. 2011 (L7: neck load at the peak of the head's
acceleration, share of the body in the head's effective mass), drops on the crown, the volunteers'
sled tests of ``config/references/neck.yaml``, and the peak accelerations of light and heavy riders.
"""

from __future__ import annotations

import numpy as np

from helmet_sim_ros import ImpactSetup, Rider, evaluate, simulate
from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.study.sled import sled, sled_tests
from helmet_sim_ros.study.validation.case import run_case

FOAM = {"helmet.coupling": "foam"}
L7 = {**FOAM, "helmet.liner.density": 40.0, "helmet.liner.thickness": 0.044}


def main() -> None:
    front = run_case("L7", ImpactSetup(direction="front", normal_velocity=7.5, overrides=L7))
    record = front.record
    peak = int(length(record.head_acceleration).argmax())
    own = (
        front.effective_mass
        - front.added_mass
        + front.neck_force / length(record.head_acceleration)[peak]
    )
    print(
        f"L7: {front.peak_g:.0f} g, HIC {front.hic:.0f}, neck at the peak "
        f"{length(record.neck_force)[peak]:.0f} N, "
        f"effective mass {front.effective_mass / own - 1.0:+.2f}"
    )
    for speed in (2.0, 3.2, 5.0):
        drop = simulate(
            ImpactSetup(direction="top", body_angle_deg=90.0, normal_velocity=speed, overrides=FOAM)
        )
        print(f"crown drop {speed:g} m/s: neck {drop.neck_force[:, 2].max():.0f} N, "
              f"{'; '.join(drop.extras['notes'])}")  # fmt: skip
    for test in sled_tests():
        moved = sled(Rider(), test.pulse(0.3))
        axis = 1 if test.axis == "x" else 0
        print(
            f"{test.name}: {np.degrees(np.abs(moved.rotation[:, axis]).max()):.0f} deg, "
            f"{np.abs(moved.displacement[:, 1 - axis]).max() * 1e3:.0f} mm, "
            f"{length(moved.acceleration).max() / 9.80665:.0f} g, "
            f"{length(moved.neck_torque).max():.0f} N m; published: {test.response}"
        )
    peaks = [
        float(evaluate(simulate(ImpactSetup(rider=Rider(mass=mass), overrides=FOAM))).peak_g)
        for mass in (50.0, 120.0)
    ]
    print(f"rider of 120 kg over 50 kg: peak g {100.0 * (peaks[1] / peaks[0] - 1.0):+.1f} %")


def length(vectors: FloatArray) -> FloatArray:
    """|v| of each row."""
    found: FloatArray = np.linalg.norm(vectors, axis=1)
    return found


if __name__ == "__main__":
    main()
