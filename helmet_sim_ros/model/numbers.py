"""The numbers of another rider or helmet in a model that is compiled already.

What builds a model calls MuJoCo's specification: bodies, joints, geoms, each with its numbers. The
same calls on a :class:`Numbers` write those numbers into a compiled model of the same structure,
which is much quicker. MuJoCo derives the rest (``mj_setConst``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np


class Numbers:
    """A compiled model, to be told its numbers as a specification's ``worldbody`` is."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Of a model that changes."""
        self._model = model

    def add_body(self, name: str, pos: Sequence[float] = (0.0, 0.0, 0.0)) -> Body:
        """The body of this name, which gets this place."""
        return Body(self._model, name, pos)


class Body(Numbers):
    """One body of the model; has ``mass``, ``ipos``, ``inertia`` and ``explicitinertial`` set."""

    def __init__(self, model: mujoco.MjModel, name: str, pos: Sequence[float]) -> None:
        """Of a model, by name; put at ``pos`` in its parent's frame [m]."""
        super().__init__(model)
        self._body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
        model.body_pos[self._body] = pos

    def __setattr__(self, name: str, value: Any) -> None:
        if name in ("mass", "ipos", "inertia"):
            getattr(self._model, f"body_{name}")[self._body] = value
        elif name != "explicitinertial":
            super().__setattr__(name, value)

    def add_freejoint(self, name: str) -> None:
        """It has no numbers."""

    def add_joint(self, name: str, pos: Sequence[float] = (0.0, 0.0, 0.0), **_: Any) -> Joint:
        """The joint of this name, at ``pos`` in the body's frame [m]; its kind stays."""
        return Joint(self._model, name, pos)

    def add_geom(
        self,
        size: Sequence[float],
        pos: Sequence[float] = (0.0, 0.0, 0.0),
        fromto: Sequence[float] | None = None,
        **_: Any,
    ) -> None:
        """The body's geom; a capsule, which points where it did, by the ends of its segment [m]."""
        model, geom = self._model, int(self._model.body_geomadr[self._body])
        if fromto is None:
            model.geom_pos[geom], model.geom_size[geom] = pos, size
            half = model.geom_size[geom]
        else:
            start, end = np.array(fromto[:3]), np.array(fromto[3:])
            radius, along = size[0], 0.5 * math.dist(start, end)
            model.geom_pos[geom] = 0.5 * (start + end)
            model.geom_size[geom, :2] = radius, along
            half = np.array([radius, radius, along + radius])
        model.geom_rbound[geom], model.geom_aabb[geom, 3:] = half.max(), half

    def add_site(self, name: str, pos: Sequence[float]) -> None:
        """The site of this name, at ``pos`` in the body's frame [m]."""
        site = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_SITE, name)
        self._model.site_pos[site] = pos


class Joint:
    """One joint of the model; its range is no number of a rider's, and stays."""

    def __init__(self, model: mujoco.MjModel, name: str, pos: Sequence[float]) -> None:
        """Of a model, by name; put at ``pos`` in its body's frame [m]."""
        joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
        model.jnt_pos[joint] = pos
        dofs = 3 if model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_BALL) else 1
        first = int(model.jnt_dofadr[joint])
        self._stiffness, self._rest = model.jnt_stiffness[joint : joint + 1], model.qpos_spring
        self._damping, self._qpos = (
            model.dof_damping[first : first + dofs],
            model.jnt_qposadr[joint],
        )

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "stiffness":
            self._stiffness[:] = value[0]
        elif name == "damping":
            self._damping[:] = value[0]
        elif name == "springref":
            self._rest[self._qpos] = value
        elif name not in ("range", "limited"):
            super().__setattr__(name, value)
