"""Standards are data: shipped ones are sound, a user adds one by adding a file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from test_biomech_evaluation import drop_record

from helmet_sim_ros.biomech import CATALOGUE, evaluate, load_standard, standard_names
from helmet_sim_ros.errors import PulseError, SetupError


def test_every_standard_of_the_scope_is_shipped() -> None:
    families = ("ece_r22_05", "ece_r22_06_linear", "ece_r22_06_oblique", "fmvss_218",
                "snell_m2020", "fim_frhphe_01", "fim_frhphe_02", "en_1078")  # fmt: skip
    for family in families:
        assert any(name.startswith(family) for name in standard_names()), family


@pytest.mark.parametrize("name", standard_names())
def test_every_shipped_limit_has_a_source_and_every_verdict_says_if_it_is_unverified(
    name: str,
) -> None:
    result = evaluate(drop_record(), name)
    for key, limit in load_standard(name).limits.items():
        criterion = result.criteria[key]
        assert limit.source and criterion.source == limit.source
        assert criterion.limit == limit.max
        assert criterion.verdict == ("fail" if criterion.value > limit.max else "pass")
        line = next(m for m in result.messages if m.startswith(f"{key} ("))
        for text in (criterion.note, line):
            assert ("not verified against the primary text" in text) == (not limit.verified)


USERS = """
title: House limits
normal_velocity: 6.0
limits:
  hic15: {max: 700, source: 49 CFR 571.208, verified: true}
  dwell_123g: {max: 0.001, source: our own, verified: true}
"""


def test_a_user_adds_a_standard_by_adding_a_file(tmp_path: Path) -> None:
    path = tmp_path / "house.yaml"
    path.write_text(USERS)
    result = evaluate(drop_record(peak_g=200.0), str(path))
    assert result.verdict == "fail"
    assert result.title == "House limits"
    assert result.hic15.verdict == result.dwell_123g.verdict == "fail"
    assert result.peak_g.verdict == "info"
    assert result.dwell_123g.unit == "s"
    assert result.messages[0].startswith("hic15 (HIC, 15 ms window): 2345 exceeds the limit of 700")
    assert result.messages[1].startswith("dwell_123g (time above 123 g): 5.")
    assert "ms exceeds the limit of 1 ms" in result.messages[1]
    assert not any("verified" in line for line in result.messages)


def test_a_changed_file_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "house.yaml"
    path.write_text(USERS)
    assert load_standard(str(path)).limits["hic15"].max == 700
    path.write_text(USERS.replace("700", "1000000"))
    assert load_standard(str(path)).limits["hic15"].max == 1000000


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("hic15:", "hic_15:", "limits.hic_15 .*unknown criterion.*hic15"),
        ("max: 700", "max: -1", "max = -1: must be a number >= 0"),
        ("max: 700", "max: .nan", "max"),
        ("max: 700", "max: high", "max"),
        ("max: 700, ", "", "max"),
        ("verified: true", "verified: maybe", "verified"),
        ("source: our own, ", "", "source"),
        ("title: House limits", "", "title"),
        ("title:", "titel: x\ntitle:", "titel.*unknown key"),
        ("normal_velocity: 6.0", "normal_velocity: 0", "normal_velocity"),
        (USERS[USERS.index("limits:") :], "limits: {}", "at least one limit"),
        (USERS, "[1, 2", "cannot be read"),
        (USERS, "- 1", "must be a mapping"),
    ],
)
def test_a_bad_file_is_refused_by_key(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "house.yaml"
    path.write_text(USERS.replace(old, new))
    with pytest.raises(SetupError, match=f"(?s)house.yaml.*{words}"):
        load_standard(str(path))


def test_a_missing_file_is_refused() -> None:
    with pytest.raises(SetupError, match="no such file"):
        load_standard("nowhere/house.yaml")


def test_another_speed_than_the_standards_is_said() -> None:
    from dataclasses import replace

    record = replace(drop_record(), setup={"impact.normal_velocity": 5.0})
    assert (
        "at 5 m/s, the standard's test is at 7.5 m/s" in evaluate(record, "ece_r22_05").warnings[0]
    )
    due = replace(record, setup={"impact.normal_velocity": 7.5})
    assert evaluate(due, "ece_r22_05").warnings == ()
    assert evaluate(record).warnings == ()  # nobody asked for the standard's test


def test_a_limit_that_the_record_cannot_answer_is_an_error() -> None:
    with pytest.raises(PulseError, match=r"peak_g_cfc1000: fmvss_218 limits it.*too coarse"):
        evaluate(drop_record(step=5e-4), "fmvss_218")


def test_samples_at_twice_the_corner_of_cfc_1000_give_no_filtered_criterion() -> None:
    limit = 1.0 / (2.0 * 2.0775 * 1000.0)
    for step in (limit, np.nextafter(limit, 1.0)):
        result = evaluate(drop_record(step=step))
        assert not [name for name in result.criteria if name.endswith("cfc1000")]
    assert "peak_g_cfc1000" in evaluate(drop_record(step=0.999 * limit)).criteria


def test_every_criterion_is_in_the_catalogue_with_its_unit() -> None:
    result = evaluate(drop_record())
    missing = set(CATALOGUE) - set(result.criteria)
    assert missing == {"bottoming"}  # the record has no setup
    for name, criterion in result.criteria.items():
        assert criterion.name == name and criterion.unit == CATALOGUE[name].unit


def test_the_documentation_names_every_standard_and_criterion() -> None:
    from helmet_sim_ros.resources import share_directory

    text = (share_directory() / "docs" / "criteria.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([a-z0-9_]+)`", text))
    for name in standard_names():
        assert name in named or name.rsplit("_", 1)[0] + "_low" in named, name
    ranges = r"risk_(hic|bric)_ais[234]"  # written as "... to ..."
    for name in CATALOGUE:
        base = re.sub(r"_cfc\d+$", "", name)
        assert base in named or re.fullmatch(ranges, base), name


@pytest.mark.parametrize(
    ("speed", "said"), [(7.36, False), (7.64, False), (7.34, True), (7.66, True)]
)
def test_a_speed_is_another_from_2_percent_on(speed: float, said: bool) -> None:
    from dataclasses import replace

    record = replace(drop_record(), setup={"impact.normal_velocity": speed})
    assert bool(evaluate(record, "ece_r22_05").warnings) == said


def test_a_value_just_at_its_limit_passes_and_what_fails_is_told_first(tmp_path: Path) -> None:
    record = drop_record(peak_g=200.0)
    values = evaluate(record).criteria
    below = float(np.nextafter(values["gsi"].value, 0.0))
    limits = {"peak_g": values["peak_g"].value, "gsi": below, "dwell_150g": 0.010}
    lines = [f"  {n}: {{max: {x!r}, source: s, verified: true}}" for n, x in limits.items()]
    path = tmp_path / "house.yaml"
    path.write_text("\n".join(["title: t", "limits:", *lines]))
    result = evaluate(record, str(path))
    assert [result.criteria[n].verdict for n in ("peak_g", "gsi", "dwell_150g")] == [
        "pass", "fail", "pass",
    ]  # fmt: skip
    assert [m.split(" ")[0] for m in result.messages] == ["gsi", "peak_g", "dwell_150g"]
    over = 0.010 - values["dwell_150g"].value
    assert result.messages[2].endswith(
        f"is within the limit of 10 ms by {1e3 * over:.4g} ms ({over / 0.010:.1%})"
    )
