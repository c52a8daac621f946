"""What has to be done once, before pytest's workers start."""

import subprocess
import sys


def pytest_configure(config):
    """Import IDAES in a process of its own: its first import makes directories, and fails where two processes do so at once."""
    if not hasattr(config, 'workerinput'):
        subprocess.run([sys.executable, '-c', 'import idaes'], capture_output=True)
