"""Where named quantities stand in MuJoCo's state and sensor vectors."""

from __future__ import annotations

import mujoco
import numpy as np

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.biomech.rotation import quaternions, rotation_vectors


class Layout:
    """Indices of one compiled model.

    Attributes:
        helmet, head: indices of the bodies; without a helmet both are the head's.
        fit, fit_velocity: first slide of the helmet against the head in qpos and in qvel; the
            quaternion of its ball joint follows them; -1: no helmet.
        slide, slide_velocity: first coupling slide in qpos and in qvel; -1: a foam helmet, which
            has none.
        joints: names of the body's joint coordinates, (m,): of a ball joint ``NAME.x``, ``.y``,
            ``.z``, the components of its rotation vector child against parent; ``qvel`` their
            places in qvel, of a ball joint those of its angular velocity in the child's axes.
        sensors: where each sensor begins and how many numbers it has.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.head = self.helmet = int(model.body("head").id)
        self.fit = self.fit_velocity = self.slide = self.slide_velocity = -1
        worn = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "helmet") >= 0
        if worn:
            self.helmet = int(model.body("helmet").id)
            self.fit, self.fit_velocity = _addresses(model, "fit_x")
        if worn and int(model.body("helmet").jntnum[0]) == 3:
            self.slide, self.slide_velocity = _addresses(model, "coupling_x")
        joints: list[str] = []
        qpos: list[int] = []
        qvel: list[int] = []
        self._balls: list[tuple[int, int]] = []
        for j in range(model.njnt):
            name, q, v = model.joint(j).name, int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j])
            if name == "root" or name.startswith(("coupling_", "fit_")):
                continue
            if model.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_BALL):
                self._balls.append((len(joints), q))
                joints += [f"{name}.{axis}" for axis in "xyz"]
                qpos += [q, q + 1, q + 2]
                qvel += [v, v + 1, v + 2]
            else:
                joints.append(name)
                qpos.append(q)
                qvel.append(v)
        self.joints = tuple(joints)
        self.qvel = np.array(qvel, dtype=int)
        self._qpos = np.array(qpos, dtype=int)
        self.sensors = {
            model.sensor(i).name: (int(model.sensor_adr[i]), int(model.sensor_dim[i]))
            for i in range(model.nsensor)
        }

    def positions(self, qpos: FloatArray) -> FloatArray:
        """Joint positions [rad, or m for a sliding joint] of sampled rows of qpos, (n, m)."""
        found = qpos.take(self._qpos, axis=1)
        for column, first in self._balls:
            turns = qpos[:, [first + 1, first + 2, first + 3, first]]
            found[:, column : column + 3] = rotation_vectors(turns)
        return found

    def pose(self, qpos: FloatArray, joints: tuple[str, ...], positions: FloatArray) -> None:
        """Put joint positions, (m,), of named coordinates into one qpos; inverse of ``positions``.

        Raises:
            KeyError: a name that the model has not.
        """
        places = {name: i for i, name in enumerate(self.joints)}
        values = np.zeros(len(self.joints))
        for name, value in zip(joints, positions, strict=True):
            values[places[name]] = value
        for i, first in enumerate(self._qpos):
            qpos[first] = values[i]
        for column, first in self._balls:
            turn = quaternions(values[None, column : column + 3])[0]
            qpos[first : first + 4] = turn[[3, 0, 1, 2]]

    def read(self, sensors: FloatArray, name: str) -> FloatArray:
        """One sensor's columns of sampled rows."""
        start, size = self.sensors[name]
        return sensors[:, start : start + size]


def _addresses(model: mujoco.MjModel, joint: str) -> tuple[int, int]:
    """Where a joint begins in qpos and in qvel."""
    found = model.joint(joint)
    return int(found.qposadr[0]), int(found.dofadr[0])
