"""One self-contained HTML page about falls: their head strikes as a table, a map and curves."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources
from pathlib import Path

import jinja2
import numpy as np
from markupsafe import Markup

from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.model.fall.strikes import Strike
from helmet_sim_ros.report.falls.map import strike_map
from helmet_sim_ros.report.falls.tables import FallResult, to_csv, to_scenario
from helmet_sim_ros.report.page.svg import Curve, panel
from helmet_sim_ros.version import __version__

NOT_MODELLED = (
    "The rider is passive, or holds out his arms; he does not see the ground come.",
    "His vehicle is left out unless the scene has it.",
    "A car's panels are one spring and one mass each, dented by the head alone where it strikes; "
    "glass that breaks is a soft spring.",
    "What of a shell's bending an impact on an edge shows is left out of falls.",
)
STANDARD_GRAVITY = 9.80665  # m/s^2
#: Strikes whose curves are shown: those above this peak acceleration [g], a choice.
SHOWN = 20.0


def falls_page(results: Sequence[FallResult], replay: str | None = None) -> str:
    """The page, as text.

    Args:
        results: falls.
        replay: file name of a report in which each strike can be replayed.
    """
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    strikes = [(f"{r.name}, {n}", s) for r in results for n, s in enumerate(r.strikes, 1)]
    without = [r.name for r in results if not r.strikes]
    return environment.from_string(_asset("falls.html.j2")).render(
        css=Markup(_asset("report.css")),
        version=__version__,
        falls=[(r.name, _told(r.fall)) for r in results],
        rows=[_row(number, name, s) for number, (name, s) in enumerate(strikes, 1)],
        without=without,
        map=strike_map(strikes) if strikes else "",
        replay=replay,
        not_modelled=NOT_MODELLED,
    )


def write_falls(results: Sequence[FallResult], folder: Path, replay: str | None) -> list[Path]:
    """Write ``strikes.csv``, ``strikes.yaml`` (a scenario, where there are strikes) and
    ``falls.html`` into a folder.

    Raises:
        LogError: it cannot be written.
    """
    texts = {"strikes.csv": to_csv(results), "falls.html": falls_page(results, replay)}
    scenario = to_scenario(results)
    if scenario is not None:
        texts["strikes.yaml"] = scenario
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise LogError(f"{folder}: cannot be written: {error.strerror}") from error
    return [folder / name for name in texts]


def _told(fall: Fall) -> str:
    text = f"{fall.preset}, {fall.resolved_speed:g} m/s, scene {fall.scene}, helmet {fall.helmet}"
    return f"{text}, {fall.bracing}"


def _row(number: int, name: str, strike: Strike) -> dict[str, object]:
    found, record = strike.evaluation.criteria, strike.record
    time = (record.time - strike.time) * 1e3
    linear = np.linalg.norm(record.head_acceleration, axis=1) / STANDARD_GRAVITY
    panels = []
    if strike.peak_acceleration > SHOWN * STANDARD_GRAVITY:
        panels = [
            panel("Acceleration of the head", "time [ms]", "acceleration [g]",
                  [Curve(time, linear)]),
            panel("Angular acceleration of the head", "time [ms]", "[krad/s^2]",
                  [Curve(time, _angular(record))]),
        ]  # fmt: skip
    return {
        "number": number,
        "name": name,
        "strike": strike,
        "criteria": {key: found[key].value for key in ("peak_g", "hic", "bric")},
        "angular": found["peak_angular_acceleration"].value * 1e-3,
        "panels": panels,
        "messages": [*strike.evaluation.messages, *strike.evaluation.warnings],
    }


def _angular(record: ImpactRecord) -> np.ndarray:
    amount: np.ndarray = np.linalg.norm(record.head_angular_acceleration, axis=1) * 1e-3
    return amount


def _asset(name: str) -> str:
    return (resources.files("helmet_sim_ros.report") / "assets" / name).read_text(encoding="utf-8")
