"""An impact in slow motion as a video: bodies, force arrows, and the pulse as a time bar."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import imageio_ffmpeg
import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from helmet_sim_ros.biomech.helmet import ground_components
from helmet_sim_ros.biomech.pulse import STANDARD_GRAVITY, magnitude
from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.report.replay.stage import Stage

Picture = NDArray[np.uint8]

_BAR = 0.13  # height of the time bar, share of the picture's
_FIELD_OF_VIEW = 45.0  # deg, MuJoCo's default


@dataclass(frozen=True)
class VideoOptions:
    """How a video looks.

    Attributes:
        width, height: [pixel], even.
        rate: pictures per second.
        slow: how many times slower than the impact.
        close: head and helmet only.
        azimuth, elevation: of the view [deg].
    """

    width: int = 1280
    height: int = 720
    rate: int = 30
    slow: float = 100.0
    close: bool = False
    azimuth: float = 135.0
    elevation: float = -12.0


def write_video(record: ImpactRecord, path: Path, options: VideoOptions, title: str = "") -> int:
    """Render an impact; needs ``MUJOCO_GL`` set to what works (see :mod:`..report.gl`).

    Returns:
        The number of pictures.

    Raises:
        LogError: the model cannot show the record, or the file cannot be written.
    """
    unfinished = path.with_name(f"{path.stem}.unfinished{path.suffix}")
    count = 0
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        sink = imageio_ffmpeg.write_frames(
            unfinished, (options.width, options.height), fps=options.rate, quality=7,
            macro_block_size=2, ffmpeg_log_level="error",
        )  # fmt: skip
        sink.send(None)
        try:
            for picture in pictures(record, options, title):
                sink.send(np.ascontiguousarray(picture))
                count += 1
        finally:
            sink.close()
        unfinished.replace(path)
    except (OSError, RuntimeError) as error:
        raise LogError(f"{path}: the video cannot be written: {error}") from error
    finally:
        unfinished.unlink(missing_ok=True)
    return count


def pictures(record: ImpactRecord, options: VideoOptions, title: str = "") -> Iterator[Picture]:
    """The pictures of a video, shape (height, width, 3)."""
    stage = Stage(record)
    model = stage.scene.model
    model.vis.global_.offwidth, model.vis.global_.offheight = options.width, options.height
    nothing = mujoco.MjvOption()
    nothing.geomgroup[:] = 0  # the stage draws everything itself
    camera = _camera(stage, options)
    bar = TimeBar(record, options.width, round(_BAR * options.height), title)
    with mujoco.Renderer(model, options.height, options.width) as renderer:
        for index in frame_indices(record, options):
            renderer.update_scene(stage.scene.data, camera, nothing)
            stage.draw(renderer.scene, index)
            picture = renderer.render()
            bar.paint(picture, index)
            yield picture


def frame_indices(record: ImpactRecord, options: VideoOptions) -> list[int]:
    """The sample of each picture."""
    duration = float(record.time[-1] - record.time[0])
    count = max(2, round(duration * options.slow * options.rate) + 1)
    return np.linspace(0, len(record) - 1, count).round().astype(int).tolist()  # type: ignore[no-any-return]


def _camera(stage: Stage, options: VideoOptions) -> mujoco.MjvCamera:
    points = np.vstack([*stage.corners()])
    if options.close:
        points = stage.record.helmet_position[[0, -1]]
    low, high = points.min(axis=0) - 0.15, points.max(axis=0) + 0.15
    low[2] = min(low[2], -0.05)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = 0.5 * (low + high)
    radius = 0.5 * float(np.linalg.norm(high - low))
    camera.distance = (
        radius / np.tan(np.radians(0.5 * _FIELD_OF_VIEW)) * (1.3 if options.close else 1)
    )
    camera.azimuth, camera.elevation = options.azimuth, options.elevation
    return camera


class TimeBar:
    """The acceleration pulse with a line at the present time, painted over the lower edge."""

    def __init__(self, record: ImpactRecord, width: int, height: int, title: str) -> None:
        self._time = record.time * 1e3
        self._g = magnitude(record.head_acceleration) / STANDARD_GRAVITY
        self._force = ground_components(record.ground_force, record.ground_friction)[0] / 1e3
        self._width, self._height, self._title = width, height, title
        self._margin = height // 8
        self._font = ImageFont.load_default(size=max(11, height // 5))
        peak = max(float(self._g.max()), 1e-9)
        inner = width - 2 * self._margin
        x = self._margin + inner * np.arange(len(self._g)) / max(len(self._g) - 1, 1)
        y = height - self._margin - (height - 2 * self._margin) * 0.62 * self._g / peak
        self._curve = list(zip(x.tolist(), y.tolist(), strict=True))

    def paint(self, picture: Picture, index: int) -> None:
        """Paint the bar into a picture."""
        strip = Image.fromarray(picture[-self._height :])
        draw = ImageDraw.Draw(strip, "RGBA")
        draw.rectangle((0, 0, self._width, self._height), fill=(255, 255, 255, 215))
        x = self._curve[index][0]
        draw.rectangle(
            (self._margin, self._margin, x, self._height - self._margin), (27, 108, 168, 45)
        )
        draw.line(self._curve, fill=(27, 108, 168, 255), width=max(1, self._height // 40))
        draw.line((x, self._margin, x, self._height - self._margin), (190, 40, 40, 255), 2)
        text = (
            f"{self._time[index]:6.2f} ms   {self._g[index]:5.1f} g   "
            f"normal force {self._force[index]:5.2f} kN   {self._title}"
        )
        draw.text((self._margin, self._margin // 2), text, (25, 28, 32, 255), self._font)
        picture[-self._height :] = np.asarray(strip)
