"""One self-contained HTML page about a certification campaign."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path

import jinja2
import numpy as np
from markupsafe import Markup

from helmet_sim_ros.biomech.catalogue import SPOKEN, entry
from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.biomech.result import Criterion
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.model.force.columns import columns, first_touch
from helmet_sim_ros.report.certification.tables import to_csv, to_json
from helmet_sim_ros.report.page.crush import crush_map
from helmet_sim_ros.report.page.svg import Curve, panel
from helmet_sim_ros.study.certification.campaign import direction
from helmet_sim_ros.study.certification.certify import Certification, Row
from helmet_sim_ros.version import __version__

MOST_DOTS = 1000  # in the picture of a helmet with a geometry
#: Of the whole package, whatever the protocol.
NOT_MODELLED = (
    "The headform is rigid. The shell is a whole ellipsoid, without face opening and chin bar, "
    "unless the helmet has a geometry of its own. The visor is left out.",
    "On kerb, hemisphere and edges the shell bends as a plate between anvil and liner; what it "
    "costs to flatten or break the shell is left out.",
    "A column of the liner is crushed on its own, along the anvil's normal; tearing and cracks of "
    "the liner are left out.",
    "Material scatter, production tolerances and ageing are left out: every impact is computed "
    "once, with the values of the helmet's file.",
)


def certification_page(result: Certification) -> str:
    """The page, as text."""
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    protocol = result.campaign.protocol
    worst = result.worst
    return environment.from_string(_asset("certification.html.j2")).render(
        css=Markup(_asset("report.css")),
        script=Markup(_asset("certification.js")),
        scene=_script_json(_scene(result)),
        result=result,
        protocol=protocol,
        version=__version__,
        headline=_headline(result),
        worst=None if worst is None else f"{worst.hit.name}: {_margin(worst)}, {_closest(worst)}",
        rows=[_shown(number, row, result) for number, row in enumerate(result.rows, 1)],
        not_modelled=[*NOT_MODELLED, *protocol.not_modelled],
        limits=_limits(result),
        helmet_values=_helmet_values(result),
    )


def _headline(result: Certification) -> str:
    count = len(result.rows)
    if result.verdict == "info":
        return f"{count} impacts; the protocol sets no limits"
    if result.failed:
        return f"{len(result.failed)} of {count} impacts exceed a limit"
    return f"all {count} impacts are within the limits"


def _margin(row: Row) -> str:
    return "" if row.margin is None else f"{100.0 * row.margin:.1f} %"


def _closest(row: Row) -> str:
    """The criterion that comes closest to its limit, in words."""
    if row.closest is None:
        return ""
    criterion = row.criteria[row.closest]
    return f"{entry(criterion.name).meaning} {_spoken(criterion)}"


def _spoken(criterion: Criterion) -> str:
    unit, factor = SPOKEN.get(criterion.unit, (criterion.unit, 1.0))
    text = f"{criterion.value * factor:.4g} {unit}".rstrip()
    if criterion.limit is not None:
        text += f" of {criterion.limit * factor:.4g} {unit}".rstrip()
    return text


def _shown(number: int, row: Row, result: Certification) -> dict[str, object]:
    time = row.time * 1e3
    curves = [Curve(time, row.acceleration)]
    ends = np.array([time[0], time[-1]])
    for name in ("peak_g_cfc1000", "peak_g"):
        limit = row.criteria[name].limit if name in row.criteria else None
        if limit is not None:
            curves.append(Curve(ends, np.full(2, limit), "law", f"limit {limit:g} g"))
            break
    panels = [panel("Acceleration of the head", "time [ms]", "acceleration [g]", curves)]
    name = "peak_angular_acceleration_cfc1000"
    limit = row.criteria[name].limit if name in row.criteria else None
    if limit is not None or row.tangential_velocity > 0.0:
        curves = [Curve(time, row.angular_acceleration * 1e-3)]
        if limit is not None:
            label = f"limit {limit * 1e-3:g}"
            curves.append(Curve(ends, np.full(2, limit * 1e-3), "law", label))
        panels.append(panel("Angular acceleration of the head", "time [ms]", "[krad/s^2]", curves))
    if row.crush is not None:
        helmet = row.hit.setup.helmet_config
        found = crush_map(row.crush, columns(helmet).point, helmet.geometry is None)
        if found is not None:
            panels.append(found["svg"])  # type: ignore[arg-type]
    values = [_spoken_named(c) for c in row.criteria.values() if c.limit is not None]
    return {
        "number": number,
        "row": row,
        "margin": _margin(row),
        "closest": _closest(row),
        "peak_g": f"{row.criteria['peak_g'].value:.0f}",
        "panels": panels,
        "values": values,
        "messages": [*row.evaluation.messages, *row.evaluation.warnings],
    }


def _spoken_named(criterion: Criterion) -> str:
    return f"{entry(criterion.name).meaning}: {_spoken(criterion)}"


def _scene(result: Certification) -> dict[str, object]:
    """Shell and struck points for the page's 3-D view, metres, helmet frame."""
    helmet = result.rows[0].hit.setup.helmet_config
    shell = helmet.shell
    points: dict[str, dict[str, object]] = {}
    for number, row in enumerate(result.rows, 1):
        where = first_touch(helmet, direction(*row.site_deg)).tolist()
        key = f"{row.site_deg}"
        label = f"{row.hit.name}: {row.verdict}"
        if row.margin is not None:
            label += f", margin {_margin(row)}"
        found = points.setdefault(
            key, {"at": where, "name": row.point, "margin": None, "rows": [], "number": number}
        )
        rows = found["rows"]
        assert isinstance(rows, list)
        rows.append(label)
        margin = found["margin"]
        if row.margin is not None and (not isinstance(margin, float) or row.margin < margin):
            found["margin"], found["number"] = row.margin, number
    return {
        "axes": list(shell.semi_axes),
        "center": list(shell.center),
        "dots": None if helmet.geometry is None else _dots(columns(helmet).point),
        "points": list(points.values()),
    }


