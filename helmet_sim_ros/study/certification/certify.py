"""Run a whole certification campaign and judge it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from helmet_sim_ros.biomech.evaluation import evaluate
from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.biomech.result import Criterion, Evaluation
from helmet_sim_ros.model.placement import site_deg
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.study.certification.campaign import Campaign, Hit, make_campaign
from helmet_sim_ros.study.certification.protocol import load_protocol

#: Stands above every result.
DISCLAIMER = (
    "This is a simulation, not a test, and no approval: no helmet was struck, and no authority has "
    "seen it. A verdict compares simulated numbers with limits."
)
#: Computed beside what the limits need.
CRITERIA = ("peak_g", "peak_g_cfc1000", "hic_cfc1000", "peak_angular_acceleration_cfc1000",
            "peak_angular_velocity", "bric", "peak_compression")  # fmt: skip
STANDARD_GRAVITY = 9.80665  # m/s^2

Verdict = Literal["pass", "fail", "info"]
#: Called with finished, total and failed impacts.
Progress = Callable[[int, int, int], None]


@dataclass(frozen=True)
class Row:
    """One impact and its verdict.

    Attributes:
        hit: what was struck, where and how fast.
        evaluation: criteria, with limits where the protocol has any.
        margin: least of 1 - value / limit; below 0: a limit is exceeded; None: there is none.
        closest: name of the criterion with that margin.
        site_deg: azimuth and elevation of the point [deg].
        time: of the histories (n,) [s].
        acceleration: resultant of the head (n,) [g].
        angular_acceleration: resultant of the head (n,) [rad/s^2].
        crush: residual crush of each foam column (m,) [m]; None for a spring helmet.
        strain: largest strain of any column, 1: crushed to nothing [-]; None for a spring helmet.
        notes: of the simulation.
    """

    hit: Hit
    evaluation: Evaluation
    margin: float | None
    closest: str | None
    site_deg: tuple[float, float]
    time: FloatArray
    acceleration: FloatArray
    angular_acceleration: FloatArray
    crush: FloatArray | None
    strain: float | None
    notes: tuple[str, ...]

    @property
    def test(self) -> str:
        """Name of the protocol's test."""
        return self.hit.test

    @property
    def headform(self) -> str | None:
        """What stands for the head."""
        return self.hit.setup.head.form

    @property
    def point(self) -> str:
        """Name of the struck point."""
        return self.hit.point

    @property
    def anvil(self) -> str:
        """What was struck."""
        return self.hit.anvil

    @property
    def hit_number(self) -> int:
        """1 for a new helmet, 2 for the second impact on the same spot."""
        return self.hit.number

    @property
    def speed(self) -> float:
        """Speed of the drop [m/s]."""
        return self.hit.speed

    @property
    def normal_velocity(self) -> float:
        """Part of it into the anvil's face [m/s]."""
        return self.hit.setup.normal_velocity

    @property
    def tangential_velocity(self) -> float:
        """Part of it along the anvil's face [m/s]."""
        return self.hit.setup.tangential_velocity

    @property
    def criteria(self) -> Mapping[str, Criterion]:
        """By name."""
        return self.evaluation.criteria

    @property
    def verdict(self) -> Verdict:
        """``info`` where the protocol sets no limit."""
        if self.margin is None:
            return "info"
        return "pass" if self.margin >= 0.0 else "fail"


