"""Programs that the benchmarks run beside themselves."""

import subprocess
import sys


def finish(process: "subprocess.Popen[bytes]") -> None:
    """Wait; stop if it failed."""
    error = process.communicate()[1].decode()
    if process.returncode:
        sys.exit(error)
