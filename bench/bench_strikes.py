"""How well a head strike alone gives the peak that it had in its fall.

python -m bench.bench_strikes            # 24 falls over postures, scenes and helmets
python -m bench.bench_strikes --falls 48
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np

from helmet_sim_ros import Fall, head_strikes, simulate
from helmet_sim_ros.errors import HelmetSimError

PRESETS = ("motorcycle", "bicycle", "pedestrian")
SCENES = ("road", "kerb", "post", "wall", "car", "road")
HELMETS = (("fullface", {}), ("none", {}), ("bicycle", {}),
           ("fullface", {"helmet.coupling": "foam"}))  # fmt: skip
LEAST = 15.0  # g: weaker strikes are touches
STANDARD_GRAVITY = 9.80665


def falls(count: int) -> Iterator[Fall]:
    """Random falls, the same every time."""
    random = np.random.default_rng(3)
    for n in range(count):
        roll, pitch, spin = random.uniform(-40, 40), random.uniform(-10, 40), random.normal()
        preset, (helmet, overrides) = PRESETS[n % 3], HELMETS[n % 4]
        if preset == "pedestrian":
            roll, pitch = 0.0, 0.0
        yield Fall(
            preset=preset, scene=SCENES[n % 6], helmet=helmet, overrides=overrides, duration=1.5,
            roll_deg=float(roll), pitch_deg=float(pitch), spin=float(spin),
            pitch_rate=2.0 if preset == "pedestrian" else 0.0,
        )  # fmt: skip


def main() -> None:
    """Print every strike and the shares within 1 and 5 %."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--falls", type=int, default=24)
    found: list[tuple[bool, float, float]] = []
    for number, fall in enumerate(falls(parser.parse_args().falls), 1):
        strikes = head_strikes(simulate(fall))
        for strike in strikes:
            peak = strike.peak_acceleration / STANDARD_GRAVITY
            if peak < LEAST or strike.normal_velocity <= 0.0:
                continue
            try:
                record = simulate(strike.setup())
            except HelmetSimError as error:
                print(f"{number:3d} {fall.preset}, {fall.scene}: {str(error)[:80]}")
                continue
            alone = float(np.linalg.norm(record.head_acceleration, axis=1).max())
            error = alone / STANDARD_GRAVITY / peak - 1.0
            found.append((strike is strikes.worst, strike.normal_velocity, abs(error)))
            print(
                f"{number:3d} {fall.preset:10} {fall.scene:5} {fall.helmet:8} {strike.time:5.3f} s "
                f"{strike.struck:10} {strike.normal_velocity:5.2f} m/s {peak:6.1f} g {error:+7.2%}"
            )
    for name, errors in (
        ("worst of their fall", [e for worst, _, e in found if worst]),
        ("above 1 m/s", [e for _, speed, e in found if speed > 1.0]),
        (f"above {LEAST:g} g", [e for _, _, e in found]),
    ):
        values = np.array(errors)
        print(
            f"{name}: {len(values)} strikes, {np.mean(values < 0.01):.0%} within 1 %, "
            f"{np.mean(values < 0.05):.0%} within 5 %, worst {values.max():.1%}"
        )


if __name__ == "__main__":
    main()
