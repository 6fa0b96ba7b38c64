"""evaluate() for some criteria only: the same numbers, and nothing else computed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helmet_sim_ros.biomech import CATALOGUE, Evaluation, ImpactRecord, evaluate
from helmet_sim_ros.biomech.record import CHANNELS
from helmet_sim_ros.errors import PulseError

#: What the default standard limits, so what is always there.
LIMITED = {"peak_g", "hic"}
FILTERED = {name for name in CATALOGUE if name.endswith(("_cfc1000", "_cfc600"))}
G = 9.80665


def busy_record(step: float = 5e-5, samples: int = 801) -> ImpactRecord:
    """A head that rebounds after a blow, with another smooth signal on every other channel."""
    random = np.random.default_rng(11)
    time = np.arange(samples) * step

    def wave(labels: tuple[str, ...]) -> np.ndarray:
        phase = random.uniform(0.0, 6.0, len(labels))
        centre = random.uniform(0.3, 0.6) * time[-1]
        envelope = np.exp(-(((time - centre) / (0.2 * time[-1])) ** 2))
        turns = 2.0 * np.pi * random.uniform(1.0, 3.0, len(labels)) / time[-1]
        return envelope[:, None] * np.sin(np.outer(time, turns) + phase)

    arrays = {name: wave(labels) for name, (labels, _) in CHANNELS.items()}
    for name, size in (
        ("head_angular_acceleration", 5000.0), ("head_angular_velocity", 30.0),
        ("ground_force", 6000.0), ("coupling_force", 5000.0), ("coupling_displacement", 0.02),
        ("neck_force", 900.0), ("neck_torque", 40.0),
    ):  # fmt: skip
        arrays[name] *= size
    for name in ("head_orientation", "helmet_orientation"):
        arrays[name][:, 3] += 2.0
        arrays[name] /= np.linalg.norm(arrays[name], axis=1)[:, None]
    arrays["ground_force"][:, 2] = np.abs(arrays["ground_force"][:, 2])
    acceleration = arrays["head_acceleration"]
    acceleration *= 20.0 * G
    acceleration[:, 2] += 230.0 * G * np.exp(-(((time / time[-1] - 0.4) / 0.1) ** 2))
    change = np.zeros_like(acceleration)
    change[1:] = np.cumsum(0.5 * step * (acceleration[1:] + acceleration[:-1]), axis=0)
    arrays["head_velocity"] = change - 0.7 * change[-1]
    return ImpactRecord(time=time, **arrays, setup={"helmet.liner.thickness": 0.04})


RECORD = busy_record()


@pytest.fixture(scope="module")
def full() -> Evaluation:
    return evaluate(RECORD)


def test_all_criteria_are_those_of_the_catalogue(full: Evaluation) -> None:
    assert set(full.criteria) == set(CATALOGUE)
    assert evaluate(RECORD, criteria=CATALOGUE) == full
    assert all(c.value != 0.0 for c in full.criteria.values())


@pytest.mark.parametrize("name", CATALOGUE)
def test_one_criterion_alone_is_that_of_the_full_evaluation(full: Evaluation, name: str) -> None:
    alone = evaluate(RECORD, criteria=[name])
    assert set(alone.criteria) == {name} | LIMITED
    assert all(alone.criteria[key] == full.criteria[key] for key in alone.criteria)
    assert (alone.verdict, alone.messages) == (full.verdict, full.messages)


def test_neither_order_nor_repetition_matters(full: Evaluation) -> None:
    one = evaluate(RECORD, criteria=("ric", "klc", "hic36_cfc1000", "ric"))
    other = evaluate(RECORD, criteria=iter(["hic36_cfc1000", "klc", "ric"]))
    assert one.to_json() == other.to_json()
    assert list(one.criteria) == [name for name in full.criteria if name in one.criteria]


@pytest.mark.parametrize("criteria", [(), ("bric",), ("peak_g_cfc1000", "damage")])
@pytest.mark.parametrize("standard", ["fmvss_218", "ece_r22_06_oblique"])
def test_the_limits_of_the_standard_are_always_judged(
    standard: str, criteria: tuple[str, ...]
) -> None:
    whole, part = evaluate(RECORD, standard), evaluate(RECORD, standard, criteria)
    limited = {name for name, c in whole.criteria.items() if c.limit is not None}
    assert limited and set(part.criteria) == limited | set(criteria)
    assert part.messages == whole.messages and part.verdict == whole.verdict
    assert part.warnings == whole.warnings


@pytest.mark.parametrize("name", ["peak_gee", "bric_cfc1000", "dwell_0g", ""])
def test_an_unknown_criterion_is_refused_by_name(name: str) -> None:
    with pytest.raises(PulseError, match=f"unknown criterion {name!r}; known: "):
        evaluate(RECORD, criteria=["hic", name])


def test_of_the_known_criteria_the_three_nearest_are_told() -> None:
    with pytest.raises(PulseError) as refused:
        evaluate(RECORD, criteria=["peak_neck"])
    known = str(refused.value).partition("known: ")[2].partition(";")[0].split(", ")
    assert len(known) == 3 and all(name.startswith("peak_neck_") for name in known)


def test_one_text_is_not_taken_for_names() -> None:
    with pytest.raises(PulseError, match="criteria = 'hic'"):
        evaluate(RECORD, criteria="hic")


def test_a_dwell_time_above_any_level_can_be_asked_for(full: Evaluation) -> None:
    found = evaluate(RECORD, criteria=["dwell_120g", "dwell_120g_cfc1000", "dwell_150g"])
    assert evaluate(RECORD, criteria=["dwell_1g"]).dwell_1g.value > found.dwell_120g.value
    assert found.dwell_150g == full.dwell_150g
    assert found.dwell_120g.value > found.dwell_150g.value > 0.0
    assert found.dwell_120g_cfc1000.value == pytest.approx(found.dwell_120g.value, rel=1e-3)
    assert found.dwell_120g_cfc1000.value != found.dwell_120g.value


def test_warnings_are_about_what_was_asked_for() -> None:
    short = evaluate(busy_record(samples=51), criteria=["clip_3ms"])
    assert short.warnings == ("clip_3ms: the record is shorter than 3 ms",)
    assert set(short.criteria) == LIMITED
    coarse = busy_record(step=1.25e-4)
    assert "needs at least 10 kHz" in evaluate(coarse, criteria=["gsi_cfc1000"]).warnings[0]
    coarser = evaluate(busy_record(step=5e-4), criteria=FILTERED)
    assert len(coarser.warnings) == 1 and "no CFC 1000 values" in coarser.warnings[0]
    assert set(coarser.criteria) == LIMITED
    falling = replace(RECORD, head_velocity=RECORD.head_velocity - 100.0)
    assert "restitution" in evaluate(falling, criteria=["restitution"]).warnings[0]
    for record in (busy_record(samples=51), coarse, busy_record(step=5e-4), falling):
        assert evaluate(record).warnings != ()
        assert evaluate(record, criteria=["bric", "gsi"]).warnings == ()


@pytest.mark.parametrize("name", ["neck_torque", "coupling_force", "head_angular_velocity"])
def test_a_channel_that_nobody_needs_is_checked_all_the_same(name: str) -> None:
    record = busy_record()
    getattr(record, name)[17, 1] = np.nan
    with pytest.raises(PulseError, match=f"{name}: not finite at sample 17"):
        evaluate(record, criteria=["peak_g"])


def test_numbers_of_any_real_kind_are_read_and_complex_ones_refused() -> None:
    single = RECORD.neck_force.astype(np.float32)
    criteria = ["peak_neck_shear"]
    expected = evaluate(replace(RECORD, neck_force=single.astype(float)), criteria=criteria)
    for kind in (np.float32, np.longdouble, object):
        assert evaluate(replace(RECORD, neck_force=single.astype(kind)), None, criteria) == expected
    with pytest.raises(PulseError, match="neck_force: must be an array of real numbers"):
        evaluate(replace(RECORD, neck_force=single * 1j), criteria=criteria)