def _dots(points: FloatArray) -> object:
    return np.round(points[:: -(-len(points) // MOST_DOTS)], 4).tolist()


def _limits(result: Certification) -> list[dict[str, str]]:
    """Every limit once, with its origin."""
    seen: dict[tuple[str, str], dict[str, str]] = {}
    for row in result.rows:
        for c in row.criteria.values():
            if c.limit is None:
                continue
            seen.setdefault(
                (row.evaluation.standard, c.name),
                {
                    "standard": row.evaluation.standard,
                    "meaning": entry(c.name).meaning,
                    "limit": f"{c.limit:g} {c.unit if c.unit != '-' else ''}".rstrip(),
                    "source": c.source,
                    "verified": "read" if c.verified else "not verified",
                },
            )
    return list(seen.values())


def _helmet_values(result: Certification) -> list[tuple[str, str]]:
    """Every value of the helmet that was struck."""
    described = result.rows[0].hit.setup.described()
    return [
        (name, str(value)) for name, value in described.items()
        if name.startswith(("helmet.", "head.")) and name != "helmet.description"
    ]  # fmt: skip


def _script_json(data: object) -> Markup:
    """JSON that cannot end its script element."""
    text = json.dumps(data, allow_nan=False)
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)


def _asset(name: str) -> str:
    return (resources.files("helmet_sim_ros.report") / "assets" / name).read_text(encoding="utf-8")


def write_certification(result: Certification, folder: Path) -> list[Path]:
    """Write ``certification.csv``, ``.json`` and ``.html`` into a folder.

    Raises:
        LogError: it cannot be written.
    """
    texts = {
        "csv": to_csv(result),
        "json": to_json(result),
        "html": certification_page(result),
    }
    paths = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for suffix, text in texts.items():
            path = folder / f"certification.{suffix}"
            path.write_text(text, encoding="utf-8")
            paths.append(path)
    except OSError as error:
        raise LogError(f"{folder}: cannot be written: {error.strerror}") from error
    return paths
