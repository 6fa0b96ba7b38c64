"""The package as a colcon workspace builds it: every executable starts from install/."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from domains import claim_domain

from helmet_sim_ros.model.compiled import cache_folder

ROOT = Path(__file__).resolve().parents[1]
COLCON = Path(sys.executable).with_name("colcon")
NODES = ("simulation", "scenario", "evaluator", "recorder")

pytestmark = pytest.mark.skipif(not COLCON.exists(), reason="colcon is not installed beside Python")


def build(tmp_path_factory: pytest.TempPathFactory, *options: str) -> Path:
    """Build a copy of the sources; the install directory."""
    workspace = tmp_path_factory.mktemp("workspace")
    ignored = shutil.ignore_patterns(".*", "build", "install", "log", "logs", "*.egg-info")
    shutil.copytree(ROOT, workspace / "src" / "helmet_sim_ros", ignore=ignored)
    environment = os.environ | {
        "PATH": f"{COLCON.parent}:{os.environ['PATH']}",
        "PYTHONWARNINGS": "ignore",
    }
    run = subprocess.run(
        [COLCON, "build", *options], cwd=workspace, env=environment, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stdout + run.stderr
    # The same sources compile to the same machine code, which the tests have already.
    machine_code = workspace / "install" / "machine_code"
    machine_code.mkdir()
    (machine_code / "helmet_sim_ros").symlink_to(cache_folder().parent)
    return workspace / "install"


@pytest.fixture(scope="module", params=[(), ("--symlink-install",)], ids=["copied", "symlinked"])
def install(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory, *request.param)


def sourced(install: Path, command: str, domain: int = 0) -> subprocess.Popen[str]:
    """Start a command in a shell that sourced the workspace, isolated from any other."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    environment |= {
        "PATH": f"{COLCON.parent}:{os.environ['PATH']}",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(domain),
        "NUMBA_CACHE_DIR": str(install / "machine_code"),
    }
    return subprocess.Popen(
        ["bash", "-c", f". '{install}/setup.bash' && exec {command}"],
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        cwd=install, start_new_session=True,
    )  # fmt: skip


def test_every_executable_starts_from_the_workspace_and_ends_on_sigint(install: Path):
    """A node is up when its own parameter service is there, as another process sees it."""
    folder = install / "helmet_sim_ros" / "lib" / "helmet_sim_ros"
    domain = claim_domain()
    started = {node: sourced(install, str(folder / f"{node}_node"), domain) for node in NODES}
    try:
        watch = sourced(
            install,
            f"{sys.executable} -c \"import rclpy, time; rclpy.init(); n = rclpy.create_node('w')\n"
            "wanted = {f'/{x}/get_parameters' for x in %r}\n"
            "end = time.monotonic() + 60\n"
            "while time.monotonic() < end:\n"
            "    missing = wanted - {name for name, _ in n.get_service_names_and_types()}\n"
            "    if not missing: break\n"
            "    rclpy.spin_once(n, timeout_sec=0.05)\n"
            'print(sorted(missing))"' % (NODES,),
            domain,
        )
        said, _ = watch.communicate(timeout=90)
        assert said.strip().splitlines()[-1] == "[]", said
        for process in started.values():
            process.send_signal(signal.SIGINT)
        for node, process in started.items():
            said, _ = process.communicate(timeout=240)
            assert process.returncode == 0, f"{node}: {said}"
    finally:
        for process in started.values():
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate()


def test_the_workspace_brings_its_own_configuration_and_command(install: Path):
    helmet_sim = install / "helmet_sim_ros" / "lib" / "helmet_sim_ros" / "helmet-sim"
    run = sourced(install, f"{helmet_sim} run no_such_scenario")
    said, _ = run.communicate(timeout=60)
    assert run.returncode == 2
    assert "oblique_table1" in said
    code = "import helmet_sim_ros.resources as r; print(r.share_directory())"
    run = sourced(install, f'{sys.executable} -c "{code}"')
    said, _ = run.communicate(timeout=60)
    assert Path(said.strip()).is_relative_to(install.parent)
    for marker in ("share/ament_index/resource_index/packages/helmet_sim_ros",
                   "share/helmet_sim_ros/package.xml"):  # fmt: skip
        assert (install / "helmet_sim_ros" / marker).is_file()
