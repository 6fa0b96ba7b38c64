"""Logs as pandas tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from helmet_sim_ros.biomech.result import Evaluation


def result_frame(impacts: Iterable[tuple[Mapping[str, Any], Evaluation]]) -> pd.DataFrame:
    """One row per impact: what is given of it, every criterion, and the verdict."""
    return pd.DataFrame(
        dict(given)
        | {name: criterion.value for name, criterion in evaluation.criteria.items()}
        | {"verdict": evaluation.verdict}
        for given, evaluation in impacts
    )
