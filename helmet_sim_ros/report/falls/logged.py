"""Falls of a log as results: their head strikes found again in the logged samples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from helmet_sim_ros.mcap_log import ImpactLog, LoggedImpact
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.report.falls.tables import FallResult
from helmet_sim_ros.report.replay.scene import setup_of
from helmet_sim_ros.report.review.strikes import found_strikes


def results_of(log: ImpactLog, names: Mapping[str, str] | None = None) -> Iterator[FallResult]:
    """Every complete fall of a log with its head strikes; impacts in it are left out.

    Args:
        log: opened.
        names: identity -> what a fall is called; unset: its identity.

    Raises:
        LogError: see :func:`result_of`.
    """
    for impact in log:
        if impact.is_fall:
            yield result_of(impact, (names or {}).get(impact.impact_id, ""))


def result_of(fall: LoggedImpact, name: str = "") -> FallResult:
    """A logged fall with its head strikes.

    Raises:
        LogError: the samples are damaged, or this version does not know the setup.
    """
    strikes = found_strikes(fall)
    setup, _ = setup_of(fall.record)
    assert isinstance(setup, Fall)
    return FallResult(name or fall.impact_id, setup, strikes)
