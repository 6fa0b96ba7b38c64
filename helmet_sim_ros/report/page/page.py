"""One self-contained HTML page about the impacts of some logs, and the head strikes of falls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import resources
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import jinja2
from markupsafe import Markup

from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log import ImpactLog, LoggedImpact
from helmet_sim_ros.mcap_log.strikes import NOTHING
from helmet_sim_ros.report.page.article import article, messages, setup_rows
from helmet_sim_ros.report.page.blocks import packed
from helmet_sim_ros.report.page.comparison import comparisons
from helmet_sim_ros.report.page.replay import mesh_data
from helmet_sim_ros.report.page.strikes import strikes_section
from helmet_sim_ros.report.replay.scene import admit_helmets
from helmet_sim_ros.report.review.check import Reviewed, ReviewedFall, review, review_fall
from helmet_sim_ros.report.review.summary import common, labels, varying
from helmet_sim_ros.study.scenario.reference import load_reference

#: Files that the page contains whole.
_INLINE = {
    "css": "report.css",
    "uplot_css": "uPlot.min.css",
    "uplot_js": "uPlot.iife.min.js",
    "blocks_js": "blocks.js",
    "charts_js": "charts.js",
    "replay_js": "replay.js",
    "js": "report.js",
}
LIMITS = (
    "These are results of a simulation. They replace no test of a helmet, and a verdict here is no "
    "certificate: it compares numbers with limits.",
    "Skull and headform are rigid. The shell is a whole ellipsoid, without face opening and chin "
    "bar, unless the helmet has a geometry of its own. Visor and deformation of the body are left "
    "out.",
    "With coupling 'spring' the helmet moves against the head in translation only; with 'foam' "
    "each column of the liner is crushed on its own.",
    "Accelerations are inertial, of the head's centre of gravity, in world axes; rotation is shown "
    "in head axes. Unfiltered values "
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
    for log in logs:
        admit_helmets(log)
    falls = [review_fall(impact, standard) for log in logs for impact in log if impact.is_fall]
    struck = {fall.fall: fall for fall in falls}
    found = [
        (log, row)
        for log in logs
        for impact in log
        for row in (struck[impact].strikes if impact in struck else [impact])
    ]
    problems = [
        f"{log.path.name}: {text}" for log in logs for text in (*log.problems, *log.warnings)
    ]
    if not found and not falls:
        paths = ", ".join(str(log.path) for log in logs)
        raise LogError(f"{paths}: no complete impact to report")
    setups = [(row.impact if isinstance(row, Reviewed) else row).setup for _, row in found]
    published = [load_reference("table1").row(setup) or {} for setup in setups]
    models = {
        name: list(dict.fromkeys(m for p in published for m in p.get(name, {})))
        for name in ("force_ratio", "peak_g")
    }
    different = varying(setups)
    names = list(zip(labels(setups), labels(setups, False), strict=True))
    rows, impacts, meshes = [], [], {}
    for i, (log, one) in enumerate(found):  # each is read once
        row = one if isinstance(one, Reviewed) else review(one, standard)
        rows.append((log, row))
        impacts.append(
            article(i + 1, log, row, names[i], published[i], models, different, len(found))
        )
        with suppress(LogError):  # the article says that it has no replay
            if mesh := mesh_data(row.impact.record):
                meshes[mesh[0]] = mesh[1]
    failed = sum(row.evaluation.verdict == "fail" for _, row in rows)
    differing = sum(bool(row.differences) for _, row in rows)
    differing += sum(bool(fall.differences) for fall in falls)
    context = {
        "version": _version(),
        "title": "Impact report: " + ", ".join(log.path.name for log in logs),
        "verdict": "fail" if failed or differing else "pass",
        "headline": _headline([row for _, row in rows], falls, failed, differing),
        "problems": problems,
        "impacts": impacts,
        **strikes_section([row for _, row in rows], falls),
        "meshes": {key: packed({}, arrays) for key, arrays in meshes.items()},
        "comparisons": comparisons(logs, rows),
        "models": models,
        "reference": load_reference("table1").source,
        "setup": setup_rows(common(setups)),
        "provenance": [row for log in logs for row in _provenance(log)],
        "kept": sum(not m["fail"] for _, row in rows for m in messages(row.evaluation)),
        "limits": [_struck(setups), *LIMITS],
    }
    context |= {name: Markup(_asset(file)) for name, file in _INLINE.items()}
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True
    )
    return environment.from_string(_asset("report.html.j2")).render(context)


def _headline(
    rows: Sequence[Reviewed], falls: Sequence[ReviewedFall], failed: int, differing: int
) -> str:
    titles = ", ".join(dict.fromkeys(row.evaluation.title for row in rows))
    ending = "s" if len(rows) > 1 else ""
    what = f"head strike{ending}" if falls else f"impact{ending}"
    if falls and any(isinstance(row.impact, LoggedImpact) for row in rows):
        what = f"impact{ending} or head strike{ending}"
    count = f"{len(rows)} {what}"
    if falls:
        count = f"{len(falls)} fall{'s' * (len(falls) > 1)}, " + count
    if not rows:
        return f"{len(falls)} fall{'s' * (len(falls) > 1)}: {NOTHING}"
    text = f"{count}: {failed} above a limit" if failed else f"{count}, all within the limits"
    text += f" of {titles}"
    if differing:
        text += f"; {differing} with logged criteria that the samples do not give"
    return text


def _struck(setups: Sequence[Mapping[str, object]]) -> str:
    names = dict.fromkeys(str(setup.get("impact.surface", "ground")) for setup in setups)
    return (
        f"What is struck ({', '.join(names)}) is rigid but for the panels that its file names, and "
        "has the shape that the replay shows, with the rounded edges of that file."
    )


def _provenance(log: ImpactLog) -> list[dict[str, str]]:
    hashes = dict.fromkeys(impact.model_hash for impact in log)
    values = {
        "log": log.path.name,
        "written by": log.library,
        **{key.replace("version.", "version of "): value for key, value in log.run.items()},
        "model (SHA-256)": ", ".join(filter(None, hashes)),
    }
    return [{"name": key, "value": value} for key, value in values.items() if value]


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
