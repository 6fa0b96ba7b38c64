"""What the package declares and installs: manifest, extras, files of a wheel."""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import zipfile
from graphlib import TopologicalSorter
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]

#: rosdep keys and ROS packages that were looked up in rosdistro (rosdep/python.yaml and
#: jazzy/distribution.yaml, August 2026). An unknown key breaks `rosdep install` for everyone, so a
#: new one goes here only after the same look-up. There is no key for mcap, pydantic 2 or pyarrow.
KNOWN_KEYS = {
    "rclpy", "diagnostic_msgs", "geometry_msgs", "rcl_interfaces", "rosgraph_msgs", "sensor_msgs",
    "std_msgs", "std_srvs", "visualization_msgs", "launch", "launch_ros", "ros2launch",
    "mcap-ros2-support", "python3-click", "python3-hypothesis", "python3-jinja2",
    "python3-matplotlib", "python3-mujoco-pip", "python3-numba", "python3-numpy", "python3-pandas",
    "python3-pytest", "python3-pytest-timeout", "python3-rich", "python3-rosbags-pip",
    "python3-scipy", "python3-yaml",
}  # fmt: skip

NODES = ("simulation", "scenario", "evaluator", "recorder")


def dependencies() -> list[str]:
    root = ElementTree.parse(ROOT / "package.xml").getroot()
    return [str(element.text) for element in root if element.tag.endswith("depend")]


def imported_packages() -> set[str]:
    """Top-level names that the package's modules import."""
    found = set()
    for path in (ROOT / "helmet_sim_ros").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        found |= set(re.findall(r"^\s*(?:from|import) (\w+)", text, re.MULTILINE))
    return found


def test_the_manifest_names_only_keys_that_exist():
    assert set(dependencies()) <= KNOWN_KEYS
    assert len(dependencies()) == len(set(dependencies()))


def test_every_ros_package_that_is_imported_is_declared():
    ros = {key for key in KNOWN_KEYS if re.fullmatch(r"[a-z0-9_]+", key)}
    assert imported_packages() & ros <= set(dependencies())


def test_every_library_that_is_imported_is_required_or_optional():
    names = importlib.metadata.packages_distributions()
    declared = {
        re.split(r"[^\w.-]", text)[0].lower().replace("_", "-")
        for text in importlib.metadata.requires("helmet_sim_ros") or []
    }
    ours = {path.stem for path in ROOT.glob("*.py")} | {"helmet_sim_ros"}
    for package in imported_packages() - ours - set(sys.stdlib_module_names) - KNOWN_KEYS:
        if package in names:
            installed = {name.lower().replace("_", "-") for name in names[package]}
            optional = any(name.startswith("ros-") for name in installed)
            assert installed & declared or optional, f"{package} ({installed}) is not declared"


def test_the_ros_wheels_are_pinned_and_an_extra():
    requirements = importlib.metadata.requires("helmet_sim_ros") or []
    wheels = [text for text in requirements if text.startswith("ros-")]
    assert {text.split(";")[0].strip() for text in wheels} == {
        "ros-rclpy[fastrtps]==7.1.6", "ros-jazzy-common-interfaces==5.3.6",
    }  # fmt: skip
    assert all("extra == 'ros'" in text.replace('"', "'") for text in wheels)


def test_one_version_everywhere():
    root = ElementTree.parse(ROOT / "package.xml").getroot()
    version = root.findtext("version")
    assert importlib.metadata.version("helmet_sim_ros") == version
    assert f"\n{version} " in (ROOT / "CHANGELOG.rst").read_text(encoding="utf-8")


