"""ROS 2 nodes; each is a process of its own. The rest of the package works without ROS."""

from helmet_sim_ros.extra import MissingExtraError

try:
    import rclpy  # noqa: F401
except ImportError as error:
    raise MissingExtraError(
        f"the nodes need ROS 2 (rclpy: {error}): pip install 'helmet_sim_ros[ros]', "
        "or source a ROS 2 workspace"
    ) from error
