"""Write the tables of README.md and of pages in docs/ from the code they describe.

    python docs/make_tables.py          # rewrite what stands between the markers
    python docs/make_tables.py --check  # exit code 1 if a table is out of date

A block begins with ``<!-- table: NAME -->`` and ends with ``<!-- end of table -->``.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from io import StringIO
from pathlib import Path

import click
from pydantic_core import PydanticUndefined
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rich.console import Console

from helmet_sim_ros import evaluate, simulate
from helmet_sim_ros.biomech.standards import Standard
from helmet_sim_ros.cli import first_line
from helmet_sim_ros.cli import main as main_command
from helmet_sim_ros.cli._table import result_table
from helmet_sim_ros.model.fall.posture import Posture
from helmet_sim_ros.model.foams import Foam
from helmet_sim_ros.model.head_surface import HeadSurface
from helmet_sim_ros.model.headform import Headform
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.model.surface.config import SurfaceConfig
from helmet_sim_ros.model.surface.parts import KINDS, Panel
from helmet_sim_ros.model.surface.scenes import Placed, SceneConfig
from helmet_sim_ros.nodes import qos
from helmet_sim_ros.nodes.conversion import CHANNELS
from helmet_sim_ros.nodes.evaluator_node import EvaluatorConfig
from helmet_sim_ros.nodes.recorder_config import RecorderConfig
from helmet_sim_ros.nodes.scenario_node import PREFIX, ScenarioOptions
from helmet_sim_ros.nodes.setup_parameters import simulation_leaves
from helmet_sim_ros.schema import Config, Leaf, leaves
from helmet_sim_ros.study import load_scenario
from helmet_sim_ros.study.certification.protocol import Point, Protocol, Test
from helmet_sim_ros.study.helmets.importing import ImportPlan
from helmet_sim_ros.study.optimisation.plan import Constraint, Goal, OptimisationFile
from helmet_sim_ros.study.sled import SledTest
from helmet_sim_ros.study.sweeps.population import Population
from helmet_sim_ros.study.sweeps.sampling import Distribution
from helmet_sim_ros.study.sweeps.study import StudyFile
from helmet_sim_ros.study.validation.experiments import Experiment, ExperimentFile
from helmet_sim_ros.study.validation.foam import FoamReference

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
FILES = (ROOT / "README.md", DOCS / "interface.md", DOCS / "files.md", DOCS / "ros.md")
BLOCK = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end of table -->)", re.DOTALL)

#: What the channels of a sample mean, and their units.
MEANING = {
    "head/acceleration": "inertial acceleration of the head's centre of gravity [m/s²], "
    "angular [rad/s²]",
    "head/velocity": "of the head's centre of gravity [m/s], angular [rad/s]",
    "head/pose": "of the head's centre of gravity [m]",
    "head/imu": "what an accelerometer there reads: specific force [m/s²] (REP-145), angular "
    "velocity [rad/s], orientation",
    "helmet/pose": "of the shell; equal to the head's while the coupling is not compressed [m]",
    "helmet/ground_contact": "force of the ground ON the helmet [N], moment about the world "
    "origin [N m]",
    "helmet/coupling": "force of the helmet ON the head [N], moment about the origin of "
    "`helmet/pose` [N m]",
    "neck/load": "force of the torso ON the head [N], moment about the head-neck joint [N m]",
    "joint_states": "joints below the head [rad or m, rad/s or m/s]; of a ball joint the rotation "
    "vector, and the angular velocity in the axes of its upper link",
}
OTHER_TOPICS = (
    ("simulation", "`/clock`", "rosgraph_msgs/msg/Clock", "", qos.CLOCK,
     "simulation time, from start-up on, also while idle"),
    ("simulation", "`scene`", "visualization_msgs/msg/MarkerArray", "world", qos.LIVE,
     "rider, helmet, surface and forces for RViz or Foxglove"),
    ("simulation", "`robot_description`", "std_msgs/msg/String", "", qos.LATCHED,
     "URDF of the present rider and helmet; joints as in `joint_states`"),
    ("simulation", "`/tf`", "tf2_msgs/msg/TFMessage", "world", qos.LIVE,
     "every link from `world`; only where `tf2_msgs` is installed, as in a ROS distribution"),
    ("simulation", "`impact/samples`", "std_msgs/msg/Float64MultiArray", "", qos.SAMPLES_WRITER,
     "every sample in blocks; the layout's labels name channels, impact, first index and total, "
     "and say where samples are not uniform: of a fall"),
    ("simulation", "`~/status`", "diagnostic_msgs/msg/DiagnosticStatus", "", qos.LATCHED,
     "idle, running or paused; impact, samples done, readers"),
    ("evaluator", "`evaluation/criteria`", "diagnostic_msgs/msg/DiagnosticArray", "head",
     qos.CRITERIA, "of an impact: one status per criterion: value, unit, window, limit, verdict"),
    ("evaluator", "`evaluation/strikes`", "diagnostic_msgs/msg/DiagnosticArray", "head",
     qos.CRITERIA, "of a fall: one status per head strike: when, what, how fast, where, all "
     "criteria; or no head contact"),
    ("recorder", "`~/status`", "diagnostic_msgs/msg/DiagnosticStatus", "", qos.LATCHED,
     "last impact that is on disk with its criteria (or why it has none), and the file"),
    ("scenario", "`~/progress`", "std_msgs/msg/String", "", qos.LATCHED,
     "JSON: case, done, failed, cases, time left [s]"),
)  # fmt: skip
SERVICES = (
    ("simulation", "run_impact", "Trigger",
     "run the configured impact; answers when every sample is out, with impact and digest of the "
     "setup"),
    ("simulation", "run_fall", "Trigger",
     "the same for a whole fall, where the parameters describe one (`sim.kind`); answers with the "
     "number of head strikes"),
    ("simulation", "pause", "SetBool", "pause, or go on; asking twice changes nothing"),
    ("simulation", "step", "Trigger", "one slice of a paused impact or fall"),
    ("simulation", "cancel", "Trigger", "end the running impact or fall"),
    ("simulation", "reset", "Trigger", "end it, and no longer paused; parameters and time stay"),
    ("evaluator", "last_result", "Trigger",
     "the last evaluation, or the last head strikes, as JSON"),
    ("recorder", "finish", "Trigger",
     "close the log, or tell which one a limit has closed; the next impact begins another"),
    ("scenario", "run", "Trigger", "run the whole matrix; answers with the result as JSON"),
    ("scenario", "cancel", "Trigger", "end the running matrix"),
)  # fmt: skip


#: Types as a file has them.
TYPES: dict[type, str] = {tuple: "list", dict: "mapping"}


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def quality(profile: QoSProfile) -> str:
    """A quality of service in words."""
    reliable = profile.reliability == ReliabilityPolicy.RELIABLE
    latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    kept = "all" if profile.history == HistoryPolicy.KEEP_ALL else f"last {profile.depth}"
    words = ["reliable" if reliable else "best effort", *(["latched"] if latched else [])]
    return f"{', '.join(words)}, keep {kept}"


def topics() -> str:
    """Every topic with its type, frame, quality of service and meaning."""
    rows = [
        ["simulation", f"`{c.topic}`", c.type_name, c.frame, quality(qos.LIVE), MEANING[c.topic]]
        for c in CHANNELS
    ]
    rows += [[*row[:4], quality(row[4]), row[5]] for row in OTHER_TOPICS]
    return table(("node", "topic", "type", "frame", "QoS", "meaning"), rows)


def services() -> str:
    """Every service of our own."""
    rows = [
        [node, f"`~/{name}`", f"std_srvs/srv/{kind}", text] for node, name, kind, text in SERVICES
    ]
    return table(("node", "service", "type", "meaning"), rows)


def parameters(found: Iterable[Leaf], prefix: str = "") -> str:
    """Parameters with type, unit, range and default."""
    rows = [
        [f"`{prefix}{leaf.name}`", TYPES.get(leaf.type, leaf.type.__name__), leaf.unit or "-",
         _allowed(leaf), _default(leaf), leaf.description.replace("|", "\\|")]
        for leaf in found
    ]  # fmt: skip
    return table(("parameter", "type", "unit", "allowed", "default", "meaning"), rows)


def _allowed(leaf: Leaf) -> str:
    words = leaf.allowed.removeprefix("must be ")
    if leaf.type is dict or words == f"a number {leaf.unit}":
        return "any"
    return words.removeprefix("a number ")


def keys(model: type[Config]) -> str:
    """Keys of a file, of which those of groups are dotted; last those that hold the user's own."""
    found = leaves(model)
    known = {leaf.name for leaf in found}
    for name, field in model.model_fields.items():
        if "dict[" in str(field.annotation) and name not in known:
            default = {} if field.default_factory else field.default
            found.append(Leaf(name, dict, default, "", field.description or ""))
    return parameters(found).replace("| parameter |", "| key |", 1)


