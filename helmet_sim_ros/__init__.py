"""Open simulation of helmeted two-wheeler riders: MuJoCo physics, ROS 2 nodes, MCAP logs."""
