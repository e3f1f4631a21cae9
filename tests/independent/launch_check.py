#!/usr/bin/env python3
"""Evaluate the launch files with a stand-in for launch and launch_ros, and start the nodes as they say.

Needs no ROS. PUFFER_BIN names the program; without it only the description is checked.
"""

import importlib.util
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import types

ROOT = pathlib.Path(__file__).resolve().parents[2]
BRINGUP = ROOT / 'launch_scripts'


class Record:
    """Keeps what it was made with."""

    def __init__(self, *args, **kwargs):
        self.args, self.__dict__ = args, {**kwargs, 'args': args}


class LaunchConfiguration(Record):
    """Looks an argument up."""

    def perform(self, context):
        return context[self.args[0]]


def stand_in(share):
    """Install modules of the names that the launch files import."""
    kinds = {
        'ament_index_python': {},
        'ament_index_python.packages': {'get_package_share_directory': lambda _: str(share)},
        'launch': {'LaunchDescription': list},
        'launch.actions': {
            name: type(name, (Record,), {})
            for name in ('DeclareLaunchArgument', 'OpaqueFunction', 'Shutdown')
        },
        'launch.substitutions': {'LaunchConfiguration': LaunchConfiguration},
        'launch_ros': {},
        'launch_ros.actions': {'Node': type('Node', (Record,), {})},
    }
    for name, content in kinds.items():
        module = types.ModuleType(name)
        module.__dict__.update(content)
        sys.modules[name] = module


def nodes(setup, **given):
    """Evaluate the launch file of a set-up with arguments."""
    spec = importlib.util.spec_from_file_location(
        setup, BRINGUP / 'launch' / f'{setup}.launch.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    *declared, function = module.generate_launch_description()
    values = {argument.args[0]: argument.default_value for argument in declared}
    assert set(given) <= set(values), given
    return {node.executable: node for node in function.function({**values, **given})}


def starts(program, started):
    """Start a node as its action says; it must come up and end on demand."""
    files = [word for path in started.parameters for word in ('--params-file', path)]
    command = [program, 'node', started.executable, '--ros-args', *files]
    environment = {'ROS_DOMAIN_ID': '97', **os.environ}
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        for line in process.stderr:
            if 'ready' in line or line.startswith('error'):
                break
        else:
            line = ''
        process.terminate()
    assert 'ready' in line, f'{started.executable}: {line}'


def main():
    """Check both set-ups."""
    sys.path.insert(0, str(BRINGUP))
    sys.dont_write_bytecode = True
    program = os.environ.get('PUFFER_BIN')
    with tempfile.TemporaryDirectory() as folder:
        tempfile.tempdir = folder
        share = pathlib.Path(folder) / 'share'
        share.mkdir()
        (share / 'params').symlink_to(ROOT / 'params')
        (share / 'rviz').symlink_to(BRINGUP / 'rviz')
        stand_in(share)
        for setup in ('kr16_laser', 'omnirob_stereo'):
            mock = nodes(setup, object='mug', output_folder=os.path.join(folder, 'run'))
            assert len(mock) == 6, mock.keys()
            for name, node in mock.items():
                own = json.loads(pathlib.Path(node.parameters[1]).read_text())
                assert own[name]['ros__parameters']['use_sim_time'] is True
                assert os.path.isfile(node.parameters[0]), node.parameters
            assert own['mock_driver']['ros__parameters']['driver.object'] == 'mug'
            real = nodes(setup, driver='none', rviz='true')
            assert set(mock) - set(real) == {'mock_driver'} and 'rviz2' in real
            own = json.loads(pathlib.Path(real['modeller'].parameters[1]).read_text())
            assert own['modeller']['ros__parameters'] == {'use_sim_time': False}
            assert os.path.isfile(real['rviz2'].arguments[1])
            if program:
                for node in mock.values():
                    starts(program, node)
    for script in (BRINGUP / 'scripts').glob('*.py'):
        compile(script.read_text(), str(script), 'exec')
    print('launch files: as they should be'
          + ('' if program else '; SKIPPED starting the nodes: PUFFER_BIN is not set'))


if __name__ == '__main__':
    main()
