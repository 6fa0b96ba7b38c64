"""Qualities of service of the public topics, in one place."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

#: Blocks of ``impact/samples`` that may be on their way to the slowest reader. The writer waits
#: for acknowledgements before it would overwrite one. A reader of ours holds 50 unread messages
#: (``config/middleware``) and acknowledges no more, so nobody runs far ahead of it.
SAMPLES_IN_FLIGHT = 50

#: Writer of ``impact/samples``.
SAMPLES_WRITER = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    history=HistoryPolicy.KEEP_LAST,
    depth=2 * SAMPLES_IN_FLIGHT,
)
#: Reader of ``impact/samples``: refuses to acknowledge what it cannot store, so nothing is lost.
SAMPLES_READER = QoSProfile(reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_ALL)
#: State topics: the last message is there for who comes late.
LATCHED = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
)
#: Reader of a state topic that wants what came between as well.
STATUS_READER = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    history=HistoryPolicy.KEEP_LAST,
    depth=50,
)
#: ``evaluation/criteria``: latched, and deep enough for a client that is busy for a while.
CRITERIA = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    history=HistoryPolicy.KEEP_LAST,
    depth=100,
)
#: Evaluations that may be on their way; the evaluator waits before it would overwrite one.
CRITERIA_IN_FLIGHT = 50
#: Reader of ``evaluation/criteria`` that may not miss any.
CRITERIA_READER = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    history=HistoryPolicy.KEEP_ALL,
)
#: Live view, decimated.
LIVE = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=100
)
#: Services that many clients may call at once. ROS keeps 10 requests that wait by default and drops
#: the oldest of more, whose client then waits for ever; its services of parameters keep 1000.
SERVICE = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=1000
)
#: /clock; its usual readers are volatile and best effort.
CLOCK = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=10
)

_FOREVER = "{sec: 9223372036, nsec: 854775807}"


def as_yaml(profile: QoSProfile) -> str:
    """A profile as a log carries it (``offered_qos_profiles``), in rosbag2's form."""
    history = "keep_all" if profile.history == HistoryPolicy.KEEP_ALL else "keep_last"
    reliable = profile.reliability == ReliabilityPolicy.RELIABLE
    latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    return (
        f"- history: {history}\n"
        f"  depth: {profile.depth}\n"
        f"  reliability: {'reliable' if reliable else 'best_effort'}\n"
        f"  durability: {'transient_local' if latched else 'volatile'}\n"
        f"  deadline: {_FOREVER}\n"
        f"  lifespan: {_FOREVER}\n"
        "  liveliness: automatic\n"
        f"  liveliness_lease_duration: {_FOREVER}\n"
        "  avoid_ros_namespace_conventions: false\n"
    )
