"""Permissions that hold for root, too."""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

#: Linux's capabilities to read, write and search whatever the mode of a file says, and to change that mode.
IGNORE_MODES = sum(1 << bit for bit in (1, 2, 3))

VERSION_3 = 0x20080522


class _Header(ctypes.Structure):
    _fields_ = (("version", ctypes.c_uint32), ("pid", ctypes.c_int))


class _Sets(ctypes.Structure):
    _fields_ = (
        ("effective", ctypes.c_uint32),
        ("permitted", ctypes.c_uint32),
        ("inheritable", ctypes.c_uint32),
    )


@contextmanager
def modes_obeyed() -> Iterator[None]:
    """Within it the modes of files hold for this thread, even root's."""
    if os.geteuid() != 0:
        yield
        return
    libc = ctypes.CDLL(None, use_errno=True)
    header, sets = _Header(VERSION_3, 0), (_Sets * 2)()
    if libc.capget(ctypes.byref(header), sets):
        pytest.skip("capabilities cannot be read")
    before = sets[0].effective
    sets[0].effective = before & ~IGNORE_MODES
    if libc.capset(ctypes.byref(header), sets):
        pytest.skip("capabilities cannot be dropped")
    try:
        yield
    finally:
        sets[0].effective = before
        assert libc.capset(ctypes.byref(header), sets) == 0
