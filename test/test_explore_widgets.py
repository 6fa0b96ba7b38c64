"""What stands on the explorer's page, on viser's server without a browser."""

from __future__ import annotations

import re
import time
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("viser", reason="the explorer needs the extra 'explore'")

from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.explore import markup, take
from helmet_sim_ros.explore.curves import CHARTS, at_time, chart_data, limit_of
from helmet_sim_ros.explore.page import Page
from helmet_sim_ros.explore.replay import sample_at
from helmet_sim_ros.explore.server import start_server
from helmet_sim_ros.explore.session import Session, Shown, digest
from helmet_sim_ros.explore.widgets import put

SOFT = ImpactSetup(rig="headform", normal_velocity=5.0, duration=0.03)
HARD = SOFT.replaced({"normal_velocity": 9.0, "duration": 0.02})


def until(condition, seconds: float = 200.0):
    """Wait for a true value and return it."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        found = condition()
        if found:
            return found
        time.sleep(0.02)
    raise AssertionError(f"not within {seconds:g} s")


def shown(setup: ImpactSetup, **other: object) -> Shown:
    record = simulate(setup)
    return Shown(setup, digest(record.setup), record, evaluate(record), **other)


@pytest.fixture(scope="module")
def impacts():
    return {"A": shown(SOFT), "B": shown(HARD)}


@pytest.fixture(scope="module")
def page():
    server = start_server(18900)
    page = Page(server)
    page.start()
    until(lambda: "A" in page._impacts)
    yield page
    page.close()
    server.stop()


@pytest.fixture
def session():
    session = Session()
    yield session
    session.close()


# words


def test_the_headline_has_cards_with_the_values_of_both_sides(impacts, session):
    text = markup.headline(session, impacts)
    for side, impact in impacts.items():
        assert f'data-side="{side}" data-digest="{impact.digest}"' in text
        for name in markup.CARDS:
            if name in impact.evaluation.criteria:
                value = impact.evaluation.criteria[name].value
                card = f'data-criterion="{name}" data-side="{side}" data-value="{value!r}"'
                assert card in text
    verdicts = [impact.evaluation.verdict for impact in impacts.values()]
    assert verdicts == ["pass", "fail"] == re.findall(r'hs-badge (\w+)">', text)
    assert 'class="hs-cards two"' in text and text.count('class="hs-card fail"') == 2
    alone = markup.headline(session, {"A": impacts["A"]})
    assert 'class="hs-cards"' in alone and 'class="hs-card fail"' not in alone
    assert "computing the first impact" in markup.headline(session, {})
    assert "computing the first impact" not in alone


def test_notes_say_whose_they_are_where_two_are_shown(impacts, session):
    crushed = shown(
        ImpactSetup(rig="headform", normal_velocity=15.0, duration=0.02,
                    overrides={"helmet.coupling": "foam"})
    )  # fmt: skip
    (note,) = crushed.evaluation.warnings
    both = markup.headline(session, {"A": impacts["A"], "B": crushed})
    assert f'<div class="hs-note">B: {note}' in both and both.count('class="hs-note"') == 1
    assert f'<div class="hs-note">{note}' in markup.headline(session, {"A": crushed})


def test_a_logged_impact_says_where_it_comes_from_and_a_failed_one_why(impacts, session):
    logged = {"A": shown(SOFT, origin="<log>, impact 1 of 2")}
    text = markup.headline(SimpleNamespace(pending=lambda side: False), logged)
    assert "&lt;log&gt;, impact 1 of 2</div>" in text and 'data-pending="false"' in text
    text = markup.headline(SimpleNamespace(pending=lambda side: True), logged)
    assert "computing the next…</div>" in text and 'data-pending="true"' in text
    failed = Shown(SOFT, "digest", None, None, error="diverged <b>")
    text = markup.headline(session, {"A": failed})
    assert "diverged &lt;b&gt;" in text and "5 m/s" in text and "data-criterion" not in text
    assert markup.problem("") == "" and "&lt;" in markup.problem("<")


def test_the_table_holds_every_criterion_once_with_limit_and_difference(impacts):
    differences = [("impact.normal_velocity", 5.0, 9.0)]
    text = markup.criteria(impacts, differences)
    rows = re.findall(r'data-row="(\w+)"', text)
    first, second = (impact.evaluation for impact in impacts.values())
    assert sorted(rows) == sorted({*first.criteria, *second.criteria})
    limited = [name for name in rows if first.criteria[name].limit is not None]
    assert rows[: len(limited)] == limited and limited
    low, high = (e.peak_g.value for e in (first, second))
    assert f"{100.0 * (high / low - 1.0):+.1f} %" in text
    assert text.count('<td class="fail">') == 2 and text.count("<th>B − A</th>") == 3
    assert "<code>impact.normal_velocity</code></td><td>5</td><td>9</td>" in text
    alone = markup.criteria({"A": impacts["A"]}, [])
    assert "B − A" not in alone and "B differs in" not in alone
    assert markup.criteria({}, []).count("<tr") == 0


@pytest.mark.parametrize(
    ("values", "text"),
    [([50.0, 75.0], "+50.0 %"), ([-2.0, -1.0], "+50.0 %"), ([2.0, 1.0], "-50.0 %"),
     ([0.0, 0.0], "0"), ([0.0, 3.0], "0"), ([1.0], "")],
)  # fmt: skip
def test_a_difference_is_a_share_of_the_first(values, text):
    assert markup._difference(values) == text


def test_a_description_is_shown_as_it_stands_and_not_as_markdown():
    text = "speeds (m/s) * 2 # [a](b) `c` \\d _e_ <f> g!"
    shown_as = take._plain(text)
    assert re.sub(r"\\(.)", r"\1", shown_as) == text
    assert all(shown_as[m.start() - 1] == "\\" for m in re.finditer(r"[*_`#<>\[\]()!]", shown_as))


# the page


def test_the_replay_goes_to_the_peak_and_shows_what_the_record_has_there(page):
    replay, impact = page._replay, page._impacts["A"]
    with page._lock:
        replay.to_peak()
    assert replay.time == pytest.approx(impact.evaluation.peak_g.time)
    now = at_time(impact.record, sample_at(impact, replay.time))
    assert f"<b>{now['acceleration']:.0f}</b> g" in replay._text.content
    assert now["acceleration"] == pytest.approx(impact.evaluation.peak_g.value, rel=1e-3)
    assert page._stages["A"]._helmet[0].position == pytest.approx(
        impact.record.helmet_position[sample_at(impact, replay.time)]
    )


def test_the_nearest_sample_of_a_time_is_one_that_is_there(impacts):
    impact = impacts["A"]
    step = impact.record.time_step
    assert [sample_at(impact, t) for t in (-1.0, 0.0, 0.6 * step, 1.4 * step, 10.0)] == [
        0, 0, 1, 1, len(impact.record) - 1,
    ]  # fmt: skip


def test_the_replay_moves_by_itself_until_it_pauses(page):
    replay = page._replay
    replay._set(0.0)
    replay._playing.set()
    until(lambda: replay.time > 0.0)
    replay.pause()
    with page._lock:
        assert 0.0 < replay.time <= 1e-3 * replay._time.max


def test_the_time_stays_within_the_longest_record(page, impacts):
    replay = page._replay
    with page._lock:
        before = replay._impacts
        replay.show(impacts)
        assert replay._time.max == pytest.approx(30.0)
        replay._set(25.0)
        replay.show({"B": impacts["B"]})
        assert replay._time.max == pytest.approx(20.0) and replay.time == pytest.approx(0.02)
        replay.show(before)


def test_charts_draw_the_records_of_both_sides(page, impacts):
    charts = page._charts
    with page._lock:
        charts.show(impacts)
        for chart, handle in zip(CHARTS, charts.handles, strict=True):
            expected = chart_data(chart, [impact.record for impact in impacts.values()])
            limit = limit_of(chart, [impact.evaluation for impact in impacts.values()])
            assert len(handle.data) == len(expected) + (limit is not None)
            for drawn, data in zip(handle.data, expected, strict=False):
                assert np.array_equal(drawn, data, equal_nan=True)
            words = [series["label"] for series in handle.series]
            assert len(words) == len(handle.data) and words[0] == "t [ms]"
            several = len(chart.labels) > 1
            expected_words = [
                f"{side} {name}" if several else side for side in "AB" for name in chart.labels
            ]
            limits = [] if limit is None else [f"limit {limit:g}"]
            assert words[1:] == expected_words + limits
        before = charts.handles
        charts.show(impacts)
        assert charts.handles == before  # nothing is made anew where nothing else is drawn
        charts.show(page._impacts)
        assert charts.handles != before
        for chart, handle in zip(CHARTS, charts.handles, strict=True):
            words = [series["label"] for series in handle.series]
            assert words[1:][: len(chart.labels)] == list(chart.labels)


def test_comparing_opens_the_other_side_and_ends_it(page):
    put(page._compare, True)
    until(lambda: "B" in page._impacts)
    assert page._turning.visible and page._side() == "B"
    put(page._compare, False)
    until(lambda: "B" not in page._impacts)
    assert not page._turning.visible and page._side() == "A"


def test_another_standard_judges_what_is_shown(page):
    put(page._standard, "fmvss_218")
    until(lambda: "dwell" in str(page._impacts["A"].evaluation.messages))
    assert page.session.standard == "fmvss_218"
    put(page._standard, "ece_r22_05")
    until(lambda: "dwell" not in str(page._impacts["A"].evaluation.messages))


def test_a_turned_control_is_the_setup_and_a_preset_all_controls(page):
    name = "impact.normal_velocity"
    page._turn._put(name, 6.5)
    page._changed(name)
    until(lambda: page._impacts["A"].record.setup[name] == 6.5)
    assert "normal_velocity=6.5" in page._take._texts.content
    page._load({name: 4.5, "impact.rig": "headform"})
    until(lambda: page._impacts["A"].record.setup[name] == 4.5)
    assert page._turn.content(name) == 4.5 and page._turn.content("impact.rig") == "headform"


def test_a_log_that_is_none_is_said_and_what_is_shown_stays(page, tmp_path):
    before = page._impacts["A"].digest
    page.log.open(str(tmp_path / "none.mcap"))
    assert "none.mcap" in page.session.refusal and "none.mcap" in page._problem.content
    assert page._impacts["A"].digest == before
    page._load({})
    assert page.session.refusal == "" and page._problem.content == markup.STYLE
