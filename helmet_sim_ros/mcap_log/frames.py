"""Logs as pandas tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from helmet_sim_ros.biomech.record import ImpactRecord, block_labels, block_units, to_block

if TYPE_CHECKING:
    from helmet_sim_ros.mcap_log.reader import ImpactLog


def sample_frame(record: ImpactRecord) -> pd.DataFrame:
    """One row per sample; columns ``head_acceleration.x``, ...; the index is ``time`` [s].

    Units are in ``frame.attrs["units"]``, the setup in ``frame.attrs["setup"]``.
    """
    labels = block_labels(record.joint_names)
    frame = pd.DataFrame(to_block(record), columns=labels)
    frame = frame.set_index("time")
    units = dict(zip(labels, block_units(record.joint_names), strict=True))
    frame.attrs = {"units": units, "setup": dict(record.setup)}
    return frame


def result_frame(log: ImpactLog) -> pd.DataFrame:
    """One row per impact: ``impact_id``, every setup value and criterion, and the verdict."""
    rows = []
    for impact in log.impacts:
        evaluation = impact.evaluation
        rows.append(
            {"impact_id": impact.impact_id, "start_time": impact.start_time}
            | dict(impact.setup)
            | {name: criterion.value for name, criterion in evaluation.criteria.items()}
            | {"verdict": evaluation.verdict}
        )
    return pd.DataFrame(rows)
