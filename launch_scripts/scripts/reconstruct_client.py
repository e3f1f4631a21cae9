#!/usr/bin/env python3
"""Ask mesh_reconstructor for a mesh.

    ros2 run puffer_bringup reconstruct_client.py                      # of the current cloud
    ros2 run puffer_bringup reconstruct_client.py scans/ mesh.glb      # of a scan folder
"""

import argparse
import os
import sys

import rclpy
from puffer_msgs.srv import Reconstruct
from rclpy.node import Node


def main():
    """Call the service once and print what came of it."""
    parser = argparse.ArgumentParser(description='Ask mesh_reconstructor for a mesh.')
    parser.add_argument('input', nargs='?', default='', help='scan folder, bag or cloud')
    parser.add_argument('output', nargs='?', default='', help='file in its output folder')
    parser.add_argument('--edge-length', type=float, default=0.0, help='metres; 0: automatic')
    parser.add_argument('--deadline', type=float, default=900.0, help='seconds')
    options = parser.parse_args(rclpy.utilities.remove_ros_args(sys.argv)[1:])

    rclpy.init()
    node = Node('reconstruct_client')
    client = node.create_client(Reconstruct, 'mesh_reconstructor/reconstruct')
    try:
        if not client.wait_for_service(timeout_sec=10.0):
            sys.exit(
                'mesh_reconstructor is not there: does it run, on this ROS_DOMAIN_ID and with this '
                'RMW_IMPLEMENTATION?'
            )
        request = Reconstruct.Request()
        # The node may run in another folder.
        request.input = os.path.abspath(options.input) if options.input else ''
        request.output_path = options.output
        request.edge_length = options.edge_length
        future = client.call_async(request)
        rclpy.spin_until_future_complete(node, future, timeout_sec=options.deadline)
        if not future.done():
            sys.exit(f'no answer within {options.deadline:.0f} s')
        answer = future.result()
        if not answer.success:
            sys.exit(f'{answer.message} (code {answer.error_code})')
        print(
            f'{answer.mesh_path}: {answer.vertices} vertices, {answer.triangles} triangles, '
            f'genus {answer.genus}, {"closed" if answer.closed else "open"}, '
            f'mean sigma {answer.mean_sigma * 1e3:.3f} mm, '
            f'{answer.unobserved_share:.0%} not observed, {answer.seconds:.1f} s'
        )
    except KeyboardInterrupt:
        sys.exit(130)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
