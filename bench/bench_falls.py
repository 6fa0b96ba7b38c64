"""Random falls: how deep, how far beyond the joints' stops, how much energy, how fast at rest.

    python bench/bench_falls.py [FALLS] [SPEED] [FORM]

FALLS riders (40) start 0.5 to 2 m above the road in random poses, at up to SPEED m/s (15) in a
random direction, downwards, with a spin; FORM of the helmet is foam or spring. Prints one line per
fall and the worst of all; then the first strikes of the first falls beside those of fine steps
throughout, how far those scatter themselves, and what a fall of 2 s costs.
FALLS may be 0.
"""

from __future__ import annotations

import sys
import time
from typing import NamedTuple

import mujoco
import numpy as np

from helmet_sim_ros import Fall
from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import DivergedError
from helmet_sim_ros.model.fall.stepping import Falling
from helmet_sim_ros.model.force.self_contact import started

DURATION = 4.0  # s
COMPARED, COMPARED_TIME = 24, 0.8  # falls and their length [s], beside fine steps throughout
STRONG = 20.0 * 9.80665  # m/s^2, of a strike that is compared


class Found(NamedTuple):
    """Of one fall: beyond a stop [rad], depth over thickness [-], energy gained over lost [-],
    kinetic energy after 2 s and at the end [J], speed of the head at the end [m/s], CPU [s]."""

    overshoot: float
    depth: float
    gain: float
    after_two: float
    left: float
    head: float
    cpu: float


def random_fall(seed: int, speed: float, form: str, duration: float, energy: bool) -> Falling:
    """A fall from a random pose."""
    rng = np.random.default_rng(seed)
    setup = Fall(height=5.0, duration=duration, overrides={"helmet.coupling": form})
    fall = Falling(setup, energy=energy)
    model, data = fall.model, fall._data
    held = fall._simulation.forces.stops
    rest = model.qpos_spring[held.qpos]
    share = rng.uniform(-0.5, 0.5, len(rest))
    room = np.where(share > 0.0, held.high - rest, rest - held.low)
    data.qpos[held.qpos] = rest + share * room
    turn = rng.normal(size=4)
    data.qpos[3:7] = turn / np.linalg.norm(turn)
    heading = rng.normal(size=3)
    heading[2] = -abs(heading[2])
    data.qvel[:] = 0.0
    data.qvel[:3] = speed * rng.uniform(0.2, 1.0) * heading / np.linalg.norm(heading)
    data.qvel[3:6] = 2.0 * rng.normal(size=3)
    mujoco.mj_kinematics(model, data)
    data.qpos[2] += rng.uniform(0.5, 2.0) + depths(fall, data.qpos).max()
    mujoco.mj_forward(model, data)
    now, fast = fall._simulation, 0.5 * float(model.body_subtreemass[1]) * speed**2
    fall._simulation = now._replace(
        forces=now.forces._replace(own=started(now.forces.own, now.motion)),
        clock=now.clock._replace(energy=2.0 * fast + 5e3),
    )
    return fall


def depths(fall: Falling, position: FloatArray) -> FloatArray:
    """Of every ellipsoid of body and helmet in the road [m]."""
    data = mujoco.MjData(fall.model)
    data.qpos[:] = position
    mujoco.mj_kinematics(fall.model, data)
    contact = fall.contact
    turns = data.xmat[contact.body].reshape(-1, 3, 3)
    centers = data.xpos[contact.body] + np.einsum("nij,nj->ni", turns, contact.center)
    lowest = centers[:, 2] - np.linalg.norm(turns[:, 2] * contact.semi_axes, axis=1)
    shell = data.xpos[fall.layout.helmet][2] - max(fall.helmet.shell.semi_axes)
    deep: FloatArray = -np.append(lowest, shell)
    return deep


