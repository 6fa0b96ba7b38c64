"""Exports: every value arrives, with its unit, its axes and its sign."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="logs for tests are written by the recorder's session")

from click.testing import CliRunner
from logs import write_log

from helmet_sim_ros import ImpactSetup, evaluate, open_log
from helmet_sim_ros.biomech.filters import cfc
from helmet_sim_ros.biomech.record import block_labels, to_block
from helmet_sim_ros.cli import main
from helmet_sim_ros.report.export.isomme import head_channels, j211

SETUPS = [
    ImpactSetup(duration=0.015, normal_velocity=5.0, tangential_velocity=5.0),
    ImpactSetup(duration=0.015, normal_velocity=5.0, direction="front", rig="headform"),
]

#: Prints what pyisomme reads of a test, as JSON.
READ_BACK = """
import json, sys, pyisomme
test = pyisomme.Isomme().read(sys.argv[1])
print(json.dumps({
    "number": test.test_number,
    "channels": [{
        "code": str(c.code), "valid": bool(c.code.is_valid()), "unit": str(c.unit),
        "time": [float(t) for t in c.data.index], "values": c.data.iloc[:, 0].tolist(),
        "dimension": c.code.physical_dimension, "location": c.code.main_location,
        "fine": c.code.fine_location_1, "filter": c.code.filter_class,
    } for c in test.channels],
}))
"""


def run(*arguments):
    return CliRunner().invoke(main, ["export", *map(str, arguments)])


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "two.mcap"
    write_log(path, SETUPS)
    return path


def pyisomme_python() -> str:
    """An interpreter that has pyisomme: it pins older libraries than we use, so it lives apart."""
    for candidate in (os.environ.get("PYISOMME_PYTHON", ""), sys.executable):
        if candidate:
            probe = subprocess.run([candidate, "-c", "import pyisomme"], capture_output=True)
            if probe.returncode == 0:
                return candidate
    pytest.skip("no pyisomme; PYISOMME_PYTHON may name a Python that has it")


def test_csv_has_names_units_and_every_sample(path, tmp_path):
    answer = run(path, "-o", tmp_path)
    assert answer.exit_code == 0, answer.output
    for impact in open_log(path):
        with open(tmp_path / f"two_{impact.impact_id}.csv", newline="") as stream:
            rows = list(csv.reader(stream))
        record = impact.record
        assert rows[0] == block_labels(record.joint_names)
        units = dict(zip(rows[0], rows[1], strict=True))
        assert units["time"] == "s" and units["ground_force.x"] == "N"
        assert units["coupling_displacement.y"] == "m"
        assert np.array_equal(np.array(rows[2:], dtype=float), to_block(record))
    with open(tmp_path / "two_impacts.csv", newline="") as stream:
        names, units, *rows = list(csv.reader(stream))
    units = dict(zip(names, units, strict=True))
    assert (units["peak_g"], units["impact.normal_velocity"], units["rider.mass"]) == (
        "g", "m/s", "kg"
    )  # fmt: skip
    for row, impact in zip(rows, open_log(path), strict=True):
        values = dict(zip(names, row, strict=True))
        assert float(values["hic"]) == impact.logged.hic.value
        assert values["impact.direction"] == impact.setup["impact.direction"]
        assert values["verdict"] == impact.logged.verdict


def test_parquet_has_units_setup_and_results(path, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    assert run(path, "-f", "parquet", "-o", tmp_path).exit_code == 0
    for impact in open_log(path):
        table = parquet.read_table(tmp_path / f"two_{impact.impact_id}.parquet")
        record = impact.record
        assert table.column_names == block_labels(record.joint_names)
        assert np.array_equal(np.column_stack([c.to_numpy() for c in table]), to_block(record))
        assert table.schema.field("neck_torque.x").metadata[b"unit"] == b"N m"
        about = table.schema.metadata
        assert json.loads(about[b"setup"]) == impact.setup
        assert json.loads(about[b"evaluation"]) == evaluate(record).as_dict()
    results = parquet.read_table(tmp_path / "two_impacts.parquet").to_pylist()
    assert [row["peak_g"] for row in results] == [i.logged.peak_g.value for i in open_log(path)]
    assert results[0]["impact.direction"] == "left"


def test_j211_signs_of_blows_from_the_left_the_front_and_the_top(tmp_path):
    """Pushed to the right is +y, backwards -x, downwards +z, in head axes."""
    blows = {
        "left": (1, 1.0),
        "right": (1, -1.0),
        "front": (0, -1.0),
        "back": (0, 1.0),
        "top": (2, 1.0),
    }
    path = tmp_path / "blows.mcap"
    write_log(path, [ImpactSetup(rig="headform", duration=0.01, direction=d, normal_velocity=4.0)
                     for d in blows])  # fmt: skip
    for impact, (axis, sign) in zip(open_log(path), blows.values(), strict=True):
        record = impact.record
        pulse = j211(record.head_acceleration, record)
        peak = pulse[np.abs(pulse[:, axis]).argmax()]
        assert np.sign(peak[axis]) == sign
        assert abs(peak[axis]) > 0.9 * np.linalg.norm(peak)


def test_isomme_files_have_the_form_of_the_standard(path, tmp_path):
    assert run(path, "-f", "isomme", "-o", tmp_path).exit_code == 0
    for impact, kind in zip(open_log(path), ("00", "HE"), strict=True):
        name = f"two_{impact.impact_id}"
        folder = tmp_path / name
        test = header(folder / f"{name}.mme")
        assert test["Data format edition number"] == "2.0" and test["Test number"] == name
        index = header(folder / "Channel" / f"{name}.chn")
        channels = list(head_channels(impact.record))
        assert int(index["Number of channels"]) == len(channels) == 16
        for number, channel in enumerate(channels, 1):
            text = (folder / "Channel" / f"{name}.{number:03d}").read_text().splitlines()
            fields = header(folder / "Channel" / f"{name}.{number:03d}")
            assert index[f"Name of channel {number:03d}"].startswith(channel.code)
            assert fields["Channel code"] == channel.code and len(channel.code) == 16
            assert channel.code[:12] == f"D0HEADCG00{kind}"
            values = text[-int(fields["Number of samples"]) :]
            assert np.array_equal(np.array(values, dtype=float), channel.values)
            assert float(fields["First global maximum value"]) == channel.values.max()


def header(path: Path) -> dict[str, str]:
    pairs = [line.partition(":") for line in path.read_text().splitlines() if ":" in line]
    return {name.strip(): value for name, _, value in pairs}


def test_isomme_is_read_back_by_pyisomme(path, tmp_path):
    python = pyisomme_python()
    assert run(path, "-f", "isomme", "-o", tmp_path).exit_code == 0
    for impact in open_log(path):
        folder = tmp_path / f"two_{impact.impact_id}"
        answer = subprocess.run(
            [python, "-c", READ_BACK, str(folder)], capture_output=True, text=True, check=True
        )
        data = json.loads(answer.stdout.splitlines()[-1])
        record = impact.record
        found = {channel["code"][12:]: channel for channel in data["channels"]}
        assert data["number"] == folder.name and len(found) == 16
        acceleration = j211(record.head_acceleration, record)
        expected = {
            "ACX0": acceleration[:, 0], "ACY0": acceleration[:, 1], "ACZ0": acceleration[:, 2],
            "ACXA": cfc(acceleration, 1000, record.time_step)[:, 0],
            "AVX0": j211(record.head_angular_velocity, record)[:, 0],
            "AVZ0": j211(record.head_angular_velocity, record)[:, 2],
            "ACR0": np.linalg.norm(record.head_acceleration, axis=1),
        }  # fmt: skip
        for code, values in expected.items():
            channel = found[code]
            assert channel["valid"]
            assert (channel["location"], channel["fine"]) == ("HEAD", "CG")
            assert np.allclose(channel["values"], values, rtol=1e-12, atol=1e-9)
            assert np.allclose(channel["time"], record.time, atol=1e-9)
            assert channel["unit"].replace(" ", "") in ("m/s2", "rad/s")


def test_one_impact_and_unknown_ones(path, tmp_path):
    assert run(path, "--impact", "test-1", "-o", tmp_path).exit_code == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["two_impacts.csv", "two_test-1.csv"]
    answer = run(path, "--impact", "nobody", "-o", tmp_path)
    assert answer.exit_code == 2 and "test-0, test-1" in answer.stderr


def test_names_in_a_log_cannot_leave_the_directory(path, tmp_path):
    from helmet_sim_ros.cli.export import plain

    assert plain("../../etc/passwd") == "______etc_passwd"
    assert plain("") == "_"


def test_where_nothing_can_be_written_is_told(path, tmp_path):
    (tmp_path / "file").write_text("")
    for form in ("csv", "isomme"):
        answer = run(path, "-f", form, "-o", tmp_path / "file" / "below")
        assert answer.exit_code == 2 and "cannot be written" in answer.stderr
        assert answer.exception is None or isinstance(answer.exception, SystemExit)