def _default(leaf: Leaf) -> str:
    if leaf.default is PydanticUndefined:
        return "required"
    if leaf.default is None:
        return "unset"
    if leaf.default == {}:
        return "empty"
    if isinstance(leaf.default, float):
        return f"{leaf.default:g}"
    if isinstance(leaf.default, tuple):
        return "[" + ", ".join(map(str, leaf.default)) + "]"
    return f"`{leaf.default}`" if leaf.default != "" else "empty"


def _simulation(*groups: str) -> Callable[[], str]:
    def chosen() -> str:
        return parameters(leaf for leaf in simulation_leaves() if leaf.name.startswith(groups))

    return chosen


def demo() -> str:
    """What ``make demo`` prints, computed without the nodes."""
    scenario = load_scenario("oblique_table1")
    rows = [
        {
            "name": case.name, "status": "evaluated", "reference": case.reference,
            "evaluation": evaluate(simulate(case.setup)).as_dict(),
        }
        for case in scenario.cases
    ]  # fmt: skip
    console = Console(width=80, file=StringIO())
    console.print(result_table(rows, scenario.name))
    assert isinstance(console.file, StringIO)
    lines = [line.rstrip() for line in console.file.getvalue().splitlines()]
    return "```text\n" + "\n".join(lines).strip("\n") + "\n```\n"


