"""What the page says of one impact."""

from __future__ import annotations

import numpy as np

from helmet_sim_ros.biomech.catalogue import HEADLINE, entry
from helmet_sim_ros.biomech.helmet import normal_and_tangential
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Criterion, Evaluation
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log import ImpactLog
from helmet_sim_ros.present.words import value_text
from helmet_sim_ros.report.export.tables import setup_unit
from helmet_sim_ros.report.page.blocks import packed
from helmet_sim_ros.report.page.crush import crush_panel
from helmet_sim_ros.report.page.histories import histories, stride_of
from helmet_sim_ros.report.page.quantity import number, pretty, quantity, unit_text
from helmet_sim_ros.report.page.replay import replay_data
from helmet_sim_ros.report.page.svg import Curve, panel
from helmet_sim_ros.report.review.check import Reviewed
from helmet_sim_ros.study.scenario.reference import Published


def article(
    number_: int,
    log: ImpactLog,
    row: Reviewed,
    names: tuple[str, str],
    published: Published,
    models: dict[str, list[str]],
    different: list[str],
    impacts: int,
) -> dict[str, object]:
    """Values of the template for one impact.

    Args:
        number_: counted from 1 over the whole page.
        log, row: the impact after review.
        names: its label, long and short.
        published: values to stand beside, criterion -> model -> value.
        models: of the published values, by criterion.
        different: names of setup values in which the impacts of the page differ.
        impacts: how many impacts the page has.
    """
    impact, evaluation = row.impact, row.evaluation
    record, setup = impact.record, impact.setup
    stride = stride_of(record, impacts)
    plain, arrays = histories(record, evaluation, stride)
    plain["criteria"] = [_criterion(criterion) for criterion in evaluation.criteria.values()]
    try:
        scene, motion = replay_data(record)
        problem = ""
        plain["replay"] = scene
        arrays |= {f"replay_{name}": values for name, values in motion.items()}
    except LogError as error:
        problem = str(error)
    return {
        "number": number_,
        "label": names[0],
        "short": names[1],
        "impact_id": impact.impact_id,
        "log": log.path.name,
        "samples": impact.samples,
        "step": quantity(record.time_step * 1e6, "µs"),
        "stride": stride,
        "normal": value_text(setup.get("impact.normal_velocity")),
        "tangential": value_text(setup.get("impact.tangential_velocity")),
        "force_ratio": _number(evaluation, "force_ratio", ".2f"),
        "peak_g": _number(evaluation, "peak_g", ".0f"),
        "hic": _number(evaluation, "hic", ".0f"),
        "published": {
            key: {m: _published(published, key, m) for m in columns}
            for key, columns in models.items()
        },
        "verdict": evaluation.verdict,
        "check": row.check,
        "messages": messages(evaluation),
        "differences": [str(difference) for difference in row.differences],
        "tiles": [_tile(evaluation.criteria[n]) for n in HEADLINE if n in evaluation.criteria],
        "setup": setup_rows({n: setup.get(n) for n in different}),
        "panels": [*filter(None, [crush_panel(record)]), *_panels(record)],
        "notes": list(map(pretty, evaluation.warnings)),
        "replay": not problem,
        "replay_problem": problem,
        "data": packed(plain, arrays),
    }


def messages(evaluation: Evaluation) -> list[dict[str, object]]:
    """The verdict in words, and whether each line tells of a failure."""
    return [
        {"text": pretty(text), "fail": "exceeds" in text.partition(":")[2]}
        for text in evaluation.messages
    ]


def setup_rows(values: dict[str, object]) -> list[dict[str, str]]:
    """Setup values with their units."""
    return [
        {"name": name, "value": value_text(value), "unit": unit_text(setup_unit(name))}
        for name, value in values.items()
    ]


def _panels(record: ImpactRecord) -> list[dict[str, object]]:
    """Force-compression loops per axis, and tangential over normal force."""
    panels: list[dict[str, object]] = []
    sides = (("x", "front-back"), ("y", "sideways"), ("z", "up-down"))
    for axis, (name, words) in enumerate(sides):
        loop = Curve(
            record.coupling_displacement[:, axis] * 1e3, record.coupling_force[:, axis] / 1e3
        )
        title = f"Loop {name}, {words}"
        panels.append(
            {"title": title, "svg": panel(title, f"compression {name} [mm]", "force [kN]", [loop])}
        )
    normal, tangential = normal_and_tangential(
        record.ground_force - record.ground_friction, record.ground_friction
    )
    curves = [Curve(normal / 1e3, tangential / 1e3, label="ground force")]
    friction = record.setup.get("impact.friction")
    if isinstance(friction, int | float):
        line = np.array([0.0, float(normal.max()) / 1e3])
        curves.append(Curve(line, friction * line, "law", f"friction {friction:g}"))
    title = "Tangential over normal force"
    panels.append({"title": title, "svg": panel(title, "normal [kN]", "tangential [kN]", curves)})
    return panels


def _tile(criterion: Criterion) -> dict[str, object]:
    """A card: its bar shows the share of the limit that is used, at most all of it."""
    limit = criterion.limit
    return {
        "label": entry(criterion.name).meaning,
        "value": quantity(criterion.value, criterion.unit),
        "limit": "" if limit is None else quantity(limit, criterion.unit),
        "used": None if not limit else round(100.0 * min(1.0, criterion.value / limit)),
        "verdict": criterion.verdict,
    }


def _criterion(criterion: Criterion) -> list[str]:
    """A row of the table of all criteria; the last cell is the name."""
    when = ""
    if criterion.window is not None:
        when = " to ".join(f"{1e3 * t:.2f}" for t in criterion.window)
    elif criterion.time is not None:
        when = f"{1e3 * criterion.time:.2f}"
    try:
        meaning = entry(criterion.name).meaning
    except ValueError:  # of a later version
        meaning = criterion.name
    limit = "" if criterion.limit is None else number(criterion.limit, 5)
    note = "; ".join(filter(None, (criterion.note, criterion.source)))
    value, unit = number(criterion.value, 5), unit_text(criterion.unit)
    return [meaning, value, unit, when, limit, criterion.verdict, note, criterion.name]


def _number(evaluation: Evaluation, name: str, style: str) -> str:
    criterion = evaluation.criteria.get(name)
    return "" if criterion is None else format(criterion.value, style)


def _published(published: Published, criterion: str, model: str) -> str:
    value = published.get(criterion, {}).get(model)
    return "" if value is None else format(value, ".2f" if criterion == "force_ratio" else "g")
