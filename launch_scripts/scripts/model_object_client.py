#!/usr/bin/env python3
"""Have an object modelled; Ctrl-C cancels the goal.

    ros2 run puffer_bringup model_object_client.py --max-scans 8
"""

import argparse
import sys

import rclpy
from puffer_msgs.action import ModelObject
from rclpy.action import ActionClient
from rclpy.node import Node

SUCCEEDED = 4  # action_msgs/GoalStatus


def tell(message):
    """Print how it goes."""
    feedback = message.feedback
    phases = {
        getattr(ModelObject.Feedback, name): name.lower()
        for name in ('PREPARING', 'PLANNING', 'MOVING', 'SCANNING', 'REGISTERING', 'REFINING',
                     'FILTERING', 'RECONSTRUCTING', 'DONE', 'PAUSED')
    }
    print(
        f'{feedback.elapsed.sec:>5} s  {phases.get(feedback.phase, "?"):<14}  '
        f'{feedback.scans} scans, coverage {feedback.coverage:.1%}  {feedback.message}'
    )


def main():
    """Send one goal and wait for its end."""
    parser = argparse.ArgumentParser(description='Have an object modelled.')
    parser.add_argument('--name', default='object', help='a name for the object')
    parser.add_argument('--max-scans', type=int, default=0, help='0: as configured')
    parser.add_argument('--coverage', type=float, default=0.0, help='0 to 1; 0: as configured')
    parser.add_argument('--force', action='store_true',
                        help='write the mesh also where it is not trustworthy')
    options = parser.parse_args(rclpy.utilities.remove_ros_args(sys.argv)[1:])

    rclpy.init()
    node = Node('model_object_client')
    client = ActionClient(node, ModelObject, 'model_object')
    handle = None
    try:
        if not client.wait_for_server(timeout_sec=10.0):
            sys.exit(
                'modeller is not there: does it run, on this ROS_DOMAIN_ID and with this '
                'RMW_IMPLEMENTATION?'
            )
        goal = ModelObject.Goal()
        goal.object_name = options.name
        goal.max_scans = options.max_scans
        goal.coverage = options.coverage
        goal.force = options.force
        future = client.send_goal_async(goal, feedback_callback=tell)
        rclpy.spin_until_future_complete(node, future)
        handle = future.result()
        if not handle.accepted:
            sys.exit('the goal is rejected: is another object being modelled?')
        future = handle.get_result_async()
        rclpy.spin_until_future_complete(node, future)
        result = future.result().result
        if future.result().status != SUCCEEDED:
            sys.exit(f'{result.error_msg} (code {result.error_code})')
        print(
            f'{result.mesh_path}: {result.vertices} vertices, {result.triangles} triangles from '
            f'{result.scans} scans ({result.share_of_scans_accepted:.1%} accepted), '
            f'{result.share_of_cells_explained:.1%} of the measured surface explained, '
            f'coverage {result.coverage:.1%}, {result.seconds:.0f} s'
        )
        if result.error_msg:
            print(f'warning: {result.error_msg}', file=sys.stderr)
    except KeyboardInterrupt:
        if handle is not None:
            rclpy.spin_until_future_complete(
                node, handle.cancel_goal_async(), timeout_sec=10.0
            )
        sys.exit(130)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
