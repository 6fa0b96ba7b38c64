"""What stands for a helmet in pictures."""

import numpy as np

from helmet_sim_ros import ImpactSetup
from helmet_sim_ros.model.scene import shell_mesh


def test_the_drawn_mesh_lies_on_the_ellipsoid_that_it_stands_for():
    """The body that carries both has its origin in the ellipsoid's centre."""
    helmet = ImpactSetup(helmet="fullface_chin", rig="headform").helmet_config
    moved = helmet.replaced({"shell.center": (0.01, 0.0, 0.02)})
    for worn in (helmet, moved):
        vertices = shell_mesh(worn).vertices
        upper = vertices[vertices[:, 2] > 0.02]
        levels = np.linalg.norm(upper / np.array(worn.shell.semi_axes), axis=1)
        assert len(upper) > 50 and abs(np.median(levels) - 1.0) < 0.02
        assert np.ptp(levels) < 0.1