def find(seed: int, speed: float, form: str) -> Found:
    """Run one fall."""
    fall = random_fall(seed, speed, form, DURATION, True)
    begun = time.process_time()
    fall.run()
    cpu = time.process_time() - begun
    held, record = fall._simulation.forces.stops, fall.record()
    positions = np.array([position for position, _ in fall.states()])
    turned = positions[:, held.qpos]
    soft = np.isfinite(fall.contact.thickness)
    thickness = fall.contact.thickness[soft]
    deepest = max(
        (depths(fall, position)[:-1][soft] / thickness).max() for position in positions[::2]
    )
    moving = kinetic(fall)
    energy, after = fall.energy, min(int(np.searchsorted(record.time, 2.0)), len(record.time) - 1)
    quiet = np.linalg.norm(record.head_velocity[record.time > record.time[-1] - 0.1], axis=1)
    return Found(
        float(np.maximum(turned - held.high, held.low - turned).max()), float(deepest),
        float((energy - np.minimum.accumulate(energy)).max() / energy[0]),
        float(moving[after]), float(moving[-1]), float(quiet.max()), cpu,
    )  # fmt: skip


def kinetic(fall: Falling) -> FloatArray:
    """Kinetic energy of every sample [J]."""
    data, found = mujoco.MjData(fall.model), []
    for position, velocity in fall.states():
        data.qpos[:], data.qvel[:] = position, velocity
        mujoco.mj_fwdPosition(fall.model, data)
        mujoco.mj_energyVel(fall.model, data)
        found.append(data.energy[1])
    return np.array(found)


def peaks(seed: int, speed: float, form: str) -> tuple[float, float, float, float] | None:
    """Of the first strong strike [m/s^2]: as falls step, at fine steps throughout, and those again
    from a start that differs by 1e-9, and at half of them; None: there is none."""
    long, fine, moved, half = (
        random_fall(seed, speed, form, COMPARED_TIME, False) for _ in range(4)
    )
    for fall in (fine, moved, half):
        fall._course.progress.fine_until[0] = np.inf
    moved._data.qvel[:6] *= 1.0 + 1e-9
    pace = half._course.pace
    finer = pace._replace(fine=0.5 * pace.fine, substeps=2 * pace.substeps)
    half._course = half._course._replace(pace=finer)
    runs = []
    for fall in (long, fine, moved, half):
        fall.run()
        record = fall.record()
        runs.append((record.time, np.linalg.norm(record.head_acceleration, axis=1)))
    time, pulled = runs[0]
    for first, last in long.dense:
        begin, end = time[first] - 2e-3, time[last - 1] + 2e-3
        right = [float(a[(t >= begin) & (t <= end)].max()) for t, a in runs[1:]]
        if right[0] > STRONG:
            return float(pulled[first:last].max()), right[0], right[1], right[2]
    return None


def main() -> None:
    falls = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    speed = float(sys.argv[2]) if len(sys.argv) > 2 else 15.0
    form = sys.argv[3] if len(sys.argv) > 3 else "foam"
    every = []
    for seed in range(falls):
        try:
            found = find(seed, speed, form)
        except DivergedError as error:
            print(f"{seed}: {str(error)[:60]}")
            continue
        every.append(found)
        print(seed, " ".join(f"{k} {v:.3g}" for k, v in found._asdict().items()), flush=True)
    print(f"{len(every)} of {falls} ran to the end")
    for name, values in zip(Found._fields, zip(*every, strict=True), strict=False):
        print(f"{name}: median {np.median(values):.3g}, largest {max(values):.3g}")
    found = [peaks(seed, min(speed, 10.0), form) for seed in range(COMPARED)]
    compared = np.array([peak for peak in found if peak is not None])
    errors = np.abs(compared / compared[:, 1:2] - 1.0)
    for name, error in zip(
        ("as falls step", "fine, start moved by 1e-9", "fine, half the step"),
        errors[:, [0, 2, 3]].T, strict=True,
    ):  # fmt: skip
        print(f"peak of the first strike beside fine steps throughout, {name}: "
              f"median {100 * np.median(error):.2g} %, largest {100 * error.max():.2g} %, "
              f"{(error < 5e-3).sum()} of {len(error)} within 0.5 %")  # fmt: skip
    one = Fall(preset="pedestrian", speed=3.0, pitch_deg=30.0, duration=2.0,
               overrides={"helmet.coupling": form})  # fmt: skip
    costs = []
    for _ in range(5):
        fall = Falling(one)
        begun = time.process_time()
        fall.run()
        costs.append(time.process_time() - begun)
    taken = fall._course.progress.taken
    print(f"a pedestrian's fall of 2 s: {1e3 * min(costs):.0f} ms, steps {taken}, "
          f"{len(fall.dense)} stretches of fine steps")  # fmt: skip


if __name__ == "__main__":
    main()
