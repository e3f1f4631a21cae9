"""KR 16-2 with a laser striper; the object stands on a table."""

from puffer_bringup import bringup


def generate_launch_description():
    """Describe the launch of the set-up."""
    return bringup('kr16_laser')
