"""One self-contained HTML page about the impacts of some logs."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import jinja2
import numpy as np
from markupsafe import Markup

from helmet_sim_ros.biomech.catalogue import HEADLINE, entry
from helmet_sim_ros.biomech.filters import CORNER, filtered
from helmet_sim_ros.biomech.helmet import ground_components
from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY, FloatArray, magnitude
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.biomech.result import Criterion, Evaluation
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log import ImpactLog
from helmet_sim_ros.report.export.tables import setup_unit
from helmet_sim_ros.report.page.crush import crush_panel
from helmet_sim_ros.report.page.replay import packed, replay_data
from helmet_sim_ros.report.page.svg import Curve, panel
from helmet_sim_ros.report.review.check import Reviewed, review
from helmet_sim_ros.report.review.summary import common, labels, shown, varying
from helmet_sim_ros.study.scenario.reference import Published, load_reference

#: Samples drawn per history; longer records are thinned out.
MOST_SAMPLES = 4001
#: Files that the page contains whole.
_INLINE = {
    "css": "report.css",
    "js": "report.js",
    "uplot_css": "uPlot.min.css",
    "uplot_js": "uPlot.iife.min.js",
}
#: Units that read better in a report: unit -> (shown unit, factor).
SPOKEN = {"s": ("ms", 1e3), "m": ("mm", 1e3), "N": ("kN", 1e-3), "-": ("", 1.0)}

LIMITS = (
    "These are results of a simulation. They replace no test of a helmet, and a verdict here is no "
    "certificate: it compares numbers with limits.",
    "Skull and headform are rigid, the shell is an ellipsoid on a flat rigid ground; face opening, "
    "chin bar, visor and the deformation of the body are left out.",
    "With coupling 'spring' the helmet moves against the head in translation only; with 'foam' "
    "each column of the liner is crushed on its own.",
    "Accelerations are inertial, in world axes, of the head's centre of gravity; unfiltered values "
    "hold what a laboratory's filter removes, so the CFC 1000 values stand beside them.",
    "Limits marked as not verified were taken from secondary sources. Risk curves come from car "
    "occupants and unhelmeted heads and are informative only.",
    "Peaks depend on friction, body angle, neck and the shell's contact constants, which are "
    "choices within published ranges.",
)


def report_page(logs: Sequence[ImpactLog], standard: str | None = None) -> str:
    """The page, as text.

    Args:
        logs: their complete impacts are shown in order.
        standard: judge by this standard; None: by that of the logged criteria.

    Raises:
        LogError: no complete impact, or damaged samples.
        PulseError: no criteria can be computed from an impact.
    """
    rows = [(log, review(impact, standard)) for log in logs for impact in log]
    problems = [
        f"{log.path.name}: {text}" for log in logs for text in (*log.problems, *log.warnings)
    ]
    if not rows:
        names = ", ".join(str(log.path) for log in logs)
        raise LogError(f"{names}: no complete impact to report")
    setups = [row.impact.setup for _, row in rows]
    published = [load_reference("table1").row(setup) or {} for setup in setups]
    models = {
        name: list(dict.fromkeys(m for p in published for m in p.get(name, {})))
        for name in ("force_ratio", "peak_g")
    }
    different = varying(setups)
    impacts = [
        _impact(number, log, row, names, reference, models, different)
        for number, ((log, row), names, reference) in enumerate(
            zip(
                rows,
                zip(labels(setups), labels(setups, False), strict=True),
                published,
                strict=True,
            ),
            1,
        )
    ]
    failed = sum(row.evaluation.verdict == "fail" for _, row in rows)
    context = {
        "version": _version(),
        "title": "Impact report: " + ", ".join(log.path.name for log in logs),
        "verdict": "fail" if failed or any(row.differences for _, row in rows) else "pass",
        "headline": _headline([row for _, row in rows], failed),
        "problems": problems,
        "impacts": impacts,
        "models": models,
        "reference": load_reference("table1").source,
        "setup": _setup_rows(common(setups)),
        "provenance": [row for log in logs for row in _provenance(log)],
        "kept": sum(not m["fail"] for _, row in rows for m in _messages(row.evaluation)),
        "limits": [*LIMITS, *_warnings(row.evaluation for _, row in rows)],
    }
    context |= {name: Markup(_asset(file)) for name, file in _INLINE.items()}
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True
    )
    return environment.from_string(_asset("report.html.j2")).render(context)


def _impact(
    number: int,
    log: ImpactLog,
    row: Reviewed,
    names: tuple[str, str],
    published: Published,
    models: dict[str, list[str]],
    different: list[str],
) -> dict[str, object]:
    impact, evaluation = row.impact, row.evaluation
    record, setup = impact.record, impact.setup
    stride = math.ceil(len(record) / MOST_SAMPLES)
    data = _histories(record, evaluation, stride)
    try:
        data["replay"], problem = replay_data(record), ""
    except LogError as error:
        problem = str(error)
    return {
        "number": number,
        "label": names[0],
        "short": names[1],
        "impact_id": impact.impact_id,
        "log": log.path.name,
        "samples": impact.samples,
        "step": f"{record.time_step * 1e6:g} µs",
        "stride": stride,
        "normal": shown(setup.get("impact.normal_velocity")),
        "tangential": shown(setup.get("impact.tangential_velocity")),
        "force_ratio": _number(evaluation, "force_ratio", ".2f"),
        "peak_g": _number(evaluation, "peak_g", ".0f"),
        "hic": _number(evaluation, "hic", ".0f"),
        "published": {
            key: {m: _published(published, key, m) for m in names} for key, names in models.items()
        },
        "verdict": evaluation.verdict,
        "check": row.check,
        "messages": _messages(evaluation),
        "differences": [str(difference) for difference in row.differences],
        "tiles": [_tile(evaluation.criteria[n]) for n in HEADLINE if n in evaluation.criteria],
        "criteria": [_criterion(criterion) for criterion in evaluation.criteria.values()],
        "setup": _setup_rows({n: setup.get(n) for n in different}),
        "panels": [*_panels(record), *filter(None, [crush_panel(record)])],
        "notes": [str(note) for note in record.extras.get("notes", ())],
        "replay": not problem,
        "replay_problem": problem,
        "data": _script_json(data),
    }


def _messages(evaluation: Evaluation) -> list[dict[str, object]]:
    return [
        {"text": text, "fail": "exceeds" in text.partition(":")[2]} for text in evaluation.messages
    ]


def _histories(record: ImpactRecord, evaluation: Evaluation, stride: int) -> dict[str, object]:
    """What ``report.js`` draws over time: g, kN, mm and ms."""
    acceleration = record.head_acceleration / STANDARD_GRAVITY
    normal, tangential = ground_components(record.ground_force)
    crush = record.coupling_displacement * 1e3
    step = record.time_step
    arrays: dict[str, FloatArray] = {
        "ax": acceleration[:, 0], "ay": acceleration[:, 1], "az": acceleration[:, 2],
        "fn": normal / 1e3, "ft": tangential / 1e3, "fc": magnitude(record.coupling_force) / 1e3,
        "dx": crush[:, 0], "dy": crush[:, 1], "dz": crush[:, 2],
    }  # fmt: skip
    if 2.0 * CORNER * 1000.0 * step < 1.0:
        arrays["cfc"] = magnitude(filtered(acceleration, 1000, step))
    criteria = evaluation.criteria
    window = criteria["hic"].window if "hic" in criteria else None
    thickness = record.setup.get("helmet.liner.thickness")
    limits: dict[str, list[dict[str, object]]] = {"acceleration": [], "compression": []}
    if "peak_g" in criteria and criteria["peak_g"].limit is not None:
        limit = criteria["peak_g"].limit
        limits["acceleration"].append({"value": limit, "label": f"limit {limit:g} g"})
    if isinstance(thickness, int | float):
        text = f"liner thickness {thickness * 1e3:g} mm"
        limits["compression"].append({"value": thickness * 1e3, "label": text})
    return {
        "count": len(record.time[::stride]),
        "start": float(record.time[0]) * 1e3,
        "step": step * stride * 1e3,
        "arrays": {key: packed(values[::stride]) for key, values in arrays.items()},
        "window": None if window is None else [1e3 * t for t in window],
        "limits": limits,
        "marks": {
            "acceleration": [
                *_mark(criteria, "peak_g", "resultant", 1.0, "g"),
                *_mark(criteria, "peak_g_cfc1000", "resultant, CFC 1000", 1.0, "g"),
            ],
            "force": [
                *_mark(criteria, "peak_normal_force", "ground, normal", 1e-3, "kN"),
                *_mark(criteria, "peak_tangential_force", "ground, tangential", 1e-3, "kN"),
            ],
            "compression": _mark(criteria, "peak_compression", "resultant", 1e3, "mm"),
        },
    }


def _mark(
    criteria: Mapping[str, Criterion], name: str, series: str, factor: float, unit: str
) -> list[dict[str, object]]:
    """A marked peak of a history."""
    criterion = criteria.get(name)
    if criterion is None or criterion.time is None:
        return []
    value = criterion.value * factor
    text = f"{value:.4g} {unit}"
    return [{"series": series, "time": criterion.time * 1e3, "value": value, "label": text}]


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
    normal, tangential = ground_components(record.ground_force)
    curves = [Curve(normal / 1e3, tangential / 1e3, label="ground force")]
    friction = record.setup.get("impact.friction")
    if isinstance(friction, int | float):
        line = np.array([0.0, float(normal.max()) / 1e3])
        curves.append(Curve(line, friction * line, "law", f"friction {friction:g}"))
    title = "Tangential over normal force"
    panels.append({"title": title, "svg": panel(title, "normal [kN]", "tangential [kN]", curves)})
    return panels


def _tile(criterion: Criterion) -> dict[str, str]:
    unit, factor = SPOKEN.get(criterion.unit, (criterion.unit, 1.0))
    limit = "" if criterion.limit is None else f"{criterion.limit * factor:.4g} {unit}".strip()
    value = f"{criterion.value * factor:.4g} {unit}".strip()
    return {"label": entry(criterion.name).meaning, "value": value, "limit": limit,
            "verdict": criterion.verdict}  # fmt: skip


def _criterion(criterion: Criterion) -> dict[str, str]:
    when = ""
    if criterion.window is not None:
        when = " to ".join(f"{1e3 * t:.2f}" for t in criterion.window)
    elif criterion.time is not None:
        when = f"{1e3 * criterion.time:.2f}"
    try:
        meaning = entry(criterion.name).meaning
    except ValueError:  # of a later version
        meaning = criterion.name
    return {
        "name": criterion.name,
        "meaning": meaning,
        "value": f"{criterion.value:.6g}",
        "unit": criterion.unit,
        "when": when,
        "limit": "" if criterion.limit is None else f"{criterion.limit:g}",
        "verdict": criterion.verdict,
        "note": "; ".join(filter(None, (criterion.note, criterion.source))),
    }


def _headline(rows: Sequence[Reviewed], failed: int) -> str:
    titles = ", ".join(dict.fromkeys(row.evaluation.title for row in rows))
    count = f"{len(rows)} impact" + ("s" if len(rows) > 1 else "")
    text = f"{count}: {failed} above a limit" if failed else f"{count}, all within the limits"
    text += f" of {titles}"
    differing = sum(bool(row.differences) for row in rows)
    if differing:
        text += f"; {differing} with logged criteria that the samples do not give"
    return text


def _provenance(log: ImpactLog) -> list[dict[str, str]]:
    hashes = dict.fromkeys(impact.model_hash for impact in log)
    values = {
        "log": log.path.name,
        "written by": log.library,
        **{key.replace("version.", "version of "): value for key, value in log.run.items()},
        "model (SHA-256)": ", ".join(filter(None, hashes)),
    }
    return [{"name": key, "value": value} for key, value in values.items() if value]


def _setup_rows(values: dict[str, object]) -> list[dict[str, str]]:
    rows = []
    for name, value in values.items():
        unit = setup_unit(name)
        rows.append({"name": name, "value": shown(value), "unit": "" if unit == "-" else unit})
    return rows


def _warnings(evaluations: Iterable[Evaluation]) -> list[str]:
    return list(dict.fromkeys(warning for e in evaluations for warning in e.warnings))


def _number(evaluation: Evaluation, name: str, style: str) -> str:
    criterion = evaluation.criteria.get(name)
    return "" if criterion is None else format(criterion.value, style)


def _published(published: Published, criterion: str, model: str) -> str:
    value = published.get(criterion, {}).get(model)
    return "" if value is None else format(value, ".2f" if criterion == "force_ratio" else "g")


def _script_json(data: object) -> Markup:
    """JSON that cannot end its script element, whatever a log holds."""
    text = json.dumps(data, allow_nan=False)
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)


def _asset(name: str) -> str:
    return (resources.files("helmet_sim_ros.report") / "assets" / name).read_text(encoding="utf-8")


def _version() -> str:
    try:
        return version("helmet_sim_ros")
    except PackageNotFoundError:  # run from a source tree
        return "unknown"


def write_report(logs: Sequence[ImpactLog], path: Path, standard: str | None = None) -> Path:
    """Write :func:`report_page` to a file.

    Raises:
        LogError: as there, or it cannot be written.
    """
    text = report_page(logs, standard)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise LogError(f"{path}: cannot be written: {error.strerror}") from error
    return path
