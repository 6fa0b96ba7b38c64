"""Head and neck on a driven first thoracic vertebra (T1), as volunteers on a sled.

T1 moves along a given acceleration without turning, so in its frame every mass feels gravity less
that acceleration: the same neck as a rider's, on a thorax that rests. No helmet, no ground.
Volunteers' T1 also turns, by some 20 deg in a 15 g frontal test, and their muscles act: a passive
neck on an upright T1 is compared with them in size and timing, not in detail.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.force import neck as force
from helmet_sim_ros.model.force.bodies import motion_of, no_loads
from helmet_sim_ros.model.force.neck import CervicalSpine
from helmet_sim_ros.model.rider.anthropometry import anthropometry
from helmet_sim_ros.model.rider.neck import add_neck, cervical_spine, set_rest
from helmet_sim_ros.model.rider.properties import Rider
from helmet_sim_ros.resources import find_config
from helmet_sim_ros.schema import Config, quantity
from helmet_sim_ros.yaml_file import read_yaml

STEP = 1e-4  # s
GRAVITY = np.array([0.0, 0.0, -9.80665])  # m/s^2
_SENSORS = ("head_force", "head_torque", "head_specific_force")


@dataclass(frozen=True)
class SledResponse:
    """Histories in T1's axes: x forward, y left, z up; n samples.

    Attributes:
        time: (n,) [s].
        rotation: rotation vector of the head, (n, 3) [rad]; y > 0 is flexion.
        displacement: of the head's centre of gravity from its start, (n, 3) [m].
        acceleration: inertial, of the head's centre of gravity, (n, 3) [m/s^2].
        neck_force: of the neck on the head, head axes, (n, 3) [N].
        neck_torque: its moment about the head-neck joint, head axes, (n, 3) [N m].
    """

    time: FloatArray
    rotation: FloatArray
    displacement: FloatArray
    acceleration: FloatArray
    neck_force: FloatArray
    neck_torque: FloatArray


def mounted_neck(rider: Rider) -> tuple[mujoco.MjModel, CervicalSpine]:
    """A rider's head and neck on a thorax that rests, and the constants of the neck's force."""
    body = anthropometry(rider)
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    head = add_neck(spec.worldbody.add_body(name="thorax"), rider.neck, body)
    segment = body.segments["head"]
    head.mass, head.ipos, head.inertia = segment.mass, [0.0, 0.0, 0.0], list(segment.inertia)
    head.explicitinertial = True
    kind, site = mujoco.mjtSensor, mujoco.mjtObj.mjOBJ_SITE
    for name, sensor, objtype, objname in (
        ("head_force", kind.mjSENS_FORCE, site, "neck_load"),
        ("head_torque", kind.mjSENS_TORQUE, site, "neck_load"),
        ("head_specific_force", kind.mjSENS_FRAMELINACC, mujoco.mjtObj.mjOBJ_XBODY, "head"),
    ):
        spec.add_sensor(name=name, type=sensor, objtype=objtype, objname=objname)
    model = spec.compile()
    set_rest(model, 0.0)
    return model, cervical_spine(model, rider.neck)


def sled(rider: Rider, acceleration: FloatArray) -> SledResponse:
    """The response of a rider's head and neck to a motion of T1.

    Args:
        rider: whose head and neck.
        acceleration: of T1 in its own axes, every ``STEP`` seconds, (n, 3) [m/s^2]; braking a
            sled that rode forwards is x < 0.

    Raises:
        SetupError: wrong shape, or a value that is not finite.
    """
    driven = np.asarray(acceleration, dtype=np.float64)
    if driven.ndim != 2 or driven.shape[1] != 3 or not np.isfinite(driven).all():
        raise SetupError.of("acceleration", driven.shape, "must be finite, of shape (n, 3)")
    model, neck = mounted_neck(rider)
    data = mujoco.MjData(model)
    motion, loads = motion_of(data), no_loads(model, data.qfrc_applied)
    n = len(driven)
    quaternion, position = np.zeros((n, 4)), np.zeros((n, 3))
    sensed = {name: np.zeros((n, 3)) for name in _SENSORS}
    head = data.body("head")
    for i in range(n):
        model.opt.gravity[:] = GRAVITY - driven[i]
        mujoco.mj_step1(model, data)
        loads.generalised[:] = 0.0
        force.apply(neck, motion, loads)
        quaternion[i], position[i] = head.xquat, head.xpos
        mujoco.mj_step2(model, data)
        for name in _SENSORS:  # of the state before the step
            sensed[name][i] = data.sensor(name).data
    # MuJoCo's framelinacc lacks the field's acceleration, T1's among it.
    specific = sensed["head_specific_force"]
    return SledResponse(
        time=STEP * np.arange(n, dtype=np.float64),
        rotation=Rotation.from_quat(quaternion[:, [1, 2, 3, 0]]).as_rotvec(),
        displacement=position - position[0],
        acceleration=specific + GRAVITY,
        neck_force=sensed["head_force"],
        neck_torque=sensed["head_torque"],
    )


class Published(Config):
    """What volunteers did in a sled test: range of the corridor or of the subjects."""

    rotation_deg: tuple[float, float] = quantity("peak rotation of the head", "deg")
    displacement_mm: tuple[float, float] | None = quantity(
        "peak displacement of the head's centre of gravity along the pulse", "mm", None
    )
    source: str = Field(description="where it stands")
    evidence: Literal["read", "general"] = Field(description="general: nobody re-read it")


class SledTest(Config):
    """One published sled test, from ``config/references/neck.yaml``."""

    name: str = Field(description="of the test")
    peak_g: float = quantity("peak acceleration of T1, a half-sine", "g")
    speed_change: float = quantity("amount of its integral", "m/s", gt=0.0)
    axis: Literal["x", "y"] = Field(description="along which T1 is accelerated")
    source: str = Field(description="of the pulse")
    evidence: Literal["read", "general"] = Field(description="general: nobody re-read it")
    response: Published | None = Field(None, description="what volunteers did")

    def pulse(self, duration: float) -> FloatArray:
        """Acceleration of T1 over a duration [s], (n, 3) [m/s^2]."""
        along = half_sine(self.peak_g * 9.80665, self.speed_change, duration)
        return along if self.axis == "x" else along[:, [1, 0, 2]]


def sled_tests() -> tuple[SledTest, ...]:
    """The published sled tests of ``config/references/neck.yaml``.

    Raises:
        SetupError: the file is not as it should be.
    """
    path = find_config("references", "neck", "reference")
    tests = read_yaml(path, "reference").get("sled", [])
    return tuple(SledTest.from_mapping(test, str(path)) for test in tests)


def half_sine(peak: float, speed_change: float, duration: float) -> FloatArray:
    """A half-sine pulse along x that changes the speed by ``speed_change``, then rest, (n, 3).

    Args:
        peak: acceleration [m/s^2], its sign that of the pulse.
        speed_change: amount of the integral [m/s].
        duration: of the whole history [s].
    """
    length = np.pi * speed_change / (2.0 * abs(peak))
    time = STEP * np.arange(round(duration / STEP))
    pulse = np.zeros((len(time), 3))
    pulse[:, 0] = np.where(time < length, peak * np.sin(np.pi * time / length), 0.0)
    return pulse
