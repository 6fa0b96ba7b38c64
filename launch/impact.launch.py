"""Start the four nodes: ``ros2 launch helmet_sim_ros impact.launch.py``.

Then set parameters and call ``/simulation/run_impact``, or call ``/scenario/run``.
"""

import json
from tempfile import NamedTemporaryFile

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = {
    "namespace": ("", "namespace of all nodes"),
    "output_dir": ("logs", "directory of the logs"),
    "scenario": ("oblique_table1", "name in config/scenarios, or path to a YAML file"),
    "standard": ("", "name in config/standards, or path to a YAML file"),
    "simulation_params": ("", "ROS parameter file for the simulation node"),
    "one_process": ("false", "true: all nodes in one process"),
}


def nodes(context: LaunchContext) -> list[Node]:
    """The nodes, once the arguments are known."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    files = [given["simulation_params"]] if given["simulation_params"] else []
    values = {
        "evaluator": {"standard": given["standard"]},
        "recorder": {"output_dir": given["output_dir"]},
        "scenario": {"scenario.file": given["scenario"]},
    }
    if given["one_process"] == "true":
        return [
            Node(
                package="helmet_sim_ros",
                executable="one_process_node",
                namespace=given["namespace"],
                parameters=[*files, parameter_file(values)],
                output="screen",
            )
        ]
    parameters = {"simulation": files} | {name: [of_node] for name, of_node in values.items()}
    return [
        Node(
            package="helmet_sim_ros",
            executable=f"{name}_node",
            name=name,
            namespace=given["namespace"],
            parameters=of_node,
            output="screen",
        )
        for name, of_node in parameters.items()
    ]


def parameter_file(values: dict[str, dict[str, str]]) -> str:
    """A file in which each node of a process finds its own values, in whatever namespace."""
    content = {f"/**/{name}": {"ros__parameters": of_node} for name, of_node in values.items()}
    with NamedTemporaryFile("w", prefix="helmet_sim_", suffix=".yaml", delete=False) as file:
        json.dump(content, file)  # which is YAML
    return file.name


def generate_launch_description() -> LaunchDescription:
    """Simulation, evaluator, recorder and scenario node."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
