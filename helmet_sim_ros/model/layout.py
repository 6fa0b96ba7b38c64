"""Where named quantities stand in MuJoCo's state and sensor vectors."""

from __future__ import annotations

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray


class Layout:
    """Indices of one compiled model.

    Attributes:
        helmet, head: indices of the bodies.
        slide, slide_velocity: first coupling slide in qpos and in qvel; -1: a foam helmet, which
            has none.
        joints: names of the body's joints; ``qpos``, ``qvel`` their places, (m,).
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.helmet = int(model.body("helmet").id)
        self.head = int(model.body("head").id)
        self.slide = self.slide_velocity = -1
        if int(model.body("helmet").jntnum[0]) == 3:
            first = model.joint("coupling_x")
            self.slide, self.slide_velocity = int(first.qposadr[0]), int(first.dofadr[0])
        names = [model.joint(j).name for j in range(model.njnt)]
        body = [j for j, n in enumerate(names) if n != "root" and not n.startswith("coupling_")]
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
