"""How setups, records and evaluations present themselves, and what refused names are met with."""

from __future__ import annotations

import subprocess
import sys
from html.parser import HTMLParser

import numpy as np
import pytest

from helmet_sim_ros import ImpactSetup, Rider, compare, evaluate, simulate
from helmet_sim_ros.biomech.pulse import magnitude
from helmet_sim_ros.errors import HelmetSimError, PulseError, SetupError
from helmet_sim_ros.extra import MissingExtraError, need
from helmet_sim_ros.present.words import quantity_text

SETUP = ImpactSetup(normal_velocity=7.5, rider=Rider(mass=90.0), duration=0.02)


@pytest.fixture(scope="module")
def record():
    return simulate(SETUP)


class Markup(HTMLParser):
    """Checks that every tag is closed, and keeps the text."""

    VOID = ("br", "polyline", "hr")

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text = ""
        self.tags: set[str] = set()
        self.feed(html)
        assert not self.open, self.open

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data + " "


# in a line


def test_a_setup_is_written_as_what_differs_and_reads_back():
    assert repr(ImpactSetup()) == "ImpactSetup()"
    text = repr(SETUP)
    assert text == "ImpactSetup(normal_velocity=7.5, rider=Rider(mass=90.0), duration=0.02)"
    assert eval(text) == SETUP
    varied = ImpactSetup(overrides={"helmet.liner.density": 60.0})
    assert eval(repr(varied)) == varied


def test_records_and_evaluations_are_written_in_a_line(record):
    peak = magnitude(record.head_acceleration).max() / 9.80665
    assert repr(record) == (
        f"<ImpactRecord: rider, left, 7.5 m/s; 401 samples in 20 ms, peak {peak:.1f} g>"
    )
    result = evaluate(record)
    assert repr(result).startswith(f"<Evaluation by ece_r22_05: {result.verdict}; peak_g ")
    assert f"{result.peak_g.value:.4g} g (limit 275 g)" in repr(result)
    assert len(repr(result)) < 200


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(124.717, "g", "124.7 g"), (0.01436, "m", "14.36 mm"), (5710.2, "rad/s^2", "5710 rad/s²"),
     (601.03, "-", "601"), (0.0065, "s", "6.5 ms")],
)  # fmt: skip
def test_numbers_are_written_with_four_digits_and_handy_units(value, unit, text):
    assert quantity_text(value, unit) == text


# as HTML


def test_each_has_html_that_is_whole_and_holds_its_numbers(record):
    setup = Markup(SETUP._repr_html_())
    head, _, every = setup.text.partition("all")
    assert "impact.normal_velocity" in head and "7.5" in head and "kg" in head
    assert "impact.friction" not in head and "impact.friction" in every
    shown = Markup(record._repr_html_())
    assert "401 samples in 20 ms" in shown.text and {"svg", "polyline"} <= shown.tags
    result = evaluate(record)
    page = Markup(result._repr_html_())
    assert f"{result.peak_g.value:.4g} g" in page.text and "275 g" in page.text
    assert set(result.criteria) <= set(page.text.split())


def test_no_text_of_a_setup_becomes_markup(record):
    from dataclasses import replace

    evil = "<script>alert(1)</script>"
    strange = replace(record, setup={"impact.direction": evil, "impact.rig": evil})
    assert "<script" not in strange._repr_html_()
    assert "<script" not in compare([strange, record])._repr_html_()


# as tables and figures


def test_a_record_becomes_a_table_with_units(record):
    pytest.importorskip("pandas", reason="tables need the extra 'report'")
    frame = record.frame()
    assert frame.index.name == "time" and len(frame) == len(record)
    assert np.array_equal(frame["ground_force.z"], record.ground_force[:, 2])
    assert frame.attrs["units"]["head_acceleration.x"] == "m/s^2"
    assert set(frame.columns) < set(frame.attrs["units"])
    assert frame.attrs["setup"] == dict(record.setup)


def test_an_evaluation_becomes_a_table_with_units(record):
    pytest.importorskip("pandas", reason="tables need the extra 'report'")
    result = evaluate(record)
    frame = result.frame()
    assert list(frame.index) == list(result.criteria) and frame.index.name == "criterion"
    assert frame.loc["hic", "value"] == result.hic.value
    assert frame.loc["peak_g", "limit"] == 275.0 and frame.loc["peak_g", "verdict"] == "pass"
    assert frame.attrs["units"]["peak_compression"] == frame.loc["peak_compression", "unit"] == "m"


def test_a_record_plots_its_histories(record):
    pytest.importorskip("matplotlib", reason="figures need the extra 'report'")
    figure = record.plot()
    curves = [line for axes in figure.axes for line in axes.lines]
    peak = magnitude(record.head_acceleration).max() / 9.80665
    assert any(line.get_ydata().max() == pytest.approx(peak) for line in curves)
    assert len(curves) == 6 and "7.5 m/s" in figure.get_suptitle()
    assert figure._repr_png_().startswith(b"\x89PNG")


