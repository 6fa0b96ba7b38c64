"""Head channels as ISO-MME (ISO/TS 13499) data, in the sign convention of SAE J211-1.

SAE J211-1: head axes x forward, y to the right, z down, origin at the centre of gravity. Ours have
y to the left and z up, so y and z change their sign, of vectors and of rotations alike (the axes
differ by half a turn about x). Acceleration is inertial, without gravity, as everywhere here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from helmet_sim_ros.biomech.filters import CORNER, filtered, sample_rate_warning
from helmet_sim_ros.biomech.pulse import FloatArray, magnitude
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.rotation import to_head_axes
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log import LoggedImpact
from helmet_sim_ros.report.review.summary import label

#: From head axes here (x forward, y left, z up) to those of SAE J211 (x forward, y right, z down).
TO_J211 = np.array([1.0, -1.0, -1.0])

#: Physical dimension codes of ISO/TS 13499 and their units.
_DIMENSIONS = {
    "AC": ("head_acceleration", "Acceleration", "m/(s*s)"),
    "AV": ("head_angular_velocity", "Angular Velocity", "rad/s"),
}
_UNFILTERED, _CFC1000 = "0", "A"
_NO_VALUE = "NOVALUE"


@dataclass(frozen=True)
class MmeChannel:
    """One channel file.

    Attributes:
        code: the 16 characters of ISO/TS 13499: test object D (dummy), position 0, HEAD, CG, two
            more locations, dimension, direction and filter class.
        dimension, direction: in words.
        filter_class: in words.
        unit: of ``values``.
        values: shape (n,).
    """

    code: str
    dimension: str
    direction: str
    filter_class: str
    unit: str
    values: FloatArray


def head_channels(record: ImpactRecord) -> Iterator[MmeChannel]:
    """Linear acceleration and angular velocity of the head's centre of gravity in its own axes.

    Each component and the resultant, unfiltered and, where the sampling rate allows it, CFC 1000.
    """
    kind = "HE" if record.setup.get("impact.rig") == "headform" else "00"
    filterable = 2.0 * CORNER * 1000.0 * record.time_step < 1.0
    for code, (channel, dimension, unit) in _DIMENSIONS.items():
        raw = j211(getattr(record, channel), record)
        classes = {_UNFILTERED: ("Unfiltered", raw)}
        if filterable:
            classes[_CFC1000] = ("CFC 1000", filtered(raw, 1000, record.time_step))
        for letter, (words, values) in classes.items():
            for axis, column in zip("XYZR", [*values.T, magnitude(values)], strict=True):
                direction = "Resultant" if axis == "R" else f"{axis} (SAE J211)"
                name = f"D0HEADCG00{kind}{code}{axis}{letter}"
                yield MmeChannel(name, dimension, direction, words, unit, column)


def j211(vectors: FloatArray, record: ImpactRecord) -> FloatArray:
    """World vectors in the head axes of SAE J211, shape (n, 3)."""
    return np.asarray(to_head_axes(vectors, record.head_orientation) * TO_J211)


def write_isomme(impact: LoggedImpact, folder: Path, test_number: str, date: str = "") -> Path:
    """Write an ISO-MME test: ``FOLDER/TEST/TEST.mme`` and its ``Channel`` files.

    Args:
        impact: of a log.
        folder: where the test's folder goes.
        test_number: name of the test, plain characters.
        date: ISO date of the test, empty if unknown.

    Returns:
        The test's folder.

    Raises:
        LogError: it cannot be written.
    """
    place = folder / test_number
    record = impact.record.uniform()
    try:
        (place / "Channel").mkdir(parents=True, exist_ok=True)
        channels = list(head_channels(record))
        index = {"Number of channels": str(len(channels))}
        for number, channel in enumerate(channels, 1):
            index[f"Name of channel {number:03d}"] = f"{channel.code} / {channel.dimension}"
            text = _header(_channel_fields(channel, record, impact, test_number))
            text += "".join(f"{value!r}\r\n" for value in channel.values.tolist())
            _write(place / "Channel" / f"{test_number}.{number:03d}", text)
        _write(place / "Channel" / f"{test_number}.chn", _header(index))
        _write(place / f"{test_number}.mme", _header(_test_fields(impact, test_number, date)))
    except OSError as error:
        raise LogError(f"{place}: cannot be written: {error.strerror}") from error
    return place


def _test_fields(impact: LoggedImpact, test_number: str, date: str) -> Mapping[str, str]:
    setup = impact.setup
    title = f"Helmet impact, {setup.get('impact.direction', _NO_VALUE)}"
    kind = f"Simulated impact, {setup.get('impact.rig', _NO_VALUE)}"
    if impact.is_fall:
        title, kind = f"Fall, {label(setup)}", "Simulated fall, rider"
    return {
        "Data format edition number": "2.0",
        "Laboratory name": "helmet_sim_ros (simulation)",
        "Customer name": _NO_VALUE,
        "Customer test ref. number": impact.impact_id,
        "Title": title,
        "Test number": test_number,
        "Type of the test": kind,
        "Date of the test": date or _NO_VALUE,
        "Reference system": "SAE J211-1, head axes: x forward, y right, z down",
        "Comments": "Acceleration is inertial, without gravity; time 0 is the "
        + ("start of the fall" if impact.is_fall else "first touch"),
        "Name of test object 1": str(setup.get("helmet.name", _NO_VALUE)),
        "Velocity test object 1": _number(setup.get("impact.normal_velocity")),
        "Mass test object 1": _number(setup.get("helmet.mass")),
    }


def _channel_fields(
    channel: MmeChannel, record: ImpactRecord, impact: LoggedImpact, test_number: str
) -> Mapping[str, str]:
    values, time = channel.values, record.time
    comments = [f"impact {impact.impact_id} of test {test_number}"]
    if channel.code.endswith(_CFC1000):
        comments.append(sample_rate_warning(1000, record.time_step))
    high, low = int(values.argmax()), int(values.argmin())
    return {
        "Test object number": "1",
        "Name of the channel": f"Head CG {channel.dimension} {channel.direction}",
        "Laboratory channel code": _NO_VALUE,
        "Customer channel code": _NO_VALUE,
        "Channel code": channel.code,
        "Comments": "; ".join(filter(None, comments)),
        "Location": "Head, center of gravity",
        "Dimension": channel.dimension,
        "Direction": channel.direction,
        "Channel frequency class": channel.filter_class,
        "Unit": channel.unit,
        "Reference system": "SAE J211",
        "Transducer type": "Simulation",
        "Reference channel": "implicit",
        "Reference channel name": _NO_VALUE,
        "Data source": "simulation",
        "Data status": "ok",
        "Sampling interval": repr(record.time_step),
        "Time of first sample": repr(float(time[0])),
        "Number of samples": str(len(values)),
        "First global maximum value": repr(float(values[high])),
        "Time of maximum value": repr(float(time[high])),
        "First global minimum value": repr(float(values[low])),
        "Time of minimum value": repr(float(time[low])),
    }


def _header(fields: Mapping[str, str]) -> str:
    return "".join(f"{name:<28}:{_one_line(value)}\r\n" for name, value in fields.items())


def _one_line(value: str) -> str:
    return " ".join(value.split())


def _number(value: object) -> str:
    good = isinstance(value, int | float) and math.isfinite(value)
    return repr(float(value)) if good else _NO_VALUE  # type: ignore[arg-type]


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="")
