"""Which OpenGL MuJoCo can draw with on this machine, without a screen."""

from __future__ import annotations

import os
import subprocess
import sys

from helmet_sim_ros.errors import HelmetSimError

#: MuJoCo's backends that need no screen, the fastest first.
BACKENDS = ("egl", "osmesa")

_PROBE = """
import mujoco
context = mujoco.GLContext(64, 64)
context.make_current()
model = mujoco.MjModel.from_xml_string("<mujoco/>")
mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
"""


class GraphicsError(HelmetSimError):
    """Nothing can be drawn on this machine."""


def choose_backend() -> str:
    """Set ``MUJOCO_GL`` to a backend that works, before MuJoCo is imported.

    A value that the user has set is tried alone.

    Returns:
        The backend.

    Raises:
        GraphicsError: none works; says what to install.
    """
    chosen = os.environ.get("MUJOCO_GL")
    for backend in (chosen,) if chosen else BACKENDS:
        if backend_works(backend):
            os.environ["MUJOCO_GL"] = backend
            return backend
    tried = chosen or " and ".join(BACKENDS)
    raise GraphicsError(
        f"no OpenGL without a screen (MUJOCO_GL={tried}); on Debian and Ubuntu: "
        "sudo apt install libegl1 libgl1-mesa-dri, or libosmesa6"
    )


def backend_works(backend: str) -> bool:
    """Try a backend in a process of its own: one that fails can spoil its process."""
    result = subprocess.run(
        [sys.executable, "-c", _PROBE],
        env=os.environ | {"MUJOCO_GL": backend},
        stdin=subprocess.DEVNULL, capture_output=True, check=False, timeout=60,
    )  # fmt: skip
    return result.returncode == 0
