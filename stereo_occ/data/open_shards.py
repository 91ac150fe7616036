"""Which shards of this process are open: those used last, so that a data set may have more than can be open at once."""

import resource
from collections import OrderedDict
from typing import Protocol
from weakref import ref

#: Of full-scale data sets a shard keeps up to 2 MB in memory. The paper's 640 objects stay open.
MOST_OPEN = 768

#: Files that the rest of the process may have open.
OTHER_FILES = 128


class Closable(Protocol):
    """Something that is opened by using it."""

    def close(self) -> None:
        """Release everything; the next use opens it again."""


_open: "OrderedDict[int, ref[Closable]]" = OrderedDict()


def use(shard: Closable) -> None:
    """Note that ``shard`` is being used; if it is one too many, close those that have not been for longest."""
    key = id(shard)
    if key in _open:
        _open.move_to_end(key)
        return
    while len(_open) >= most_open():
        _, oldest = _open.popitem(last=False)
        if (unused := oldest()) is not None:
            unused.close()
    _open[key] = ref(shard, lambda _: _open.pop(key, None))


def forget(shard: Closable) -> None:
    """Note that ``shard`` is closed."""
    _open.pop(id(shard), None)


def most_open() -> int:
    """How many shards may be open: :data:`MOST_OPEN`, fewer where the system allows a process fewer files."""
    files, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return MOST_OPEN if files == resource.RLIM_INFINITY else min(MOST_OPEN, max(8, files - OTHER_FILES))
