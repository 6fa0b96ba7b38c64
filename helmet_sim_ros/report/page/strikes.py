"""The head strikes of falls on the page: every fall, a table of its strikes, where they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from markupsafe import Markup

from helmet_sim_ros.mcap_log.strikes import NOTHING
from helmet_sim_ros.report.falls.map import strike_map
from helmet_sim_ros.report.review.check import Reviewed, ReviewedFall
from helmet_sim_ros.report.review.strikes import LoggedStrike
from helmet_sim_ros.report.review.summary import label


def strikes_section(rows: Sequence[Reviewed], falls: Sequence[ReviewedFall]) -> dict[str, object]:
    """Values of the template: ``falls``, ``strikes`` and ``strike_map``.

    Args:
        rows: every impact and strike, in the order of the page.
        falls: of the logs.
    """
    numbers = {row.impact.impact_id: number for number, row in enumerate(rows, 1)}
    struck = [(numbers[row.impact.impact_id], row) for row in rows
              if isinstance(row.impact, LoggedStrike)]  # fmt: skip
    return {
        "falls": [_fall(fall) for fall in falls],
        "strikes": [_strike(number, row) for number, row in struck],
        "strike_map": Markup(strike_map([(f"#{n}", row.impact.found) for n, row in struck
                                         if isinstance(row.impact, LoggedStrike)]))
        if struck else "",
    }  # fmt: skip


def _fall(fall: ReviewedFall) -> dict[str, object]:
    count = len(fall.strikes)
    return {
        "id": fall.fall.impact_id,
        "label": label(fall.fall.setup),
        "strikes": f"{count} head strike{'s' * (count > 1)}" if count else NOTHING,
        "check": fall.check,
        "differs": fall.check == "DIFFERS",
        "differences": [str(difference) for difference in fall.differences],
        "notes": list(fall.fall.record.notes),
    }


def _strike(number: int, row: Reviewed) -> Mapping[str, object]:
    impact = row.impact
    assert isinstance(impact, LoggedStrike)
    found, criteria = impact.found, row.evaluation.criteria
    return {
        "number": number,
        "name": impact.impact_id,
        "time": f"{found.time:.3f}",
        "struck": found.struck,
        "into": f"{found.normal_velocity:.1f}",
        "along": f"{found.tangential_velocity:.1f}",
        "angle": f"{found.body_angle_deg:.0f}",
        "zone": found.location.zone,
        "place": f"{found.location.azimuth_deg:.0f}, {found.location.elevation_deg:.0f}",
        "peak_g": f"{criteria['peak_g'].value:.0f}",
        "hic": f"{criteria['hic'].value:.0f}",
        "bric": f"{criteria['bric'].value:.2f}",
        "verdict": row.evaluation.verdict,
    }
