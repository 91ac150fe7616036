"""What a user's file or setting holds, as one line can show it."""


def printable(text: str) -> str:
    """``text`` with line breaks, control characters and bytes that are no UTF-8 as escapes such as ``\\\\n``."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
