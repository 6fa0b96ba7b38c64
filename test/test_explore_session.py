"""The explorer without a browser: controls, session, presets, export, curves, meshes."""

from __future__ import annotations

import shlex
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import yaml

from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.biomech.pulse import magnitude
from helmet_sim_ros.biomech.record import same_samples
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.explore import export, meshes
from helmet_sim_ros.explore.controls import HELMET, control, controls
from helmet_sim_ros.explore.curves import CHARTS, at_time, chart_data, limit_line, limit_of
from helmet_sim_ros.explore.latest import LatestWins, Stale
from helmet_sim_ros.explore.presets import collections
from helmet_sim_ros.explore.session import Session, digest, logged_slot, slot_of
from helmet_sim_ros.model.helmet import Helmet, load_helmet
from helmet_sim_ros.model.setup import setup_from_names, setup_leaves
from helmet_sim_ros.present.words import unit_text
from helmet_sim_ros.schema import leaves
from helmet_sim_ros.study import load_scenario
from helmet_sim_ros.study.scenario.overrides import parse_overrides

PATIENCE = 200.0
SPEED = "impact.normal_velocity"


class Watched(Session):
    """A session that keeps what it shows."""

    def __init__(self) -> None:
        self.seen: list[tuple[str, object]] = []
        super().__init__(lambda side, shown: self.seen.append((side, shown)))

    def of(self, side: str):
        return [shown for s, shown in self.seen if s == side]


@pytest.fixture
def session():
    session = Watched()
    yield session
    session.close()


# controls


def test_every_value_of_a_setup_and_of_a_helmet_has_a_control():
    names = {each.name for each in controls()}
    assert names >= {leaf.name for leaf in setup_leaves()}
    assert names >= {leaf.name for leaf in leaves(Helmet, "helmet.")} - {"helmet.description"}
    assert HELMET in names and len(names) == len(controls())


def test_controls_say_unit_range_and_meaning_of_the_schema():
    for each in controls():
        assert each.leaf.description.lower()[:20] in each.hint.lower()
        assert each.leaf.allowed in each.hint and each.name in each.hint
        if each.leaf.unit not in ("", "-"):
            assert each.label.endswith(f"[{unit_text(each.leaf.unit)}]")
        if each.kind == "slider":
            assert each.leaf.minimum <= each.minimum < each.maximum == each.leaf.maximum
            assert each.minimum <= each.initial <= each.maximum
            assert 10 <= (each.maximum - each.minimum) / each.step <= 1000
        if each.kind == "menu":
            assert each.initial in each.choices


def test_both_ends_of_every_slider_are_accepted_or_refused_by_a_reason_of_the_model():
    for each in controls():
        if each.kind == "slider":
            for value in (each.minimum, each.maximum):
                value = int(value) if each.leaf.type is int else value
                try:
                    setup_from_names({each.name: value})
                except SetupError as error:
                    assert each.leaf.allowed not in str(error), each.name


def test_what_a_control_shows_reads_back_as_the_same_value():
    values = slot_of({}).values()
    assert set(values) == {each.name for each in controls()}
    for each in controls():
        again = each.parsed(each.shown(values[each.name]))
        if isinstance(values[each.name], list):
            again = list(again)
        assert again == values[each.name] or again == pytest.approx(values[each.name]), each.name


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("impact.neck_flexion_deg", "unset", None),
        ("impact.neck_flexion_deg", " ", None),
        ("impact.neck_flexion_deg", "12", 12),
        ("sim.time_step", "2e-5", 2e-5),
        ("helmet.shell.semi_axes", "0.15, 0.13, 0.14", (0.15, 0.13, 0.14)),
        ("helmet.shell.semi_axes", "[0.15, 0.13, 0.14]", (0.15, 0.13, 0.14)),
    ],
)
def test_typed_texts_are_read_as_meant(name, text, value):
    assert control(name).parsed(text) == value


def test_an_optional_value_with_limits_slides_from_what_it_resolves_to():
    friction = control("impact.friction")
    assert friction.kind == "slider" and friction.initial == ImpactSetup().described()[
        "impact.friction"
    ]  # fmt: skip
    assert slot_of({"impact.friction": friction.initial}).changes != {}
    assert slot_of({"impact.friction": None}).changes == {}


# the worker


def test_the_latest_request_of_each_key_wins_and_none_is_lost():
    answers: list[tuple[str, int]] = []
    gate = threading.Event()

    def compute(request: int, check) -> int:
        gate.wait(PATIENCE)
        check()
        return request

    worker = LatestWins(compute, lambda key, answer: answers.append((key, answer)))
    for number in range(100):
        worker.submit("a", number)
        worker.submit("b", -number)
    gate.set()
    assert worker.wait_idle(PATIENCE)
    worker.close()
    assert answers[-2:] == [("a", 99), ("b", -99)]
    assert [key for key, _ in answers].count("a") <= 2  # at most the one that was under way


