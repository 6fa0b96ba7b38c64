"""A body at rest: what its joints and the points of its parts have behind them."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray

GRAVITY = 9.80665  # m/s^2


class AtRest:
    """A compiled model in its rest posture.

    Attributes:
        inverse: of the mass matrix, (nv, nv).
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Of a model; ``data``: as new, to be left alone as long as this is in use."""
        self._model, self._data = model, data
        self._data.qpos[7:] = model.qpos_spring[7:]
        mujoco.mj_fwdPosition(model, self._data)
        self.inverse: FloatArray = np.zeros((model.nv, model.nv))
        mujoco.mj_solveM(model, self._data, self.inverse, np.eye(model.nv))

    def joint_inertia(self) -> FloatArray:
        """What a torque on each degree of freedom alone accelerates, (nv,) [kg m^2]."""
        inertia: FloatArray = 1.0 / np.diag(self.inverse)
        return inertia

    def weights(self, joints: NDArray[np.int64]) -> FloatArray:
        """The most that the weight of what hangs on a joint turns it, (n,) [N m]."""
        model, data, body = self._model, self._data, self._model.jnt_bodyid[joints]
        arm = np.cross(data.xaxis[joints], data.subtree_com[body] - data.xanchor[joints])
        lever = np.sqrt((arm * arm).sum(axis=1))
        turning: FloatArray = model.body_subtreemass[body] * GRAVITY * lever
        return turning

    def lightest_masses(self, bodies: NDArray[np.int64], points: FloatArray) -> FloatArray:
        """The least mass that a force at a point of a body moves, in any direction, (n,) [kg].

        Args:
            bodies: (n,); ``points``: in the bodies' frames, (n, 3) [m].
        """
        model, data = self._model, self._data
        turn = data.xmat[bodies].reshape(-1, 3, 3)
        at = data.xpos[bodies] + (turn @ points[:, :, None])[:, :, 0]
        jacobian = np.zeros((len(bodies), 3, model.nv))
        for moving, place, body in zip(jacobian, at, bodies.tolist(), strict=True):
            mujoco.mj_jac(model, data, moving, None, place, body)
        yielding = jacobian @ self.inverse @ jacobian.transpose(0, 2, 1)
        most: FloatArray = np.linalg.eigvalsh(yielding)[:, -1].astype(np.float64)
        return 1.0 / most
