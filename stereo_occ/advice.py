"""Words for what is wrong: near names, what a key takes, an error in one line."""

from collections.abc import Iterable
from difflib import get_close_matches

from omegaconf import BooleanNode, DictConfig, EnumNode, FloatNode, IntegerNode, ListConfig, Node, StringNode


def nearest(name: str, known: Iterable[str]) -> str:
    """Advice on a misspelt name: the nearest known ones, or all of them."""
    known = sorted(known)
    close = get_close_matches(name, known, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(close)}?" if close else f"known: {', '.join(known)}"


def unknown_key(key: str, known: Iterable[str]) -> str:
    """Advice on an unknown key: near ones beside it, the same name elsewhere, or all that there are beside it."""
    known = [k for k in known if (k.partition(".")[0] == "hydra") == key.startswith("hydra.")]
    parent, _, name = key.rpartition(".")
    while parent and parent not in known:
        parent, _, name = parent.rpartition(".")
    beside = [k.rpartition(".")[2] for k in known if k.rpartition(".")[0] == parent]
    prefix = f"{parent}." if parent else ""
    close = [prefix + match for match in get_close_matches(name, beside, n=2)]
    close = close or [k for k in known if k.rpartition(".")[2] == name][:3]
    if close:
        return f"unknown key; did you mean {' or '.join(close)}?"
    return f"unknown key; known{' in ' + parent if parent else ''}: {', '.join(beside)}"


def expected_value(node: Node, key: str) -> str | None:
    """What values the node of a key takes, in words."""
    if isinstance(node, EnumNode):
        return f"one of {', '.join(node.enum_type.__members__)}"
    if isinstance(node, ListConfig):
        return "a list in brackets" if node._is_none() else f"a list such as [{','.join(map(str, node))}]"
    target = node._maybe_dereference_node()
    if isinstance(target, DictConfig):
        return f"given key by key: {' '.join(f'{key}.{name}=...' for name in map(str, target))}"
    words: dict[type[Node], str] = {
        BooleanNode: "true or false",
        IntegerNode: "a whole number",
        FloatNode: "a number",
        StringNode: "text",
    }
    return words.get(type(node))


def one_line(error: Exception) -> str:
    """What an error of Hydra or OmegaConf says, without the lines on its own types."""
    lines = [line.strip() for line in str(error.__cause__ or error).splitlines()]
    return "; ".join(
        line for line in lines if line and not line.startswith(("object_type", "reference_type"))
    )
