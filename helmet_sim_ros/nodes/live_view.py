"""The live view of an impact: clock, per-sample topics and scene, decimated."""

from __future__ import annotations

from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from visualization_msgs.msg import Marker, MarkerArray

from helmet_sim_ros.biomech.record import ImpactRecord
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.nodes.conversion import CHANNELS, messages, stamp
from helmet_sim_ros.nodes.process import WALL
from helmet_sim_ros.nodes.qos import CLOCK, LIVE
from helmet_sim_ros.nodes.robot_description import RobotView
from helmet_sim_ros.nodes.scene_markers import SceneMarkers

#: How often /clock is repeated while simulation time stands still, in wall time [s].
IDLE_PERIOD = 0.1
#: Where simulation time begins [ns]; ROS takes 0 for "no time yet".
BEGIN = 1_000_000_000
#: Impacts start at whole multiples of this [ns], so that stamps of two impacts never meet.
SPACING = 100_000_000


class SimulationClock:
    """Simulation time of a process: it never runs backwards.

    Attributes:
        now: the present simulation time [ns].
    """

    def __init__(self, node: Node) -> None:
        self.now = BEGIN
        self._publisher = node.create_publisher(Clock, "/clock", CLOCK)
        node.create_timer(IDLE_PERIOD, self._publish, clock=WALL)

    def next_start(self) -> int:
        """When the next impact may start [ns]."""
        return (self.now // SPACING + 1) * SPACING

    def advance(self, time_ns: int) -> None:
        """Move on to ``time_ns``, and tell."""
        self.now = max(self.now, time_ns)
        self._publish()

    def _publish(self) -> None:
        self._publisher.publish(Clock(clock=stamp(self.now)))


class LiveView:
    """Publishes samples on the live topics, each to those that listen, and moves the clock."""

    def __init__(self, node: Node, clock: SimulationClock) -> None:
        self._clock = clock
        self._publishers = {c.topic: node.create_publisher(c.type, c.topic, LIVE) for c in CHANNELS}
        self._scene = node.create_publisher(MarkerArray, "scene", LIVE)
        self._markers: SceneMarkers | None = None
        self.robot = RobotView(node)

    def show(self, setup: ImpactSetup, record: ImpactRecord, start_time: float) -> None:
        """Publish every sample of ``record``, a part of an impact of ``setup``."""
        wanted = tuple(c for c in CHANNELS if self._publishers[c.topic].get_subscription_count())
        drawn, robot = self._scene.get_subscription_count() > 0, self.robot.wanted
        markers = self._markers_of(setup) if drawn or robot else None
        for i, (time_ns, filled) in enumerate(messages(record, start_time, wanted)):
            self._clock.advance(time_ns)
            for topic, message in filled.items():
                self._publishers[topic].publish(message)
            if markers is not None:
                message = markers.message(record, i, time_ns)
                if drawn:
                    self._scene.publish(message)
                if robot:
                    self.robot.show(markers.scene, time_ns)

    def _markers_of(self, setup: ImpactSetup) -> SceneMarkers:
        if self._markers is None or self._markers.setup is not setup:
            if self._markers is not None:  # what the scene before had more of would stay
                self._scene.publish(MarkerArray(markers=[Marker(action=Marker.DELETEALL)]))
            self._markers = SceneMarkers(setup)
        return self._markers