def test_a_stale_computation_ends_as_soon_as_it_looks():
    looks: list[int] = []
    started = threading.Event()

    def compute(request: int, check) -> int:
        if request == 1:
            return request
        started.set()
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            try:
                check()
            except Stale:
                looks.append(request)
                raise
            time.sleep(0.001)  # stands for computing between two looks
        return request

    answers: list[int] = []
    worker = LatestWins(compute, lambda key, answer: answers.append(answer))
    worker.submit("a", 0)
    assert started.wait(PATIENCE)
    worker.submit("a", 1)
    assert worker.wait_idle(PATIENCE)
    worker.close()
    assert answers == [1] and looks == [0]


def test_an_answer_that_cannot_be_shown_does_not_end_the_worker(caplog):
    seen: list[int] = []

    def deliver(key: str, answer: int) -> None:
        if answer == 0:
            raise RuntimeError("the browser is gone")
        seen.append(answer)

    worker = LatestWins(lambda request, check: request, deliver)
    for number in (0, 1):
        worker.submit("a", number)
        assert worker.wait_idle(PATIENCE)
    worker.close()
    assert seen == [1] and "the browser is gone" in caplog.text


# the session


def test_what_is_shown_is_what_simulate_gives(session):
    session.start()
    assert session.change("A", SPEED, 7.5)
    assert session.change("A", "rider.mass", 90.0)
    assert session.wait_idle(PATIENCE)
    setup = ImpactSetup(normal_velocity=7.5, overrides={"rider.mass": 90.0})
    shown = session.latest("A")
    assert shown.setup == setup and same_samples(shown.record, simulate(setup))
    assert shown.evaluation.peak_g == evaluate(simulate(setup)).peak_g
    assert shown.digest == digest(setup.described()) == session.slot("A").digest
    assert not session.pending("A")


def test_fast_changes_show_only_whole_impacts_and_end_with_the_last(session):
    for number in range(200):
        session.change("A", SPEED, 3.0 + 0.02 * number)
        session.change("A", "impact.friction", 0.2 + 0.001 * number)
    assert session.wait_idle(PATIENCE)
    for shown in session.of("A"):
        assert shown.digest == digest(shown.setup.described()) == digest(shown.record.setup)
        assert shown.evaluation == evaluate(shown.record)
    last = session.of("A")[-1]
    assert last.setup.normal_velocity == pytest.approx(6.98)
    assert last.setup.friction == pytest.approx(0.399)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        (SPEED, 99.0, "from above 0 to 30 m/s"),
        (SPEED, "fast", "must be a number"),
        ("impact.rig", "bicycle", "rider, headform"),
        ("helmet.shell.semi_axes", "1, 2", "list of 3 numbers"),
        ("helmet.shell.semi_axes", "[1, {", "list of 3 numbers"),
        ("helmet.name", "no/such.yaml", "no such file"),
        ("helmet.nonsense", 1.0, "no such value"),
        ("helmet.inertia", "nan, 1, 1", "helmet.inertia"),
    ],
)
def test_a_refused_value_is_said_and_changes_nothing(session, name, content, words):
    before = session.slot("A")
    assert not session.change("A", name, content)
    assert words in session.refusal and session.slot("A") == before
    assert session.change("A", "impact.friction", 0.3) and session.refusal == ""


def test_a_refusal_stays_readable_when_the_browser_sets_the_field_to_the_limit(session):
    assert not session.change("A", SPEED, 99.0)
    assert session.change("A", SPEED, 30.0) and "99" in session.refusal
    assert session.change("A", SPEED, 20.0) and session.refusal == ""


def test_another_helmet_comes_with_its_own_values(session):
    session.change("A", "helmet.coupling", "foam")
    session.change("A", "helmet.liner.density", 80.0)
    assert session.slot("A").setup.helmet_config.liner.density == 80.0
    session.change("A", HELMET, "bicycle")
    assert session.slot("A").changes == {HELMET: "bicycle"}
    assert session.slot("A").setup.helmet_config == load_helmet("bicycle")


def test_a_value_without_effect_is_refused_and_one_that_stops_having_any_is_set_back(session):
    assert session.change("A", "helmet.spring.energy_loss", 0.9)
    assert session.change("A", "helmet.coupling", "foam")
    assert session.slot("A").changes == {"helmet.coupling": "foam"}
    assert "set back" in session.refusal and "helmet.spring.energy_loss" in session.refusal
    assert not session.change("A", "helmet.spring.energy_loss", 0.8)
    assert "no effect" in session.refusal
    assert session.slot("A").changes == {"helmet.coupling": "foam"}


