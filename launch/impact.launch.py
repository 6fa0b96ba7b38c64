"""Start the four nodes: ``ros2 launch helmet_sim_ros impact.launch.py``.

Then set parameters and call ``/simulation/run_impact``, or call ``/scenario/run``.
"""

import json

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
    parameters = {
        "simulation": [given["simulation_params"]] if given["simulation_params"] else [],
        "evaluator": [{"standard": given["standard"]}],
        "recorder": [{"output_dir": given["output_dir"]}],
        "scenario": [{"scenario.file": given["scenario"]}],
    }
    if given["one_process"] == "true":
        settings = {
            "evaluator:standard": given["standard"],
            "recorder:output_dir": given["output_dir"],
            "scenario:scenario.file": given["scenario"],
        }
        return [
            Node(
                package="helmet_sim_ros",
                executable="one_process_node",
                namespace=given["namespace"],
                parameters=parameters["simulation"],
                ros_arguments=[
                    word
                    for key, value in settings.items()
                    for word in ("-p", f"{key}:={json.dumps(value)}")
                ],
                output="screen",
            )
        ]
    return [
        Node(
            package="helmet_sim_ros",
            executable=f"{name}_node",
            name=name,
            namespace=given["namespace"],
            parameters=values,
            output="screen",
        )
        for name, values in parameters.items()
    ]


def generate_launch_description() -> LaunchDescription:
    """Simulation, evaluator, recorder and scenario node."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
