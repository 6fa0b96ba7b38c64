"""Records and evaluations as pandas tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from helmet_sim_ros.biomech.record import ImpactRecord, block_labels, block_units, to_block
from helmet_sim_ros.biomech.result import Evaluation
from helmet_sim_ros.extra import need

if TYPE_CHECKING:
    import pandas as pd


def sample_frame(record: ImpactRecord) -> pd.DataFrame:
    """One row per sample; columns ``head_acceleration.x``, ...; the index is ``time`` [s].

    Units are in ``frame.attrs["units"]``, the setup in ``frame.attrs["setup"]``.

    Raises:
        MissingExtraError: pandas is not installed.
    """
    labels = block_labels(record.joint_names)
    frame = need("pandas", "report").DataFrame(to_block(record), columns=labels)
    frame = frame.set_index("time")
    units = dict(zip(labels, block_units(record.joint_names), strict=True))
    frame.attrs = {"units": units, "setup": dict(record.setup)}
    return frame


def criteria_frame(evaluation: Evaluation) -> pd.DataFrame:
    """One row per criterion; the index is its name, every attribute of it a column.

    The unit of a row is in its column ``unit`` and in ``frame.attrs["units"]``; the standard is in
    ``frame.attrs["standard"]``.

    Raises:
        MissingExtraError: pandas is not installed.
    """
    criteria = evaluation.as_dict()["criteria"]
    frame = need("pandas", "report").DataFrame.from_dict(criteria, orient="index")
    frame = frame.drop(columns="name")
    frame.index.name = "criterion"
    units = {name: criterion.unit for name, criterion in evaluation.criteria.items()}
    frame.attrs = {"units": units, "standard": evaluation.standard}
    return frame
