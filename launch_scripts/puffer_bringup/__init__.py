"""What the launch files of puffer's set-ups have in common."""

import json
import os
import tempfile

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

# Those that listen before those that speak.
NODES = [
    'mesh_reconstructor',
    'cloud_filter',
    'nbv_planner',
    'scan_registrar',
    'modeller',
    'mock_driver',
]


def bringup(setup):
    """Describe the launch of a set-up: its nodes, and RViz on demand."""
    share = get_package_share_directory('puffer_bringup')
    arguments = [
        DeclareLaunchArgument(
            'driver',
            default_value='mock',
            choices=['mock', 'none'],
            description='mock: the simulated robot; none: robot and sensor are yours',
        ),
        DeclareLaunchArgument(
            'object',
            default_value='coffee',
            description='object before the mock driver: a name (puffer objects) or a mesh file',
        ),
        DeclareLaunchArgument(
            'params_file',
            default_value=os.path.join(share, 'params', setup + '.yaml'),
            description='ROS parameter file of all nodes',
        ),
        DeclareLaunchArgument(
            'use_sim_time',
            default_value='auto',
            choices=['auto', 'true', 'false'],
            description='whether time comes from /clock; auto: with the mock driver',
        ),
        DeclareLaunchArgument(
            'output_folder',
            default_value='',
            description='folder for scans, report and mesh; empty: only meshes, here',
        ),
        DeclareLaunchArgument(
            'rviz', default_value='false', choices=['true', 'false'], description='start RViz'
        ),
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])


def _nodes(context):
    def given(name):
        return LaunchConfiguration(name).perform(context)

    driver = given('driver')
    simulated = given('use_sim_time')
    simulated = driver == 'mock' if simulated == 'auto' else simulated == 'true'
    names = [name for name in NODES if driver == 'mock' or name != 'mock_driver']
    overrides = _overrides(names, simulated, given('object'), given('output_folder'))
    actions = [
        Node(
            package='puffer',
            executable=name,
            name=name,
            output='screen',
            parameters=[given('params_file'), overrides],
            on_exit=Shutdown(reason=name + ' has ended'),
        )
        for name in names
    ]
    if given('rviz') == 'true':
        layout = os.path.join(
            get_package_share_directory('puffer_bringup'), 'rviz', 'puffer.rviz'
        )
        actions.append(
            Node(
                package='rviz2',
                executable='rviz2',
                arguments=['-d', layout],
                parameters=[{'use_sim_time': simulated}],
            )
        )
    return actions


def _overrides(names, simulated, shown, folder):
    """Write what the arguments say as a parameter file behind the set-up's; its path.

    A dictionary would do for most nodes, but launch writes it for `/**`, which counts less
    than what a file says of a node by its name.
    """
    own = {name: {'use_sim_time': simulated} for name in names}
    if 'mock_driver' in own:
        own['mock_driver']['driver.object'] = shown
    if folder:
        folder = os.path.abspath(folder)
        os.makedirs(folder, exist_ok=True)
        own['mesh_reconstructor']['mesh.output_folder'] = folder
        own['modeller']['modeller.run_folder'] = folder
        own['modeller']['modeller.mesh_path'] = 'mesh.ply'
        if 'mock_driver' in own:
            own['mock_driver']['driver.truth_folder'] = folder
    document = {name: {'ros__parameters': values} for name, values in own.items()}
    # JSON is YAML, too. The nodes read it when they start, so nobody can say when it may go.
    with tempfile.NamedTemporaryFile(
        mode='w', prefix='puffer_', suffix='.yaml', delete=False
    ) as file:
        json.dump(document, file, indent=2)
        return file.name
