"""Show the impacts of logs in 3-D: as slow-motion video, or live in a window."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import click

from helmet_sim_ros.cli._console import PlainConsole
from helmet_sim_ros.cli._logs import FINE, complain, for_each_log, logs_argument
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log import ImpactLog, LoggedImpact


@click.command()
@logs_argument
@click.option("--output", "-o", type=click.Path(path_type=Path), default=Path("videos"),
              show_default=True, metavar="DIR|FILE.mp4",
              help="Where the videos go; a file for a single one.")  # fmt: skip
@click.option("--impact", "only", multiple=True, metavar="ID|N",
              help="Only this impact, by id or number, repeatable.")  # fmt: skip
@click.option("--slow", default=100.0, show_default=True, type=click.FloatRange(1.0, 10000.0),
              help="How many times slower than the impact.")  # fmt: skip
@click.option("--size", default="1280x720", show_default=True, metavar="WIDTHxHEIGHT")
@click.option("--rate", default=30, show_default=True, type=click.IntRange(1, 120),
              help="Pictures per second.")  # fmt: skip
@click.option("--close", is_flag=True, help="Look at head and helmet only.")
@click.option("--azimuth", default=135.0, show_default=True, help="Direction of the view [deg].")
@click.option("--elevation", default=-12.0, show_default=True, help="Its elevation [deg].")
@click.option("--live", is_flag=True, help="Show it in MuJoCo's viewer instead.")
def command(
    logs: tuple[Path, ...],
    output: Path,
    only: tuple[str, ...],
    slow: float,
    size: str,
    rate: int,
    close: bool,
    azimuth: float,
    elevation: float,
    live: bool,
) -> None:
    """Render a video of every impact of each LOG: bodies, force arrows, and the pulse as time bar.

    Videos: DIR/LOG_IMPACT.mp4, or FILE.mp4 where only one impact is shown. No screen is needed,
    except for --live.
    """
    width, height = _size(size)
    single = _is_file(output)
    if live:
        if sys.platform == "linux" and not _has_screen():
            raise click.UsageError(
                "--live needs a screen: neither DISPLAY nor WAYLAND_DISPLAY is set"
            )
    else:
        from helmet_sim_ros.report.replay.gl import GraphicsError, choose_backend

        try:
            choose_backend()
        except GraphicsError as error:
            raise SystemExit(complain(error)) from error
    from helmet_sim_ros.cli.export import plain
    from helmet_sim_ros.report.replay.scene import admit_helmets
    from helmet_sim_ros.report.review.summary import label

    def show(log: ImpactLog) -> int:
        admit_helmets(log)
        impacts = _chosen(log, only)
        if single and not live and len(logs) * len(impacts) != 1:
            raise click.UsageError(
                f"--output {output}: one file for {len(impacts)} impacts of {len(logs)} logs; "
                "choose one with --impact, or give a directory"
            )
        for impact in impacts:
            if live:
                _live(impact, slow)
                continue
            from helmet_sim_ros.report.replay.video import VideoOptions, write_video

            name = f"{plain(log.path.stem)}_{plain(impact.impact_id)}.mp4"
            path = output if single else output / name
            options = VideoOptions(width, height, rate, slow, close, azimuth, elevation)
            count = write_video(impact.record, path, options, label(impact.setup))
            text = f"{os.path.relpath(path)} ({count} pictures)"
            PlainConsole().print(text, markup=False, soft_wrap=True)
        return FINE

    raise SystemExit(for_each_log(logs, show))


def _chosen(log: ImpactLog, only: tuple[str, ...]) -> list[LoggedImpact]:
    """Impacts by id or by number from 1.

    Raises:
        LogError: there is no such impact.
    """
    if not only:
        return list(log)
    found = []
    for name in only:
        matches = [i for k, i in enumerate(log, 1) if name in (i.impact_id, str(k))]
        if not matches:
            raise LogError(f"{log.path}: no complete impact {name!r}; it has {len(log)}")
        found += matches[:1]
    return found


def _is_file(output: Path) -> bool:
    """Whether the output is a video, not a directory of videos."""
    kinds = (".mp4", ".mkv", ".mov", ".avi", ".webm", ".gif")
    if output.is_dir() or output.suffix.lower() not in kinds:
        return False
    if output.suffix != ".mp4":
        raise click.UsageError(f"--output {output}: a video is an .mp4 file")
    return True


def _size(text: str) -> tuple[int, int]:
    parts = text.lower().split("x")
    if len(parts) == 2 and all(part.isdecimal() for part in parts):
        width, height = map(int, parts)
        if 64 <= width <= 4096 and 64 <= height <= 4096 and width % 2 == height % 2 == 0:
            return width, height
    raise click.UsageError(f"--size {text}: must be WIDTHxHEIGHT, even numbers from 64 to 4096")


def _has_screen() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _live(impact: LoggedImpact, slow: float) -> None:
    """Play an impact in MuJoCo's viewer, again and again, until its window is closed."""
    import mujoco.viewer
    import numpy as np

    from helmet_sim_ros.report.replay.stage import Stage

    record = impact.record
    stage = Stage(record)
    scene = stage.scene
    duration = float(record.time[-1])
    with mujoco.viewer.launch_passive(
        scene.model, scene.data, show_left_ui=False, show_right_ui=False
    ) as viewer:
        viewer.cam.lookat[:] = record.helmet_position[0]
        viewer.cam.distance = 2.5
        began = time.monotonic()
        while viewer.is_running():
            now = (time.monotonic() - began) / slow % duration
            index = int(np.searchsorted(record.time, now))
            with viewer.lock():
                scene.pose(record, index)
                viewer.user_scn.ngeom = 0
                stage.draw_around(viewer.user_scn, index)
            viewer.sync()
            time.sleep(1.0 / 60.0)
