"""Which unknowns meet: the graph of the kept blocks, without listing pairs.

Two vertices are neighbours if some observation or eliminated block touches both. Observations are given as groups of
vertices; every vertex marks the vertices of its groups once.
"""

import numpy as np
from numba import njit

SIGNATURE = "Tuple((int64[::1], int32[::1]))(int64, int64[::1], int32[::1], int64[::1], int32[::1])"


@njit(SIGNATURE, nogil=True, cache=True)
def neighbours(n, group_start, member, vertex_start, group_of):
    """Adjacency lists in compressed form.

    Parameters
    ----------
    n : int
        Number of vertices.
    group_start : (n_groups + 1,) int64
    member : (.,) int32
        Vertices of the groups; negative ones are skipped.
    vertex_start : (n + 1,) int64
    group_of : (.,) int32
        Groups of the vertices.

    Returns
    -------
    start : (n + 1,) int64
    neighbour : (.,) int32, ascending within a vertex
    """
    stamp = np.empty(n, dtype=np.int64)
    start = np.zeros(n + 1, dtype=np.int64)
    found = np.empty(64 * n + 64, dtype=np.int32)
    for v in range(n):
        stamp[v] = -1
    at = 0
    for v in range(n):
        if at + n > len(found):  # a vertex has at most n neighbours
            larger = np.empty(2 * len(found) + n, dtype=np.int32)
            for k in range(at):
                larger[k] = found[k]
            found = larger
        stamp[v] = v
        for k in range(vertex_start[v], vertex_start[v + 1]):
            g = group_of[k]
            for j in range(group_start[g], group_start[g + 1]):
                w = member[j]
                if w >= 0 and stamp[w] != v:
                    stamp[w] = v
                    found[at] = w
                    at += 1
        start[v + 1] = at
    # neighbours are so mutually: handing every vertex to its neighbours, in turn, leaves all lists ascending
    neighbour = np.empty(at, dtype=np.int32)
    for v in range(n):
        stamp[v] = start[v]
    for v in range(n):
        for k in range(start[v], start[v + 1]):
            w = found[k]
            neighbour[stamp[w]] = v
            stamp[w] += 1
    return start, neighbour


@njit("Tuple((int64[::1], int64[::1]))(int64, int32[::1])", nogil=True, cache=True)
def counting_order(n, key):
    """Stable order of items by a small integer key, and where each key starts.

    Returns
    -------
    start : (n + 1,) int64
    order : (len(key),) int64
    """
    start = np.zeros(n + 1, dtype=np.int64)
    for k in key:
        start[k + 1] += 1
    for k in range(n):
        start[k + 1] += start[k]
    place = start[:-1].copy()
    order = np.empty(len(key), dtype=np.int64)
    for i in range(len(key)):
        order[place[key[i]]] = i
        place[key[i]] += 1
    return start, order


@njit("void(int64[::1], int64[::1], int32[::1])", nogil=True, cache=True)
def sort_within(start, order, key):
    """Sort the items of each group by their key, stably and in place: short lists.

    Parameters
    ----------
    start : (n_groups + 1,) int64
    order : (n,) int64
        Items, group by group.
    key : (n,) int32
        Of each item.
    """
    for g in range(len(start) - 1):
        for i in range(start[g] + 1, start[g + 1]):
            item, j = order[i], i
            while j > start[g] and key[order[j - 1]] > key[item]:
                order[j] = order[j - 1]
                j -= 1
            order[j] = item


@njit("int64[::1](int64, int64[::1], int32[::1], int64)", nogil=True, cache=True)
def lexical_order(n, start, key, depth):
    """Stable order of groups of items by their first `depth` keys, the first one first; an absent key comes last.

    Parameters
    ----------
    n : int
        Keys are below n.
    start : (n_groups + 1,) int64
    key : (.,) int32
        Of the items, group by group.
    """
    groups = len(start) - 1
    order, other, count = np.arange(groups), np.empty(groups, dtype=np.int64), np.empty(n + 2, dtype=np.int64)
    own = np.empty(groups, dtype=np.int32)
    for level in range(depth - 1, -1, -1):
        count[:] = 0
        for k in range(groups):
            at = start[k] + level
            own[k] = n
            if at < start[k + 1]:
                own[k] = key[at]
            count[own[k] + 1] += 1
        for k in range(n + 1):
            count[k + 1] += count[k]
        for group in order:
            other[count[own[group]]] = group
            count[own[group]] += 1
        order, other = other, order
    return order
