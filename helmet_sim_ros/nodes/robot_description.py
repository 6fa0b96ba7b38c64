"""The rider as a robot for RViz and Foxglove: latched URDF, and the transforms of its links."""

from __future__ import annotations

import mujoco
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from rclpy.node import Node
from std_msgs.msg import String

from helmet_sim_ros.model.scene import Scene
from helmet_sim_ros.model.urdf import WORLD, urdf
from helmet_sim_ros.nodes.conversion import stamp
from helmet_sim_ros.nodes.qos import LATCHED, LIVE

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # not among the wheels; a ROS distribution has it
    TFMessage = None

TOPIC = "robot_description"
#: Absolute, as every transform listener has it.
TRANSFORMS = "/tf"


class RobotView:
    """Publishes the URDF of the present rider, and where its links are.

    Every link is a child of ``world``: exact also where a joint is none that URDF knows.

    Attributes:
        has_transforms: whether ``tf2_msgs`` is there to publish them.
    """

    def __init__(self, node: Node) -> None:
        self.has_transforms = TFMessage is not None
        self._description = node.create_publisher(String, TOPIC, LATCHED)
        self._transforms = (
            node.create_publisher(TFMessage, TRANSFORMS, LIVE) if self.has_transforms else None
        )
        self._said = ""

    @property
    def wanted(self) -> bool:
        """Whether somebody listens for transforms."""
        return self._transforms is not None and self._transforms.get_subscription_count() > 0

    def describe(self, model: mujoco.MjModel) -> None:
        """Publish the URDF of a compiled model, unless it is what was published last."""
        text = urdf(model)
        if text != self._said:
            self._said = text
            self._description.publish(String(data=text))

    def show(self, scene: Scene, time_ns: int) -> None:
        """Publish where the links of a posed scene are."""
        if self._transforms is not None:
            self._transforms.publish(TFMessage(transforms=transforms(scene, time_ns)))


def transforms(scene: Scene, time_ns: int) -> list[TransformStamped]:
    """From ``world`` to every body of a posed scene."""
    model, data, now = scene.model, scene.data, stamp(time_ns)
    found = []
    for body in range(1, model.nbody):
        w, *rest = data.xquat[body].tolist()
        place = dict(zip("xyz", data.xpos[body].tolist(), strict=True))
        turn = Quaternion(w=w, **dict(zip("xyz", rest, strict=True)))
        one = TransformStamped(
            child_frame_id=model.body(body).name,
            transform=Transform(translation=Vector3(**place), rotation=turn),
        )
        one.header.frame_id, one.header.stamp = WORLD, now
        found.append(one)
    return found
