"""What every process of ours tells the middleware before it starts, unless the user chose."""

from __future__ import annotations

import os

from helmet_sim_ros.resources import share_directory

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
#: The first name is Fast DDS 2's (ROS 2 Jazzy), the second Fast DDS 3's.
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")


def prepare_environment(domain_id: int | None = None) -> None:
    """Set the environment of this process and its children; values the user set stay.

    ROS traffic stays on the loopback interface of this host
    (``config/middleware/fastdds_loopback.xml``) unless the user chose another discovery range
    than ``LOCALHOST``, static peers, or profiles of his own; ``docs/security.md`` says more.

    Args:
        domain_id: the ROS domain; None: ``ROS_DOMAIN_ID`` as it is.
    """
    if domain_id is not None:
        os.environ["ROS_DOMAIN_ID"] = str(domain_id)
    folder = str(share_directory() / "config" / "middleware")
    chosen = [os.environ[name] for name in PROFILES if name in os.environ]
    if any(os.path.dirname(path) != folder for path in chosen):  # not ours, from a parent process
        os.environ.setdefault(RANGE, "LOCALHOST")
        return
    wanted = os.environ.get(RANGE, "LOCALHOST")
    here = wanted == "LOCALHOST" or (wanted == "SYSTEM_DEFAULT" and bool(chosen))
    here &= "ROS_STATIC_PEERS" not in os.environ
    name = "fastdds_loopback.xml" if here else "fastdds.xml"
    os.environ.update(dict.fromkeys(PROFILES, os.path.join(folder, name)))
    if here:
        os.environ[RANGE] = "SYSTEM_DEFAULT"  # what is in the profiles, and nothing beside it
