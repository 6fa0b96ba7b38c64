"""Figures as files that are the same whenever the figure is."""

from __future__ import annotations

from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from helmet_sim_ros.errors import LogError


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure in the format of its suffix; the same figure gives the same file.

    Raises:
        LogError: it cannot be written, or not in such a format.
    """
    dates = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    try:
        with matplotlib.rc_context({"svg.hashsalt": "helmet_sim_ros", "pdf.fonttype": 42}):
            figure.savefig(path, bbox_inches="tight", metadata=dates.get(path.suffix, {}))
    except (OSError, ValueError) as error:
        raise LogError(f"{path}: cannot be written: {error}") from error
