"""Falls take long steps where nothing happens, fine ones where the head strikes."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from bench.bench_falls import random_fall
from helmet_sim_ros import Fall, evaluate, simulate
from helmet_sim_ros.biomech.record import DENSE, same_samples
from helmet_sim_ros.model.fall.stepping import Falling
from helmet_sim_ros.model.rider.tissue import FRICTION

HEAD_FIRST = Fall(
    speed=4.0, vertical_speed=-3.0, height=1.2, pitch_deg=110.0, duration=0.25, helmet="fullface"
)
G = 9.80665


def run(fall: Fall, fine: bool = False, energy: bool = False) -> Falling:
    falling = Falling(fall, energy=energy)
    if fine:
        falling._course.progress.fine_until[0] = np.inf
    falling.run()
    return falling


def momenta(falling: Falling) -> tuple[np.ndarray, np.ndarray]:
    """Momentum and angular momentum about the centre of mass of every sample, from MuJoCo."""
    model, found = falling.model, []
    data = mujoco.MjData(model)
    for position, velocity in falling.states():
        data.qpos[:], data.qvel[:] = position, velocity
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_subtreeVel(model, data)
        mass = model.body_subtreemass[1]
        found.append(np.concatenate([mass * data.subtree_linvel[1], data.subtree_angmom[1]]))
    both = np.array(found)
    return both[:, :3], both[:, 3:]


def test_two_seconds_of_tumbling_flight_keep_both_momenta() -> None:
    flight = run(Fall(height=5.0, vertical_speed=20.0, spin=3.0, pitch_rate=4.0, duration=2.0))
    momentum, spin = momenta(flight)
    weight = flight.model.body_subtreemass[1] * np.array([0.0, 0.0, -G])
    expected = momentum[0] + np.outer(flight.record().time, weight)
    assert np.abs(momentum - expected).max() < 1e-6 * np.linalg.norm(momentum[0])
    assert np.abs(spin - spin[0]).max() < 1e-6 * np.linalg.norm(spin[0])


def test_two_seconds_of_flight_keep_the_energy_but_for_what_joints_dissipate() -> None:
    still = run(Fall(height=5.0, vertical_speed=20.0, preset="pedestrian"), energy=True).energy
    assert np.abs(still - still[0]).max() < 1e-6 * still[0]
    tumbling = run(Fall(height=5.0, vertical_speed=20.0, pitch_rate=4.0), energy=True).energy
    growth = (tumbling - np.minimum.accumulate(tumbling)).max()
    assert growth < 1e-6 * tumbling[0]


# A shoulder in a pose where two of its axes are one; a head wedged in its helmet as it takes off; a
# spring helmet that the fine steps meet pressed; a hip at its stop as a rider takes off. Of 40
# falls of each kind these gained energy once.
@pytest.mark.parametrize(
    ("seed", "speed", "form"),
    [(16, 15.0, "foam"), (9, 30.0, "foam"), (30, 15.0, "spring"), (2, 30.0, "spring")],
)
def test_a_fall_gains_no_energy(seed: int, speed: float, form: str) -> None:
    falling = random_fall(seed, speed, form, 0.8, energy=True)
    falling.run()
    energy = falling.energy
    assert len(energy) > 300
    assert (energy - np.minimum.accumulate(energy)).max() < 3e-4 * energy[0]


def test_a_fall_ends_when_all_is_at_rest() -> None:
    setup = Fall(preset="pedestrian", speed=3.0, pitch_deg=30.0, duration=4.0)
    fall, longer = run(setup), run(setup.model_copy(update={"duration": 5.0}))
    record = fall.record()
    assert 1.0 < record.time[-1] < 3.0
    last = record.time > record.time[-1] - 0.05
    assert np.linalg.norm(record.head_velocity[last], axis=1).max() < 0.02
    assert same_samples(record, longer.record())


def test_a_fall_goes_on_while_a_car_comes() -> None:
    lies = {"pitch_deg": -90.0, "height": 0.35, "preset": "pedestrian", "speed": 0.0}
    fall = run(Fall(scene="car", traffic_speed=1.0, traffic_braking=0.0, duration=3.0, **lies))
    assert fall.record().time[-1] > 2.99


def test_the_peak_of_a_strike_is_that_of_fine_steps_throughout() -> None:
    long, fine = run(HEAD_FIRST), run(HEAD_FIRST, fine=True)
    peaks = [
        np.linalg.norm(falling.record().head_acceleration, axis=1).max() for falling in (long, fine)
    ]
    assert peaks[0] == pytest.approx(peaks[1], rel=5e-3)
    assert long._course.progress.taken.sum() < 0.5 * fine._course.progress.taken.sum()


def test_samples_are_dense_around_strikes_and_thin_elsewhere() -> None:
    falling = run(HEAD_FIRST)
    record = falling.record()
    assert record.extras[DENSE] == falling.dense
    struck = np.flatnonzero(np.linalg.norm(record.ground_force, axis=1) > 1000.0)
    assert len(struck)
    inside = np.zeros(len(record), dtype=bool)
    for first, last in falling.dense:
        inside[first:last] = True
        assert np.diff(record.time[first:last]) == pytest.approx(HEAD_FIRST.time_step)
    assert inside[struck].all()
    assert np.diff(record.time[~inside]).min() >= 0.9e-3
    first, _ = falling.dense[0]
    assert not record.ground_force[first].any()  # steps are fine before the first touch


def test_a_fall_repeats_bit_for_bit_and_in_slices() -> None:
    whole, sliced = run(HEAD_FIRST), Falling(HEAD_FIRST)
    while not sliced.is_over:
        sliced.advance(37)
    assert same_samples(whole.record(), sliced.record())
    assert same_samples(whole.record(), run(HEAD_FIRST).record())


def test_a_whole_fall_is_evaluated_on_a_uniform_clock() -> None:
    record = simulate(HEAD_FIRST)
    even = record.uniform()
    assert even.is_uniform and not record.is_uniform
    assert even.time[-1] == pytest.approx(record.time[-1], abs=1e-4)
    peak = np.linalg.norm(record.head_acceleration, axis=1).max() / G
    assert evaluate(record).peak_g.value == pytest.approx(peak, rel=5e-3)


def test_a_sliding_rider_stops_as_friction_says() -> None:
    on_his_back = {"pitch_deg": -90.0, "height": 0.35, "preset": "pedestrian"}
    slide = Fall(speed=6.0, duration=2.5, **on_his_back)
    falling = run(slide)
    record = falling.record()
    momentum, _ = momenta(falling)
    along = momentum[:, 0] / falling.model.body_subtreemass[1]
    load = record.ground_force + record.body_ground_force
    lies = int(np.searchsorted(record.time, 0.4))  # the blow of landing is over
    stands = int(np.flatnonzero(along > 0.05)[-1])
    slides = slice(lies, stands)
    time = record.time[slides]
    mu = -np.trapezoid(load[slides, 0], time) / np.trapezoid(load[slides, 2], time)
    assert mu == pytest.approx(FRICTION, rel=0.05)
    assert abs(along[-1]) < 0.05
    way = np.trapezoid(along[slides], time)
    assert way == pytest.approx(along[lies] ** 2 / (2.0 * FRICTION * G), rel=0.1)
