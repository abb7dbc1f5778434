"""The command: ``navfuse``, or ``python -m navfuse``."""

import os
import signal
import sys

from navfuse import _navfuse


def main() -> int:
    """Runs the command with the arguments of the process, and returns its exit code."""
    # the command ends a run in order on Ctrl-C; Python's own handler would raise afterwards
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # `navfuse view` finds the viewer of navfuse[viewer] in an environment that is not activated, too
    scripts = os.path.dirname(sys.executable)
    os.environ["PATH"] = os.pathsep.join([os.environ.get("PATH", os.defpath), scripts])
    return _navfuse.command(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