def test_b_begins_as_a_and_is_told_apart(session):
    session.start()
    session.open_b()
    session.change("B", SPEED, 6.0)
    assert session.wait_idle(PATIENCE)
    assert session.differences() == [(SPEED, 5.0, 6.0)]
    a, b = session.latest("A"), session.latest("B")
    assert (a.setup.normal_velocity, b.setup.normal_velocity) == (5.0, 6.0)
    session.close_b()
    assert session.seen[-1] == ("B", None) and not session.has("B")
    assert session.differences() == []


def test_another_standard_judges_what_is_there(session):
    session.start()
    assert session.wait_idle(PATIENCE)
    assert session.judge_by("en_1078")
    assert session.wait_idle(PATIENCE)
    assert session.latest("A").evaluation.standard == "en_1078"
    assert not session.judge_by("nonsense") and "nonsense" in session.refusal
    assert session.standard == "en_1078"


def test_an_impact_that_cannot_be_judged_is_said_and_the_next_one_shown(session, tmp_path):
    file = tmp_path / "neck.yaml"
    limit = {"max": 1.0, "source": "a test", "verified": False}
    file.write_text(yaml.safe_dump({"title": "a", "limits": {"restitution": limit}}))
    session.judge_by(str(file))
    session.change("A", "sim.duration", "0.002")  # too short to rebound
    assert session.wait_idle(PATIENCE)
    shown = session.latest("A")
    assert shown.evaluation is None and "restitution" in shown.error
    session.judge_by("ece_r22_05")
    assert session.wait_idle(PATIENCE)
    assert session.latest("A").evaluation is not None and session.latest("A").error == ""


def test_a_logged_impact_is_shown_as_recorded_and_can_be_turned(session):
    setup = ImpactSetup(direction="front", normal_velocity=4.0, duration=0.02)
    record = simulate(setup)
    session.show_logged("A", record, "a.mcap, impact 1 of 1")
    assert session.wait_idle(PATIENCE)
    shown = session.latest("A")
    assert shown.record is record and shown.origin == "a.mcap, impact 1 of 1"
    assert shown.digest == digest(record.setup) and not session.pending("A")
    session.change("A", SPEED, 4.5)
    assert session.wait_idle(PATIENCE)
    again = session.latest("A")
    assert again.origin == ""
    assert same_samples(again.record, simulate(setup.replaced({"normal_velocity": 4.5})))
    assert (again.setup.direction, again.setup.duration) == ("front", 0.02)


def test_a_logged_setup_works_without_its_helmet_file():
    described = ImpactSetup(helmet="bicycle").described() | {HELMET: "gone/away.yaml"}
    slot = logged_slot(described)
    assert slot.setup.helmet_config.mass == load_helmet("bicycle").mass


# presets and export


def test_presets_are_the_cases_of_the_scenarios(tmp_path):
    file = tmp_path / "own.yaml"
    file.write_text("cases: [{name: mine, impact.friction: 0.7}]")
    found, problems = collections([str(file), str(tmp_path / "none.yaml")])
    assert found[0].name == "own" and found[0]["mine"].changes == {"impact.friction": 0.7}
    assert len(problems) == 1 and "none.yaml" in problems[0]
    table = next(c for c in found if c.name == "oblique_table1")
    setups = [slot_of(preset.changes).setup for preset in table.presets]
    assert setups == list(load_scenario("oblique_table1").setups)
    assert {"drop_tests", "single"} <= {collection.name for collection in found}


SETUPS = [
    {},
    {SPEED: 7.5, "impact.direction": "front", "sim.time_step": 2e-5},
    {HELMET: "bicycle", "helmet.coupling": "foam", "helmet.liner.front.density": 90.0},
    {"helmet.shell.semi_axes": (0.16, 0.13, 0.14), "impact.neck_flexion_deg": -3.0},
    {"impact.rig": "headform", "rider.posture.elbow_flexion_deg": 45.0},
]


@pytest.mark.parametrize("changes", SETUPS)
def test_every_text_to_take_away_gives_the_same_setup(changes, tmp_path):
    slot = slot_of(changes)
    file = tmp_path / "mine.yaml"
    file.write_text(export.as_yaml(slot.changes), encoding="utf-8")
    assert load_scenario(file).setups == (slot.setup,)
    words = shlex.split(export.as_command(slot.changes))
    assert words[:3] == ["helmet-sim", "run", "single"] and set(words[3::2]) <= {"-o"}
    assert load_scenario(words[2], overrides=parse_overrides(words[4::2])).setups == (slot.setup,)
    program = export.as_python(slot.changes).partition("result =")[0]
    names: dict[str, object] = {}
    exec(program, names)
    assert names["setup"] == slot.setup


