"""Falls of a log as results: their head strikes found again in the logged samples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from helmet_sim_ros.mcap_log import ImpactLog
from helmet_sim_ros.model.fall.setup import fall_from_names
from helmet_sim_ros.report.falls.tables import FallResult
from helmet_sim_ros.report.review.strikes import found_strikes


def results_of(log: ImpactLog, names: Mapping[str, str] | None = None) -> Iterator[FallResult]:
    """Every complete fall of a log with its head strikes.

    Args:
        log: impacts in it are left out.
        names: identity -> what a fall is called; unset: its identity.

    Raises:
        LogError: the samples are damaged, or this version does not know the setup.
    """
    for impact in log:
        if impact.is_fall:
            strikes = found_strikes(impact)
            name = (names or {}).get(impact.impact_id, impact.impact_id)
            yield FallResult(name, fall_from_names(impact.setup), strikes)
