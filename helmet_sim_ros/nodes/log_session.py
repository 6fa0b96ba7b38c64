"""One log file in progress: sample blocks in, every channel at full rate out."""

from __future__ import annotations

import hashlib
import json
import platform
import warnings
from collections.abc import Callable
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import serialize_message

from helmet_sim_ros.biomech.record import ImpactRecord, from_block
from helmet_sim_ros.errors import LogError, SetupError
from helmet_sim_ros.mcap_log.blocks import Assembled, Block
from helmet_sim_ros.mcap_log.digest import SETUP_DIGEST
from helmet_sim_ros.mcap_log.layout import BINARY, FORMAT_VERSION, IMPACT, NO_CRITERIA, RUN
from helmet_sim_ros.mcap_log.writer import LogWriter
from helmet_sim_ros.model.fall.setup import setup_or_fall
from helmet_sim_ros.model.geometry import geometry_digest
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.nodes import samples
from helmet_sim_ros.nodes.conversion import CHANNELS, nanoseconds
from helmet_sim_ros.nodes.qos import CLOCK, CRITERIA, LIVE, SAMPLES_WRITER, as_yaml
from helmet_sim_ros.nodes.recorder_config import RecorderConfig
from helmet_sim_ros.nodes.scene_markers import SceneMarkers
from helmet_sim_ros.nodes.serialised import CLOCK_TOPIC, SerialisedScene, serialised
from helmet_sim_ros.resources import is_path

#: The scene is drawn once per so much simulation time [ns]; it follows from the other channels.
SCENE_PERIOD_NS = 1_000_000
CRITERIA_TOPIC = "evaluation/criteria"
STRIKES_TOPIC = "evaluation/strikes"
#: Packages whose versions decide what an impact gives.
_PACKAGES = ("helmet_sim_ros", "mujoco", "numpy", "scipy", "numba", "pydantic", "rclpy", "mcap")


