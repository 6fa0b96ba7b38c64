"""Logs as pandas tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from helmet_sim_ros.biomech.record import ImpactRecord, block_labels, block_units, to_block
from helmet_sim_ros.biomech.result import Evaluation


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


def result_frame(impacts: Iterable[tuple[Mapping[str, Any], Evaluation]]) -> pd.DataFrame:
    """One row per impact: what is given of it, every criterion, and the verdict."""
    return pd.DataFrame(
        dict(given)
        | {name: criterion.value for name, criterion in evaluation.criteria.items()}
        | {"verdict": evaluation.verdict}
        for given, evaluation in impacts
    )
