"""Helmets fitted to measured acceleration histories, synthetic ones with a known truth."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY
from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.cli import main
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.helmet import load_helmet
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.study.identification.histories import (
    MeasuredDrop,
    is_history_table,
    read_histories,
    read_history,
)
from helmet_sim_ros.study.identification.history_fit import HistoryFit, fit_histories

TRUTH = {"helmet.liner.density": 72.0, "helmet.liner.energy_returned": 0.12}


def measured(direction: str, speed: float, coupling: str = "foam") -> tuple[FloatArray, FloatArray]:
    """A drop of the helmet that is to be found again: time [s] and resultant [g]."""
    truth = TRUTH if coupling == "foam" else {
        "helmet.spring.front.A": 30e3, "helmet.spring.front.B": 12.0}  # fmt: skip
    setup = ImpactSetup(
        rig="headform", direction=direction, normal_velocity=speed, duration=0.025,
        overrides={**truth, "helmet.coupling": coupling},
    )  # fmt: skip
    record = simulate(setup)
    return record.time, np.linalg.norm(record.head_acceleration, axis=1) / STANDARD_GRAVITY


def laboratory(
    folder: Path, tests: list[tuple[str, float]], noise: float = 1.0, coupling: str = "foam"
) -> Path:
    """A table that lists one CSV file per test, triggered at other times, with noise [g]."""
    random = np.random.default_rng(0)
    lines = ["file;direction;speed [m/s]"]
    for n, (direction, speed) in enumerate(tests):
        time, amount = measured(direction, speed, coupling)
        amount = np.interp(time, time + 1.5e-3 * n, amount, left=0.0)
        amount = np.abs(amount + noise * random.standard_normal(len(amount)))
        text = "time [ms];resultant [g]\n" + "".join(
            f"{1e3 * t:.3f};{a:.4f}\n" for t, a in zip(time, amount, strict=True)
        )
        (folder / f"test{n}.csv").write_text(text.replace(".", ","))
        lines.append(f"test{n}.csv;{direction};{speed}")
    (folder / "tests.csv").write_text("\n".join(lines))
    return folder / "tests.csv"


def test_density_and_energy_returned_are_found_again(tmp_path: Path) -> None:
    table = laboratory(tmp_path, [("front", 5.0), ("left", 7.0)])
    fit = fit_histories(read_histories(table), "fullface")
    density, returned = fit.parameters
    assert density.value == pytest.approx(72.0, rel=0.02)
    assert density.low <= 72.0 <= density.high or density.value == pytest.approx(72.0, rel=0.005)
    assert returned.value == pytest.approx(0.12, rel=0.25)
    assert fit.rank == 2 and not density.open
    assert max(fit.error) < 0.03


def test_what_a_drop_cannot_show_is_called_open(tmp_path: Path) -> None:
    """A blow on the front tells nothing of the foam at the back."""
    table = laboratory(tmp_path, [("front", 6.0)])
    names = ("liner.density", "liner.back.density")
    base = tmp_path / "base.yaml"
    from helmet_sim_ros.study.identification.fit import write_helmet

    helmet = load_helmet("fullface").replaced({"liner.back.density": 50.0})
    write_helmet(helmet, base, "with a zone")
    fit = fit_histories(read_histories(table), str(base), names)
    assert fit.rank == 1
    assert [p.open for p in fit.parameters] == [False, True]
    assert any("do not tell liner.back.density" in note for note in fit.notes)


def test_a_springs_law_is_found_from_two_speeds(tmp_path: Path) -> None:
    table = laboratory(tmp_path, [("front", 4.0), ("front", 7.5)], coupling="spring")
    names = ("spring.front.A", "spring.front.B")
    fit = fit_histories(read_histories(table), "fullface", names, coupling="spring")
    a, b = fit.parameters
    assert a.value * b.value == pytest.approx(30e3 * 12.0, rel=0.05)


def test_the_command_shows_the_fit_and_writes_the_helmet(tmp_path: Path) -> None:
    table = laboratory(tmp_path, [("front", 6.0)])
    out, plot = tmp_path / "fitted.yaml", tmp_path / "fit.svg"
    result = CliRunner().invoke(
        main, ["identify", str(table), "--output", str(out), "--plot", str(plot)],
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "liner.density" in result.output and "2 of 2 combinations" in result.output
    setup = ImpactSetup(helmet=str(out))
    assert setup.helmet_config.liner.density == pytest.approx(72.0, rel=0.05)
    assert plot.stat().st_size > 1000


def test_the_figure_shows_each_drop_and_what_is_left() -> None:
    pytest.importorskip("matplotlib", reason="the figure needs the extra 'report'")
    from helmet_sim_ros.report.figures.drops import histories_figure

    time = np.array([0.0, 0.001, 0.002])
    drops = tuple(
        MeasuredDrop(direction, speed, time, np.array([0.0, peak, 10.0]), source)
        for direction, speed, peak, source in (("front", 6.0, 90.0, "a"), ("left", 4.5, 60.0, "b"))
    )
    simulated = tuple(drop.acceleration + 5.0 for drop in drops)
    fit = HistoryFit((), load_helmet("fullface"), drops, simulated, (0.1, 0.1), 0, np.eye(0), ())
    axes = np.reshape(histories_figure(fit).axes, (2, 2))
    for (curves, rest), drop in zip(axes, drops, strict=True):
        measured, fitted = curves.lines
        assert measured.get_xdata() == pytest.approx([0.0, 1.0, 2.0])  # ms
        assert measured.get_ydata() == pytest.approx(drop.acceleration)
        assert fitted.get_ydata() == pytest.approx(drop.acceleration + 5.0)
        assert rest.lines[0].get_ydata() == pytest.approx([5.0] * 3)
        assert rest.lines[0].get_xdata() == pytest.approx([0.0, 1.0, 2.0])
    assert [row[0].get_title() for row in axes] == ["a: front, 6 m/s", "b: left, 4.5 m/s"]
    assert [ax.get_xlabel() for ax in axes.flat] == ["", "", "time [ms]", "time [ms]"]


def test_histories_in_isomme_are_read(tmp_path: Path) -> None:
    channel = tmp_path / "T1" / "Channel"
    channel.mkdir(parents=True)
    time, amount = measured("front", 6.0)
    lines = [
        "Channel code                :D0HEADCG00HEACR0", "Unit                        :m/(s*s)",
        f"Sampling interval           :{time[1] - time[0]}",
        "Time of first sample        :0.0", f"Number of samples           :{len(time)}",
    ]  # fmt: skip
    text = "\r\n".join([*lines, *(f"{a * STANDARD_GRAVITY}" for a in amount)])
    (channel / "T1.001").write_text(text)
    read_time, read = read_history(tmp_path / "T1")
    assert read_time == pytest.approx(time) and read == pytest.approx(amount)
    (channel / "T1.001").write_text("\r\n".join(text.splitlines()[:-5]))
    with pytest.raises(SetupError, match="truncated"):
        read_history(tmp_path / "T1")


def isomme(path: Path, code: str, values: np.ndarray) -> None:
    """One channel [m/s^2], samples of 0.1 ms."""
    head = [f"Channel code                :{code}", "Unit                        :m/(s*s)",
            "Sampling interval           :0.0001"]  # fmt: skip
    path.write_text("\n".join([*head, *(f"{value:.6f}" for value in values)]))


@pytest.mark.parametrize("order", [("0", "A", "C"), ("A", "0", "C"), ("A", "C", "0")])
def test_of_a_channel_that_is_filtered_several_ways_the_unfiltered_is_read(
    tmp_path: Path, order: tuple[str, ...]
) -> None:
    pulse = 1000.0 * np.sin(np.linspace(0.0, np.pi, 50))
    for number, filtered in enumerate(order, 1):
        values = pulse if filtered == "0" else 0.8 * pulse
        isomme(tmp_path / f"T.00{number}", f"D0HEADCG00HEACR{filtered}", values)
    time, read = read_history(tmp_path)
    assert time == pytest.approx(1e-4 * np.arange(50))
    assert read == pytest.approx(pulse / STANDARD_GRAVITY, abs=1e-6)


def test_without_a_resultant_it_is_that_of_the_axes(tmp_path: Path) -> None:
    pulse = 100.0 * np.sin(np.linspace(0.0, np.pi, 50))
    for number, (axis, share) in enumerate((("X", 2.0), ("Y", -3.0), ("Z", 6.0)), 1):
        isomme(tmp_path / f"T.00{number}", f"D0HEADCG00HEAC{axis}0", share * pulse)
    assert read_history(tmp_path)[1] == pytest.approx(7.0 * pulse / STANDARD_GRAVITY, abs=1e-6)
    isomme(tmp_path / "T.002", "D0HEADCG00HEACYA", -3.0 * pulse)  # filtered alone: better than none
    assert read_history(tmp_path)[1] == pytest.approx(7.0 * pulse / STANDARD_GRAVITY, abs=1e-6)
    (tmp_path / "T.002").unlink()
    with pytest.raises(SetupError, match="no channel of the head's acceleration"):
        read_history(tmp_path)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("time [ms];acceleration [g]\n" + "0;1\n" * 40, "must rise"),
        ("time [ms];acceleration [g]\n1;5\n2;nan\n", "row 3"),
        ("time;acceleration [g]\n1;5\n2;6\n", "no unit"),
        ("time [ms];force [N]\n1;5\n2;6\n", "must have a column acceleration"),
        ("time [ms];acceleration [g]\n1;5\n2;6\n", "has 2 samples"),
        ("time [s];acceleration [g]\n" + "".join(f"{t};{t}\n" for t in range(40)), "in ms"),
        ("time [ms];acceleration [g]\n" + "".join(f"{t};{100 * t}\n" for t in range(40)), "m/s"),
    ],
)
def test_what_is_no_history_is_refused_with_its_place(
    text: str, named: str, tmp_path: Path
) -> None:
    path = tmp_path / "h.csv"
    path.write_text(text)
    with pytest.raises(SetupError) as caught:
        read_history(path)
    assert named in str(caught.value)


def test_a_table_of_histories_is_one_with_a_column_of_files(tmp_path: Path) -> None:
    table = tmp_path / "tests.csv"
    for text, is_one in (
        ("# ours\n\nFile ; direction;speed [m/s]\n", True), ("speed [m/s],file [-]\n", True),
        ("direction;speed [m/s];peak [g]\n", False), ("# file\n", False), ("", False),
    ):  # fmt: skip
        table.write_text(text)
        assert is_history_table(table) is is_one, text
    answer = CliRunner().invoke(main, ["identify", str(tmp_path / "none.csv")])
    assert answer.exit_code == 2 and "none.csv" in answer.stderr


def test_a_list_of_tests_is_checked(tmp_path: Path) -> None:
    table = tmp_path / "tests.csv"
    for text, named in (
        ("file;direction;speed [m/s]\nnothing.csv;front;6", "no such file"),
        ("file;direction;speed\nx.csv;front;6", "no unit"),
        ("file;direction;speed [m/s]\nx.csv;chin;6", "direction = 'chin'"),
        ("file;direction;speed [m/s]\nx.csv;front;fast", "must be a number"),
        ("file;direction;speed [m/s]\nx.csv;front;60", "0.5 to 15"),
        ("file;speed [m/s]\nx.csv;6", "misses the column direction"),
        ("file;direction;speed [m/s]\n", "lists no test"),
    ):
        table.write_text(text)
        with pytest.raises(SetupError) as caught:
            read_histories(table)
        assert named in str(caught.value)