class LogSession:
    """A log file that is being written. Every method may raise :class:`LogError`.

    Args:
        path: its final name.
        config: scenario text and name to attach.
        resolve: relative topic name -> the name in the log.
        warn: told what is left out of the log.

    Attributes:
        path: its final name.
        impacts: complete impacts in it.
        end_ns: latest simulation time in it [ns].
    """

    def __init__(
        self,
        path: Path,
        config: RecorderConfig,
        resolve: Callable[[str], str],
        warn: Callable[[str], object] = warnings.warn,
    ) -> None:
        self.path = path
        self._warn = warn
        self.impacts = 0
        self.end_ns = 0
        self._resolve = resolve
        self._models: dict[str, str] = {}
        self._attached: set[str] = set()
        self._first: Block | None = None
        self._scene: SerialisedScene | None = None
        self._drawn_next = 0  # ns
        topics = (*(channel.topic for channel in CHANNELS), CLOCK_TOPIC)
        self._topics = {topic: resolve(topic) for topic in topics}
        self._writer = LogWriter(path, f"helmet_sim_ros {_version('helmet_sim_ros')}")
        try:
            self._begin(config)
        except LogError:
            self._writer.abandon(keep=False)
            raise

    def _begin(self, config: RecorderConfig) -> None:
        resolve = self._resolve
        for channel in CHANNELS:
            self._writer.add_channel(resolve(channel.topic), channel.type_name, as_yaml(LIVE))
        for topic, kind, qos in (
            (CLOCK_TOPIC, "rosgraph_msgs/msg/Clock", CLOCK),
            ("scene", "visualization_msgs/msg/MarkerArray", LIVE),
            (samples.TOPIC, "std_msgs/msg/Float64MultiArray", SAMPLES_WRITER),
            (CRITERIA_TOPIC, "diagnostic_msgs/msg/DiagnosticArray", CRITERIA),
            (STRIKES_TOPIC, "diagnostic_msgs/msg/DiagnosticArray", CRITERIA),
        ):
            self._writer.add_channel(resolve(topic), kind, as_yaml(qos))
        self._writer.add_metadata(RUN, run_metadata(config))
        if config.scenario_text:
            self._writer.attach("scenario.yaml", "application/yaml", config.scenario_text, 0)

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return self._writer.size

    def add(self, block: Block, serialized: bytes) -> None:
        """Append a block: every sample on every channel, then the block itself."""
        if block.first == 0 and block.setup is not None:
            self._first = block
            self._scene, self._drawn_next = None, 0
            try:
                setup = setup_or_fall(block.setup)
                self._scene = SerialisedScene(SceneMarkers(setup))
                self._attach_files(setup.helmet_config)
            except SetupError as error:  # a helmet that this node may not or cannot open
                self._warn(
                    f"impact {block.impact_id}: no scene and no file of the helmet in the log: "
                    f"{error}"
                )
        if len(block.data) and self._first is not None:
            record = from_block(list(block.labels), block.data, self._first.setup)
            self._add_samples(record, block.start_time)
        self.end_ns = max(self.end_ns, nanoseconds(block.start_time, 0.0))
        self._writer.write(self._resolve(samples.TOPIC), self.end_ns, serialized)

    def _add_samples(self, record: ImpactRecord, start_time: float) -> None:
        times, messages = serialised(record, start_time)
        topics = {self._topics[topic]: rows for topic, rows in messages.items()}
        first, scene = 0, self._scene
        for end, time_ns in enumerate(times.tolist(), 1):
            drawn = scene is not None and time_ns >= self._drawn_next
            if drawn or end == len(times):
                rows = {topic: rows[first:end] for topic, rows in topics.items()}
                self._writer.write_rows(times[first:end], rows)
                first = end
            if scene is not None and drawn:
                shown = scene.message(record, end - 1, time_ns)
                self._writer.write(self._resolve("scene"), time_ns, shown)
                self._drawn_next = time_ns + SCENE_PERIOD_NS
        self.end_ns = int(times[-1])

    def end_impact(self, impact: Assembled) -> None:
        """Note what became of an impact, and make sure that it survives a crash from here on."""
        first, self._first = self._first, None
        values = {
            "start_time": repr(impact.start_time),
            "samples": str(impact.total),
            "complete": json.dumps(impact.record is not None),
            "problem": impact.problem,
        }
        if first is not None and first.impact_id == impact.impact_id:
            values["setup"] = json.dumps(first.setup)
            if first.setup_digest is not None:
                values[SETUP_DIGEST] = first.setup_digest
            if first.model is not None:
                values["model"] = self._attach_model(first.model)
        self._writer.add_metadata(IMPACT + impact.impact_id, values)
        self._writer.flush()
        self.impacts += impact.record is not None

    def _attach_files(self, helmet: Helmet) -> None:
        """Attach once what a helmet's values only name: its geometry, and a foam of the user's."""
        files = {}
        if helmet.geometry is not None:
            name = f"geometry-{geometry_digest(helmet.geometry)}.npz"
            files[name] = (Path(helmet.geometry), BINARY)
        foam = helmet.liner.foam
        if foam is not None and is_path(foam):
            files[f"foam_{helmet.liner.foam_digest}.yaml"] = (Path(foam), "application/yaml")
        for name, (path, media_type) in files.items():
            if name in self._attached:
                continue
            try:
                content = path.expanduser().read_bytes()
            except OSError as error:
                self._warn(f"{path}: not in the log: {error.strerror}")
                continue
            self._writer.attach(name, media_type, content, self.end_ns)
            self._attached.add(name)

    def _attach_model(self, text: str) -> str:
        """Attach a compiled model once, and give its attachment's name."""
        digest = hashlib.sha256(text.encode()).hexdigest()[:12]
        if digest not in self._models:
            self._models[digest] = f"model_{digest}.xml"
            self._writer.attach(self._models[digest], "application/xml", text, self.end_ns)
        return self._models[digest]

    def add_criteria(self, message: DiagnosticArray, topic: str = CRITERIA_TOPIC) -> None:
        """Append the criteria of an impact, or the head strikes of a fall (``STRIKES_TOPIC``); they
        survive a crash from here on."""
        stamp = message.header.stamp
        time_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
        self.add_serialized_criteria(time_ns, serialize_message(message), topic)

    def add_serialized_criteria(
        self, time_ns: int, serialized: bytes, topic: str = CRITERIA_TOPIC
    ) -> None:
        """The same for a message as it came, and its time."""
        self._writer.write(self._resolve(topic), time_ns, serialized)
        self._writer.flush()

    def note_no_criteria(self, impact_id: str, reason: str) -> None:
        """Note why an impact has no criteria in this log."""
        self._writer.add_metadata(NO_CRITERIA + impact_id, {"reason": reason})
        self._writer.flush()

    def close(self) -> Path:
        """Finish the file under its final name.

        If that fails, what there is stays as ``.part``, unless no impact in it is complete.
        """
        try:
            return self._writer.close()
        except Exception:
            self._writer.abandon(keep=self.impacts > 0)
            raise


def run_metadata(config: RecorderConfig) -> dict[str, str]:
    """When and with what this log was made; the only wall-clock time in it."""
    values = {
        "format": str(FORMAT_VERSION),
        "started": datetime.now(UTC).isoformat(),
        "scenario": config.scenario_name,
        "python": platform.python_version(),
        "platform": platform.platform(),
    }
    return values | {f"version.{name}": _version(name) for name in _PACKAGES}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # run from a source tree
        return "unknown"