# side by side


def test_compare_shows_what_differs_and_what_came_of_it(record):
    pytest.importorskip("pandas", reason="tables need the extra 'report'")
    other = simulate(SETUP.replaced({"friction": 0.2}))
    found = compare([record, other], names=["rough", "smooth"])
    frame = found.frame()
    assert list(frame.columns) == ["rough", "smooth"]
    assert list(found.setups) == ["impact.friction"]
    assert frame.loc["impact.friction"].tolist() == [0.4, 0.2]
    for column, one in (("rough", record), ("smooth", other)):
        assert frame.loc["peak_g", column] == evaluate(one).peak_g.value
        assert frame.loc["verdict", column] == evaluate(one).verdict
    assert frame.attrs["units"]["peak_g"] == "g"
    assert "impact.friction" in repr(found) and "impact.friction" in found._repr_html_()


def test_compare_takes_evaluations_and_setups_too(record):
    result = evaluate(record, "en_1078")
    found = compare([result, ImpactSetup(), record], criteria=["peak_g"])
    assert found.names == ("1", "2", "3")
    assert found.criteria["peak_g"] == (result.peak_g.value, None, result.peak_g.value)
    assert found.setups["impact.normal_velocity"] == (None, 5.0, 7.5)
    assert found.verdicts[1] is None and len(repr(found).splitlines()) == 6


@pytest.mark.parametrize(
    ("items", "options", "words"),
    [
        ([], {}, "nothing to compare"),
        ([3], {}, "int is none of"),
        ([ImpactSetup()], {"names": ["a", "b"]}, "2 names for 1"),
    ],
)
def test_compare_says_what_it_refuses(items, options, words):
    with pytest.raises(PulseError, match=words):
        compare(items, **options)


def test_compare_knows_a_criterion_that_is_nearly_meant(record):
    with pytest.raises(PulseError, match="did you mean 'peak_g'"):
        compare([record], criteria=["peakg"])


# did you mean


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        ({"normal_velocty": 3.0}, "normal_velocity"),
        ({"direction": "frnt"}, "front"),
        ({"rig": "Headform"}, "headform"),
        ({"helmet": "fulface"}, "fullface"),
        ({"overrides": {"impact.frction": 0.1}}, "impact.friction"),
        ({"overrides": {"helmet.liner.densty": 60.0}}, "liner.density"),
        ({"overrides": {"helmet.coupling": "foan"}}, "foam"),
        ({"overrides": {"rider.posture.elbow_flexion": 1.0}}, "posture.elbow_flexion_deg"),
    ],
)
def test_a_refused_name_is_met_with_the_nearest_known_one(arguments, meant):
    with pytest.raises(SetupError) as refused:
        ImpactSetup(**arguments)
    assert str(refused.value).endswith(f"did you mean {meant!r}?")


def test_a_criterion_that_is_nearly_meant(record):
    result = evaluate(record)
    with pytest.raises(AttributeError, match="did you mean 'peak_g'"):
        _ = result.peekg
    with pytest.raises(PulseError, match="did you mean 'hic15'"):
        evaluate(record, criteria=["hic_15"])
    with pytest.raises(SetupError, match="did you mean 'ece_r22_05'"):
        evaluate(record, "ece_r2205")


def test_nothing_is_guessed_where_nothing_is_near():
    with pytest.raises(SetupError) as refused:
        ImpactSetup(direction="zzz")
    assert "did you mean" not in str(refused.value)


# light


def test_a_missing_extra_names_the_line_that_brings_it():
    with pytest.raises(MissingExtraError, match=r"pip install 'helmet_sim_ros\[report\]'"):
        need("no_such_library", "report")
    assert issubclass(MissingExtraError, HelmetSimError)
    code = (
        "import sys; sys.modules['pandas'] = sys.modules['matplotlib'] = None\n"
        "from helmet_sim_ros import ImpactSetup, evaluate, simulate\n"
        "from helmet_sim_ros.errors import HelmetSimError\n"
        "record = simulate(ImpactSetup(duration=0.002))\n"
        "for draw in (record.frame, record.plot, evaluate(record).frame):\n"
        "    try:\n"
        "        draw()\n"
        "    except HelmetSimError as error:\n"
        "        print(error)\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.count("pip install 'helmet_sim_ros[report]'") == 3


def test_simulating_and_writing_loads_neither_pandas_nor_matplotlib():
    code = (
        "import sys\n"
        "from helmet_sim_ros import ImpactSetup, compare, evaluate, simulate\n"
        "record = simulate(ImpactSetup(duration=0.002))\n"
        "print(repr(record), record._repr_html_(), repr(evaluate(record)), compare([record]))\n"
        "assert not {'pandas', 'matplotlib', 'viser'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
