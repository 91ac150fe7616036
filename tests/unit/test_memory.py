"""Freed memory that the process keeps."""

import platform
import subprocess
import sys

import pytest

# Bytes of the process after 64 MB were allocated, touched and freed.
PROGRAM = """
import os, sys
from stereo_occ.memory import keep_freed_memory
if sys.argv[1] == "keep":
    assert keep_freed_memory()
block = bytearray(64 * 2**20)
del block
print(int(open("/proc/self/statm").read().split()[1]) * os.sysconf("SC_PAGE_SIZE"))
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc can be told")
def test_a_freed_block_stays_with_the_process():
    kept, returned = (
        int(
            subprocess.run(
                [sys.executable, "-c", PROGRAM, way], capture_output=True, text=True, check=True
            ).stdout
        )
        for way in ("keep", "give back")
    )
    assert 60 * 2**20 < kept - returned < 68 * 2**20