def test_a_slot_keeps_no_change_that_is_none():
    assert slot_of({SPEED: 5.0, HELMET: "fullface", "helmet.mass": 1.35}).changes == {
        HELMET: "fullface"
    }


# what the charts draw


def test_charts_meet_the_peaks_of_both_impacts():
    records = [simulate(ImpactSetup(normal_velocity=v, duration=0.05)) for v in (4.0, 8.0)]
    for chart in CHARTS:
        times, *curves = chart_data(chart, records)
        assert (np.diff(times) > 0.0).all() and len(curves) == 2 * len(chart.series)
        exact = [history(record) for record in records for _, history in chart.series]
        for curve, history in zip(curves, exact, strict=True):
            assert np.nanmax(curve) == pytest.approx(history.max(), rel=1e-12)


def test_charts_of_different_length_end_where_their_impact_ends():
    long, short = (simulate(ImpactSetup(duration=d)) for d in (0.03, 0.01))
    times, _, curve = chart_data(CHARTS[0], [long, short])
    assert np.isnan(curve[times > 10.0 + 1e-9]).all() and times[-1] == pytest.approx(30.0)
    _, nothing = chart_data(CHARTS[0], [None])
    assert np.isfinite(nothing).sum() == 1


def test_the_limit_is_drawn_while_it_is_in_sight():
    weak, strong = (simulate(ImpactSetup(normal_velocity=v)) for v in (2.0, 8.0))
    for record, seen in ((weak, False), (strong, True)):
        limit = limit_of(CHARTS[0], [evaluate(record)])
        assert limit == 275.0
        line = limit_line(limit, chart_data(CHARTS[0], [record]))
        assert (line == 275.0).all() == seen
    assert limit_of(CHARTS[1], [evaluate(weak)]) is None


def test_the_replay_says_what_the_record_holds():
    record = simulate(ImpactSetup())
    now = at_time(record, 100)
    assert now["time"] == pytest.approx(5.0)
    assert now["acceleration"] == pytest.approx(
        float(magnitude(record.head_acceleration)[100]) / 9.80665
    )
    assert now["normal"] == pytest.approx(record.ground_force[100, 2] / 1e3)


# meshes


@pytest.mark.parametrize(
    ("mesh", "volume"),
    [
        (meshes.box((0.1, 0.2, 0.3)), 0.048),
        (meshes.cylinder(0.1, 0.2), np.pi * 0.01 * 0.4),
        (meshes.capsule(0.1, 0.2), np.pi * 0.01 * 0.4 + 4 / 3 * np.pi * 1e-3),
        (meshes.sphere(), 4 / 3 * np.pi),
    ],
)
def test_meshes_are_closed_and_have_the_volume_of_their_shape(mesh, volume):
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    found = float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)  # divergence theorem
    assert found == pytest.approx(volume, rel=0.05)


def test_a_part_of_a_trunk_has_its_semi_axes_and_is_fuller_than_its_ellipsoid():
    axes = (0.2, 0.1, 0.3)
    inner, outer = meshes.ellipsoid(axes), meshes.rounded(axes)
    assert ((inner.vertices / axes) ** 2).sum(axis=1) == pytest.approx(1.0)
    assert np.abs(outer.vertices).max(axis=0) == pytest.approx(axes, rel=0.02)
    assert ((outer.vertices / axes) ** 2).sum(axis=1).min() > 1.0 - 1e-9


@pytest.mark.parametrize(("name", "visor"), [("fullface", True), ("bicycle", False)])
def test_a_helmet_is_drawn_within_its_shell_with_an_opening_to_the_front(name, visor):
    helmet = load_helmet(name)
    shell, glass = meshes.helmet_mesh(helmet)
    scaled = (shell.vertices - helmet.shell.center) / helmet.shell.semi_axes
    radius = np.linalg.norm(scaled, axis=1)
    assert radius.max() == pytest.approx(1.0) and radius.min() > 0.9
    assert (len(glass.faces) > 0) == visor
    middle = scaled[shell.faces].mean(axis=1)
    forwards = middle[:, 0] > 0.993  # nothing of the shell where he looks out
    assert not forwards.any()
    assert (middle[:, 0] < -0.95).any() or not visor


def test_nothing_of_the_session_needs_the_browser(tmp_path: Path):
    import subprocess
    import sys

    code = (
        "import sys; sys.modules['viser'] = None\n"
        "from helmet_sim_ros.explore import session, presets, export, curves, meshes\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path)
