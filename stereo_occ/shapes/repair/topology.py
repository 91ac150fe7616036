"""How triangles hang together: edges, pieces, winding, borders. Faces are ``(F, 3)`` vertex indices."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Faces = NDArray[np.int64]


def edge_keys(faces_F3: Faces) -> NDArray[np.int64]:
    """One number for each undirected edge of each face, ``(3F,)``: edges 01, 12, 20 of a face in a row."""
    ends_E2 = np.stack([faces_F3, np.roll(faces_F3, -1, axis=1)], axis=-1).reshape(-1, 2)
    keys_E: NDArray[np.int64] = ends_E2.min(axis=1).astype(np.int64) << 32 | ends_E2.max(axis=1)
    return keys_E


def bad_edges(faces_F3: Faces) -> tuple[int, int]:
    """How many edges border a hole, and how many join more than two faces."""
    _, uses = np.unique(edge_keys(faces_F3), return_counts=True)
    return int((uses == 1).sum()), int((uses > 2).sum())


def is_closed(faces_F3: Faces) -> bool:
    """Whether two faces meet at every edge."""
    return len(faces_F3) > 0 and bad_edges(faces_F3) == (0, 0)


def pieces(faces_F3: Faces) -> list[Faces]:
    """Faces connected through edges that exactly two of them share; the piece of the first face first."""
    left_A, right_A, _ = _neighbours(faces_F3)
    label_F = _components(left_A, right_A, len(faces_F3))
    order_F = np.argsort(label_F, kind="stable")
    return np.split(faces_F3[order_F], np.cumsum(np.bincount(label_F))[:-1])


def wound_alike(faces_F3: Faces) -> tuple[Faces, bool] | None:
    """The faces of one piece turned like its first one and whether any was turned; None if it is one-sided."""
    left_A, right_A, against_A = _neighbours(faces_F3)
    count = len(faces_F3)
    # Two copies of each face, one per side; the side on which the first face lies is the one wanted.
    label_S = _components(
        np.concatenate([left_A, left_A + count]),
        np.concatenate([right_A + against_A * count, right_A + ~against_A * count]),
        2 * count,
    )
    if (label_S[:count] == label_S[count:]).any():
        return None
    turned_F = label_S[:count] != label_S[0]
    return np.where(turned_F[:, None], faces_F3[:, ::-1], faces_F3), bool(turned_F.any())


def borders(faces_F3: Faces) -> list[NDArray[np.int64]] | None:
    """Closed loops of border vertices, against the winding, for a consistently wound piece.

    None if some border is no simple loop.
    """
    keys_E = edge_keys(faces_F3)
    _, first_U, uses_U = np.unique(keys_E, return_index=True, return_counts=True)
    ends_E2 = np.stack([faces_F3, np.roll(faces_F3, -1, axis=1)], axis=-1).reshape(-1, 2)
    border_B2 = ends_E2[np.sort(first_U[uses_U == 1])]
    following = {int(end): int(start) for start, end in border_B2}
    if len(following) < len(border_B2) or set(following) != set(following.values()):
        return None
    loops = []
    while following:
        vertex, loop = next(iter(following)), []
        while vertex in following:
            loop.append(vertex)
            vertex = following.pop(vertex)
        loops.append(np.array(loop))
    return loops


def _neighbours(faces_F3: Faces) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Pairs of faces that alone share an edge, and whether they run along it the same way, so one is turned."""
    keys_E = edge_keys(faces_F3)
    order_E = np.argsort(keys_E, kind="stable")
    _, start_U, uses_U = np.unique(keys_E[order_E], return_index=True, return_counts=True)
    start_U = start_U[uses_U == 2]
    left_A, right_A = order_E[start_U], order_E[start_U + 1]
    from_E = faces_F3.reshape(-1)
    return left_A // 3, right_A // 3, from_E[left_A] == from_E[right_A]


def _components(left_A: NDArray[np.int64], right_A: NDArray[np.int64], count: int) -> NDArray[np.int32]:
    graph = coo_array((np.ones(len(left_A), np.int8), (left_A, right_A)), shape=(count, count))
    labels_N: NDArray[np.int32] = connected_components(graph, directed=False)[1]
    return labels_N
