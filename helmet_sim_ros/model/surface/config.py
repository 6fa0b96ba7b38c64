from __future__ import annotations

import numpy as np

from helmet_sim_ros.model.surface.shapes import HALF_SPACE, Surface
from helmet_sim_ros.schema import Config


class SurfaceConfig(Config):
    friction: float = 0.4

    def compiled(self, friction=None):
        mu = 0.4 if friction is None else friction
        return Surface(
            np.array([HALF_SPACE]),
            np.zeros((1, 3)),
            np.eye(3).reshape(1, 9),
            np.zeros((1, 6)),
            np.array([mu]),
        )

    @property
    def frame(self):
        return np.zeros(3), np.eye(3)


def load_surface(name):
    return SurfaceConfig()
