"""What the system refuses a program, in one line each: full disks, folders without permission, want of memory."""

import errno

import torch

from stereo_occ.errors import UserError

#: What to do about each refusal that is not a mistake of this program.
REMEDIES = {
    errno.ENOSPC: "free some disk space",
    errno.EDQUOT: "free some of your quota",
    errno.EFBIG: "raise the limit on the size of files",
    errno.EIO: "check the disk",
    errno.EROFS: "choose another folder",
    errno.EACCES: "choose another folder, or get permission",
    errno.EPERM: "choose another folder, or get permission",
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.ENOTDIR: "choose another folder",
    errno.EEXIST: "choose another folder",
    errno.EISDIR: "choose another name",
    errno.ELOOP: "choose another folder",
    errno.EMFILE: "raise the limit on open files (ulimit -n)",
    errno.ENFILE: "close other programs",
    errno.EPIPE: "let it be read to its end",
}

#: How torch begins what it raises where there is no memory.
NO_MEMORY = ("[enforce fail at alloc_cpu", "CUDA out of memory", "DefaultCPUAllocator")

#: How it begins what it raises where a process that loads data was killed, or has crashed.
LOADER_DIED = "DataLoader worker (pid"


def refusal(error: BaseException) -> str | None:
    """One line on an error that the system has caused; None for any other."""
    if isinstance(error, OSError) and error.errno in REMEDIES:
        name = error.filename2 or error.filename
        what = f"{name}: " if name is not None else "a file cannot be written: "
        return f"{what}{error.strerror}; {REMEDIES[error.errno]}"
    if isinstance(error, MemoryError | torch.OutOfMemoryError) or (
        isinstance(error, RuntimeError) and any(begin in str(error)[:300] for begin in NO_MEMORY)
    ):
        return "not enough memory; ask for less (batch_size, views, workers, draws), or close other programs"
    if isinstance(error, RuntimeError) and str(error).startswith(LOADER_DIED):
        return (
            f"a process that loads data has died ({str(error).strip()}); where memory is short ask for fewer "
            f"(trainer.workers), and go on with the same command"
        )
    return None


def one_line(error: Exception) -> str:
    """What to say of a mistake of the user's or of what the system refuses; any other error is raised again."""
    problem = _text(error) if isinstance(error, UserError) else refusal(error)
    if problem is None:
        raise error
    return problem


def _text(error: UserError) -> str:
    """Its message, without the traceback that torch puts before it if it is of a loader's process."""
    return str(error).rpartition(f"{UserError.__module__}.{UserError.__qualname__}: ")[2].strip()
