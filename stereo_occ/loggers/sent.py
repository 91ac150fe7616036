"""What a run has already sent to a service that takes nothing back."""

import json
from collections.abc import Iterable
from pathlib import Path
from uuid import uuid4

from stereo_occ.writing import whole_file


class Sent:
    """The run's id at the service and the last step of each curve there, kept in a file of the run folder.

    A resumed run repeats the steps since its last checkpoint, to the bit: what was sent of them is not sent again.

    Args:
        step: that the run continues from; 0 is a run of its own, with another id.
    """

    def __init__(self, path: Path, step: int) -> None:
        self.path = path
        self.id: str | None = None
        self.last: dict[str, int] = {}
        if step and path.exists():
            content = json.loads(path.read_text(encoding="utf-8"))
            self.id, self.last = content["id"], content["last"]

    @property
    def begins(self) -> bool:
        """Whether the service knows nothing of the run yet."""
        return self.id is None

    def begin(self, run_id: str = "") -> str:
        """Give the run its id, a random one unless the service has chosen it."""
        self.id = run_id or uuid4().hex[:8]
        self._keep()
        return self.id

    def new(self, names: Iterable[str], step: int) -> list[str]:
        """Those of the names that have nothing at this step or a later one yet."""
        return [name for name in names if self.last.get(name, -1) < step]

    def mark(self, names: Iterable[str], step: int) -> None:
        """Note what was sent."""
        self.last |= dict.fromkeys(names, step)
        self._keep()

    def _keep(self) -> None:
        with whole_file(self.path) as file:
            file.write(json.dumps({"id": self.id, "last": self.last}, indent=1).encode())
