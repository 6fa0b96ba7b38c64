"""Parameters of the recorder node, and where its logs go."""

from __future__ import annotations

import tempfile
from datetime import UTC, datetime
from pathlib import Path

from pydantic import Field, model_validator

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.mcap_log.writer import PART
from helmet_sim_ros.names import check_file_name, check_path
from helmet_sim_ros.schema import Config, quantity

SUFFIX = ".mcap"
#: Longest file name from outside [byte]; a number and suffixes follow it.
LONGEST_NAME = 200
#: Longest scenario name [byte]; the time of day follows it as well.
LONGEST_SCENARIO = 150


class RecorderConfig(Config):
    """What is recorded where."""

    output_dir: str = Field(
        "logs",
        description="directory of the logs, created if missing; while the node runs, only "
        "directories inside the one it was started with",
    )
    file_name: str = Field(
        "",
        description="name of the log in output_dir, at most 200 bytes; empty: scenario and time of "
        "day (UTC)",
    )
    max_impacts: int = quantity(
        "impacts per file, then the next one begins; 0: no limit", "", 0, ge=0, le=1_000_000
    )
    max_bytes: int = quantity(
        "size at which a file is finished after an impact; 0: no limit", "byte", 0, ge=0, le=10**15
    )
    scenario_name: str = Field("", description="name of the scenario, for file name and metadata")
    scenario_text: str = Field("", description="scenario file, attached to the log")

    @model_validator(mode="after")
    def _names(self) -> RecorderConfig:
        check_path("output_dir", self.output_dir)
        if self.file_name:
            check_file_name("file_name", self.file_name, LONGEST_NAME)
        check_path("scenario_name", self.scenario_name, LONGEST_SCENARIO)
        return self

    @property
    def place(self) -> tuple[str, str, str, str]:
        """What, when it changes, makes the next impact begin another file."""
        return self.output_dir, self.file_name, self.scenario_name, self.scenario_text


def check_inside(config: RecorderConfig, root: Path) -> None:
    """Refuse an output directory outside of the one that the operator chose.

    Raises:
        SetupError: it is outside, also by way of a link.
    """
    try:
        inside = Path(config.output_dir).resolve().is_relative_to(root)
    except (OSError, RuntimeError):  # a loop of links
        inside = False
    if not inside:
        raise SetupError.of(
            "output_dir", config.output_dir,
            f"must be inside {root}, the directory that the recorder was started with",
        )  # fmt: skip


def check_writable(config: RecorderConfig) -> RecorderConfig:
    """Create the output directory if it is missing.

    Raises:
        SetupError: that fails, or no file can be written in it.
    """
    try:
        folder = Path(config.output_dir)
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SetupError.of(
            "output_dir", config.output_dir, f"must be a writable directory ({reason})"
        ) from error
    return config


def free_path(config: RecorderConfig, now: datetime | None = None) -> Path:
    """A path in the output directory that no log uses, finished or not."""
    stem = config.file_name.removesuffix(SUFFIX)
    if not stem:
        moment = (now or datetime.now(UTC)).strftime("%Y%m%dT%H%M%SZ")
        scenario = "".join(c if c.isalnum() or c in "-_" else "_" for c in config.scenario_name)
        stem = f"{scenario or 'impacts'}_{moment}"
    folder = Path(config.output_dir).resolve()
    number = 1
    while True:
        path = folder / (f"{stem}{SUFFIX}" if number == 1 else f"{stem}_{number}{SUFFIX}")
        if not path.exists() and not path.with_name(path.name + PART).exists():
            return path
        number += 1
