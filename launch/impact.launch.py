"""Start the four nodes: ``ros2 launch helmet_sim_ros impact.launch.py``.

Then set parameters and call ``/simulation/run_impact``, or call ``/scenario/run``.
"""

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