def verbs() -> str:
    """The verbs of the command line, as ``helmet-sim --help`` lists them."""
    names = main_command.list_commands(click.Context(main_command))
    return table(("verb", "what it does"), [[f"`{n}`", first_line(n)] for n in names])


TABLES: dict[str, Callable[[], str]] = {
    "demo": demo,
    "verbs": verbs,
    "topics": topics,
    "services": services,
    "impact_parameters": _simulation("impact.", "sim.", "helmet.name", "rider.height",
                                     "rider.mass"),
    "fall_parameters": _simulation("fall."),
    "rider_parameters": _simulation("rider."),
    "helmet_parameters": _simulation("helmet."),
    "evaluator_parameters": lambda: parameters(leaves(EvaluatorConfig)),
    "recorder_parameters": lambda: parameters(leaves(RecorderConfig)),
    "scenario_parameters": lambda: parameters(leaves(ScenarioOptions), PREFIX),
    **{model.__name__: partial(keys, model) for model in (
        StudyFile, Distribution, Population, OptimisationFile, Goal,
        Constraint, Protocol, Test, Point, ImportPlan, Helmet, Foam, Headform, HeadSurface, Posture,
        SurfaceConfig, SceneConfig, Placed, Panel, *(kind for kind, _ in KINDS.values()), Standard,
        ExperimentFile, Experiment, FoamReference, SledTest,
    )},
}  # fmt: skip


def rewritten(text: str) -> str:
    """A document with every marked table made anew."""
    return BLOCK.sub(lambda match: f"{match[1]}\n{TABLES[match[2]]()}\n{match[3]}", text)


def main() -> int:
    stale = []
    for path in FILES:
        old = path.read_text(encoding="utf-8")
        new = rewritten(old)
        if new != old:
            stale.append(path)
            if "--check" not in sys.argv:
                path.write_text(new, encoding="utf-8")
    for path in stale:
        print(f"{path.relative_to(ROOT)}: {'out of date' if '--check' in sys.argv else 'updated'}")
    return 1 if stale and "--check" in sys.argv else 0


if __name__ == "__main__":
    raise SystemExit(main())
