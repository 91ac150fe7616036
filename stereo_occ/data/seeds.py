"""Random numbers that belong to an object, whatever else is drawn."""

from zlib import crc32


def object_seed(category: str, object_id: str) -> int:
    """The same for the same object on every machine."""
    return crc32(f"{category}/{object_id}".encode())