@dataclass(frozen=True)
class Certification:
    """A whole campaign, judged.

    Attributes:
        campaign: what was done.
        rows: every impact in the protocol's order.
        column_position: of the foam columns, helmet frame (m, 3) [m]; None for a spring helmet.
        disclaimer: what stands above every result.
    """

    campaign: Campaign
    rows: tuple[Row, ...]
    column_position: FloatArray | None
    disclaimer: str = DISCLAIMER

    @property
    def verdict(self) -> Verdict:
        """``fail`` if any impact fails; ``info`` where the protocol sets no limit at all."""
        verdicts = {row.verdict for row in self.rows}
        return "fail" if "fail" in verdicts else "pass" if "pass" in verdicts else "info"

    @property
    def worst(self) -> Row | None:
        """The row with the least margin; None without limits."""
        judged = [row for row in self.rows if row.margin is not None]
        return min(judged, key=lambda row: row.margin or 0.0, default=None)

    @property
    def worst_margin(self) -> float | None:
        """Its margin."""
        return self.worst.margin if self.worst is not None else None

    @property
    def failed(self) -> tuple[Row, ...]:
        """Rows above a limit."""
        return tuple(row for row in self.rows if row.verdict == "fail")

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader should know, in words."""
        own = [f"{row.hit.name}: {note}" for row in self.rows for note in row.notes]
        return (*self.campaign.notes, *own)


def certify(
    helmet: str = "fullface",
    protocol: str | Path = "ece_r22_06",
    *,
    headforms: Sequence[str] = (),
    overrides: Mapping[str, object] | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Certification:
    """Do everything to a helmet that a protocol asks for, as far as it can be simulated.

    The result does not depend on the number of workers.

    Args:
        helmet: name in ``config/helmets``, or path.
        protocol: name in ``config/protocols``, or path.
        headforms: sizes to test, names in ``config/headforms``, or ``("all",)``: every size of the
            protocol. The helmet's file is for the protocol's headform; it is made anew for the
            others, see :func:`helmet_sim_ros.study.certification.sizes.remade`.
        overrides: dotted names that replace values in every impact.
        workers: impacts at the same time; unset: one per core. They are threads: the physics runs
            without the interpreter lock.
        progress: called after every impact.

    Raises:
        SetupError: unknown helmet or protocol, a refused value, or a helmet too small for the
            headform; nothing has run by then.
        DivergedError: an impact could not be simulated.
    """
    campaign = make_campaign(helmet, str(protocol), load_protocol(protocol), overrides, headforms)
    return run_campaign(campaign, workers, progress)


def run_campaign(
    campaign: Campaign, workers: int | None = None, progress: Progress | None = None
) -> Certification:
    """Simulate and judge every impact of a campaign."""
    total, done, failed = len(campaign.hits), 0, 0
    found: dict[int, tuple[list[Row], FloatArray | None]] = {}
    with ThreadPoolExecutor(workers or len(os.sched_getaffinity(0))) as pool:
        waiting = {pool.submit(_struck, site): k for k, site in enumerate(campaign.sites)}
        try:
            for future in as_completed(waiting):
                rows, _ = found[waiting[future]] = future.result()
                done += len(rows)
                failed += sum(row.verdict == "fail" for row in rows)
                if progress is not None:
                    progress(done, total, failed)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    every = tuple(row for k in range(len(campaign.sites)) for row in found[k][0])
    return Certification(campaign, every, found[0][1])


def _struck(site: tuple[Hit, ...]) -> tuple[list[Row], FloatArray | None]:
    """The impacts on one spot, each on what the ones before have left of the liner."""
    rows: list[Row] = []
    crush: FloatArray | None = None
    position: FloatArray | None = None
    for hit in site:
        record = simulate(hit.setup, crush)
        crush, position = record.extras.get("crush"), record.extras.get("column_position")
        rows.append(_judged(hit, record))
    return rows, position


def _judged(hit: Hit, record: ImpactRecord) -> Row:
    evaluation = evaluate(record, hit.standard, CRITERIA)
    margin, closest = None, None
    if hit.standard is not None:
        margins = {
            name: 1.0 - c.value / c.limit
            for name, c in evaluation.criteria.items()
            if c.limit is not None and c.limit > 0.0
        }
        closest = min(margins, key=lambda name: margins[name])
        margin = margins[closest]
    linear = np.linalg.norm(record.head_acceleration, axis=1) / STANDARD_GRAVITY
    turning = np.linalg.norm(record.head_angular_acceleration, axis=1)
    crush = record.extras.get("crush")
    return Row(
        hit, evaluation, margin, closest, site_deg(hit.setup), record.time, linear, turning,
        record.extras.get("residual_crush"), None if crush is None else float(crush.max()),
        record.notes,
    )  # fmt: skip
