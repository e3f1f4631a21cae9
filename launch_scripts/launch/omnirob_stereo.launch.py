"""omniRob: the arm holds the object before a stereo pair."""

from puffer_bringup import bringup


def generate_launch_description():
    """Describe the launch of the set-up."""
    return bringup('omnirob_stereo')
