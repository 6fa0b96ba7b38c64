"""Where named quantities stand in MuJoCo's state and sensor vectors."""

from __future__ import annotations

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray


class Layout:
    """Indices of one compiled model.

    Attributes:
        helmet, head: indices of the bodies.
        fit, fit_velocity: first slide of the helmet against the head in qpos and in qvel; the
            quaternion of its ball joint follows them.
        slide, slide_velocity: first coupling slide in qpos and in qvel; -1: a foam helmet, which
            has none.
        joints: names of the body's joints; ``qpos``, ``qvel`` their places, (m,).
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.helmet = int(model.body("helmet").id)
        self.head = int(model.body("head").id)
        self.fit, self.fit_velocity = _addresses(model, "fit_x")
        names = [model.joint(j).name for j in range(model.njnt)]
        spring = "coupling_x" in names
        self.slide, self.slide_velocity = _addresses(model, "coupling_x") if spring else (-1, -1)
        own = ("root", "fit_", "coupling_")
        body = [j for j, name in enumerate(names) if not name.startswith(own)]
        self.joints = tuple(names[j] for j in body)
        self.qpos = np.array([model.jnt_qposadr[j] for j in body], dtype=int)
        self.qvel = np.array([model.jnt_dofadr[j] for j in body], dtype=int)
        self._sensors = {
            model.sensor(i).name: (int(model.sensor_adr[i]), int(model.sensor_dim[i]))
            for i in range(model.nsensor)
        }

    def read(self, sensors: FloatArray, name: str) -> FloatArray:
        """One sensor's columns of sampled rows."""
        start, size = self._sensors[name]
        return sensors[:, start : start + size]


def _addresses(model: mujoco.MjModel, joint: str) -> tuple[int, int]:
    """Where a joint begins in qpos and in qvel."""
    found = model.joint(joint)
    return int(found.qposadr[0]), int(found.dofadr[0])