def test_importing_the_package_loads_neither_physics_nor_ros():
    code = (
        "import sys, helmet_sim_ros, helmet_sim_ros.cli;"
        "heavy = {'mujoco', 'numba', 'numpy', 'scipy', 'rclpy'} & set(sys.modules);"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


@pytest.mark.parametrize(
    "package", ["helmet_sim_ros", "helmet_sim_ros.biomech", "helmet_sim_ros.mcap_log"]
)
def test_every_name_of_a_facade_loads_and_is_no_module(package: str):
    facade = importlib.import_module(package)
    for name in facade.__all__:
        assert not isinstance(getattr(facade, name), ModuleType), name
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = facade.nonsense


#: Room -> rooms below it that it may import, as in docs/architecture.md.
INWARDS = {
    "biomech": set(),
    "model": {"biomech"},
    "mcap_log": {"biomech"},
    "study": {"biomech", "model"},
    "present": {"biomech", "model"},
    "nodes": {"biomech", "model", "mcap_log", "study"},
    "report": {"biomech", "model", "mcap_log", "study", "present"},
    "explore": {"biomech", "model", "mcap_log", "study", "present", "report", "nodes"},
    "cli": {"biomech", "model", "mcap_log", "study", "present", "report", "nodes", "explore"},
}


@pytest.fixture(scope="module")
def modules() -> dict[str, ast.Module]:
    """Every module of the package by its dotted name; a folder stands for its ``__init__``."""
    found = {}
    for path in (ROOT / "helmet_sim_ros").rglob("*.py"):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        found[name.removesuffix(".__init__")] = ast.parse(path.read_text("utf-8"))
    return found


@pytest.fixture(scope="module")
def imports(modules: dict[str, ast.Module]) -> dict[str, set[str]]:
    """The modules of the package that each of them imports: also inside of functions, and for the
    type checker alone."""
    found: dict[str, set[str]] = {name: set() for name in modules}
    for name, module in modules.items():
        for node in ast.walk(module):
            if isinstance(node, ast.Import):
                found[name] |= {alias.name for alias in node.names} & modules.keys()
            elif isinstance(node, ast.ImportFrom):
                assert node.module and not node.level, f"{name}: a relative import"
                inner = {f"{node.module}.{alias.name}" for alias in node.names} & modules.keys()
                found[name] |= inner or {node.module} & modules.keys()
    return found


@pytest.mark.parametrize("room", INWARDS)
def test_imports_point_inwards(imports: dict[str, set[str]], room: str):
    here = [found for name, found in imports.items() if name.split(".")[1:2] == [room]]
    rooms = {name.split(".")[1] for found in here for name in found if "." in name}
    assert here and rooms & INWARDS.keys() <= {room, *INWARDS[room]}


def test_no_modules_import_each_other_in_a_circle(imports: dict[str, set[str]]):
    TopologicalSorter(imports).prepare()  # raises CycleError, which names the circle


def test_no_function_of_the_model_takes_many_parameters(modules: dict[str, ast.Module]):
    """What belongs together is passed together."""
    many = [
        f"{name}.{node.name}: {len(names)}"
        for name, module in modules.items()
        if name.startswith("helmet_sim_ros.model.")
        for node in ast.walk(module)
        if isinstance(node, ast.FunctionDef)
        if len(names := [n for n in ast.walk(node.args) if isinstance(n, ast.arg)]) > 8
    ]
    assert not many


def test_nodes_without_ros_say_what_brings_it():
    code = (
        "import sys; sys.modules['rclpy'] = None; from helmet_sim_ros.cli import main;main(['up'])"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 1
    assert "Traceback" not in run.stderr and "helmet_sim_ros[ros]" in run.stderr


def test_the_science_imports_no_ros():
    code = (
        "import sys\n"
        "class NoRos:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in {'rclpy', 'std_msgs', 'geometry_msgs', 'launch'}:\n"
        "            raise ImportError(name)\n"
        "sys.meta_path.insert(0, NoRos())\n"
        "from helmet_sim_ros import ImpactSetup, evaluate, open_log, simulate\n"
        "from helmet_sim_ros.study import load_scenario\n"
        "print(evaluate(simulate(load_scenario('drop_tests').setups[0])).peak_g.value)\n"
    )
    run = subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT, capture_output=True)
    assert float(run.stdout) > 0


def test_a_worker_loads_only_what_an_impact_needs():
    """Each of these costs memory in every worker of a study, and time at every start."""
    code = (
        "import sys\n"
        "from helmet_sim_ros.study.sweeps.worker import Job, run_chunk\n"
        "(outcome,) = run_chunk(Job('ece_r22_05', ('hic_cfc1000', 'damage', 'clip_3ms')), [{}])\n"
        "assert outcome.status == 'ok' and None not in outcome.values, outcome\n"
        "heavy = 'scipy.signal scipy.stats scipy.ndimage scipy.spatial pyarrow optuna matplotlib'\n"
        "print(*(set(heavy.split()) & set(sys.modules)))\n"
    )
    run = subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT, capture_output=True)
    assert run.stdout.split() == []


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package's wheel, built from a copy of the sources."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    ignored = shutil.ignore_patterns(".*", "build", "install", "log", "logs", "*.egg-info")
    shutil.copytree(ROOT, source, ignore=ignored)
    command = ["-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([sys.executable, *command, "--wheel-dir", str(folder), str(source)], check=True)
    return next(folder.glob("*.whl"))


def test_a_wheel_makes_its_prefix_an_ament_prefix(wheel: Path):
    package = ROOT / "helmet_sim_ros"
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        data = "helmet_sim_ros-" + wheel.name.split("-")[1] + ".data/data"
        assert f"{data}/share/ament_index/resource_index/packages/helmet_sim_ros" in names
        assert f"{data}/share/helmet_sim_ros/package.xml" in names
        for node in NODES:
            info = archive.getinfo(f"{data}/lib/helmet_sim_ros/{node}_node")
            assert info.external_attr >> 16 & 0o111, "must be executable"
        for path in [*(ROOT / "config").rglob("*"), *(ROOT / "launch").rglob("*.py")]:
            if path.is_file() and "__pycache__" not in path.parts:
                assert f"{data}/share/helmet_sim_ros/{path.relative_to(ROOT).as_posix()}" in names
        assert "helmet_sim_ros/py.typed" in names
        for path in [*package.rglob("*.pyi"), *(package / "report" / "assets").iterdir()]:
            assert path.relative_to(ROOT).as_posix() in names


def test_an_installed_wheel_finds_its_configuration(wheel: Path, tmp_path: Path):
    target = tmp_path / "prefix"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, "--target", str(target), str(wheel)], check=True)
    code = (
        "import helmet_sim_ros, helmet_sim_ros.resources as r;"
        "from helmet_sim_ros.study import load_scenario;"
        "print(r.share_directory()); print(len(load_scenario('oblique_table1').cases))"
    )
    run = subprocess.run(
        [sys.executable, "-c", code],
        check=True, capture_output=True, text=True, cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(target)},
    )  # fmt: skip
    folder, count = run.stdout.split()
    assert Path(folder) == target / "share" / "helmet_sim_ros"
    assert count == "6"


def test_a_launcher_prefers_the_python_of_its_own_prefix(tmp_path: Path):
    (tmp_path / "lib" / "helmet_sim_ros").mkdir(parents=True)
    (tmp_path / "bin").mkdir()
    python = tmp_path / "bin" / "python3"
    python.write_text('#!/bin/sh\necho "$@"\n')
    python.chmod(0o755)
    for node in NODES:
        launcher = tmp_path / "lib" / "helmet_sim_ros" / f"{node}_node"
        shutil.copy(ROOT / "scripts" / launcher.name, launcher)
        run = subprocess.run([launcher, "--ros-args"], capture_output=True, text=True, check=True)
        assert run.stdout == f"-m helmet_sim_ros.nodes.{node}_node --ros-args\n"
