"""Approximate minimum degree on a quotient graph.

Eliminating a vertex joins its neighbours to a clique. The quotient graph stores the clique as one *element*, the list of
its vertices, in place of its edges; an element all of whose vertices lie in a new one is absorbed. The list of a vertex
holds its elements, then the vertices it meets outside any element. The degree of i after the elimination of p is
bounded by

    d_i <= |A_i \\ i| + |L_p \\ i| + sum over its other elements e of |L_e \\ L_p|,

all sizes in unknowns. Vertices of one element with equal lists are merged: they have one degree and go together.

Source: Amestoy, Davis, Duff 1996, An approximate minimum degree ordering algorithm.
"""

from typing import Any

import numpy as np
from numba import njit

_I, _L = "int32[::1]", "int64[::1]"
_HELPER: dict[str, Any] = {"nogil": True, "cache": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Of functions that only compiled ones call: they compile faster without an entry from Python."""


@njit(f"void(int64, int64, {_I}, {_I}, {_I})", **_HELPER)
def _enter(i, degree, head, following, previous):
    """Enter a vertex into the list of its degree."""
    following[i], previous[i] = head[degree], -1
    if head[degree] >= 0:
        previous[head[degree]] = i
    head[degree] = i


@njit(f"void(int64, int64, {_I}, {_I}, {_I})", **_HELPER)
def _leave(i, degree, head, following, previous):
    """Take a vertex out of the list of its degree."""
    if previous[i] >= 0:
        following[previous[i]] = following[i]
    else:
        head[degree] = following[i]
    if following[i] >= 0:
        previous[following[i]] = previous[i]


@njit(f"int64(int64, int64, {_I}, {_L}, {_I}, {_I}, {_L}, {_I}, {_I})", **_HELPER)
def _gather(p, at, lists, first, elements, count, weight, parent, mark):
    """Write the vertices of the new element p to `lists[at:]`; absorb its elements. Returns the end."""
    end = at
    mark[p] = p
    for k in range(first[p], first[p] + count[p]):
        e = lists[k]
        inner = k < first[p] + elements[p]
        for j in range(first[e], first[e] + count[e]) if inner else range(k, k + 1):
            i = lists[j]
            if weight[i] > 0 and mark[i] != p:
                mark[i] = p
                lists[end] = i
                end += 1
        if inner:
            parent[e] = p
    return end


@njit(f"void(int64, int64, int64, {_I}, {_L}, {_I}, {_L}, {_L}, {_I}, {_I}, {_L})", **_HELPER)
def _outside(p, begin, end, lists, first, elements, weight, extent, parent, mark, outside):
    """For every element that the new one, p, meets: its unknowns that lie outside p."""
    for k in range(begin, end):
        i = lists[k]
        for j in range(first[i], first[i] + elements[i]):
            e = lists[j]
            if parent[e] >= 0:
                continue
            if mark[e] != p:
                mark[e], outside[e] = p, extent[e]
            outside[e] -= weight[i]


@njit(f"int64(int64, int64, {_I}, {_L}, {_I}, {_I}, {_L}, {_I}, {_I}, {_L}, {_L})", **_HELPER)
def _renew(i, p, lists, first, elements, count, weight, parent, mark, outside, key):
    """New list of a vertex of the element p: p, live elements, vertices outside. Returns its degree but for p."""
    start, inner, last = first[i], first[i] + elements[i], first[i] + count[i]
    degree, total, live, end = 0, p, start, start
    for j in range(start, last):
        e = lists[j]
        if j < inner:
            if parent[e] >= 0:
                continue
            if outside[e] == 0:
                parent[e] = p
                continue
            degree += outside[e]
            live += 1
        else:
            if weight[e] == 0 or mark[e] == p:
                continue
            degree += weight[e]
        total += e
        lists[end] = e
        end += 1
    # an absorbed element or p itself is gone from the list: there is room for p at its head
    lists[end], lists[live], lists[start] = lists[live], lists[start], p
    elements[i], count[i], key[i] = live + 1 - start, end + 1 - start, total
    return degree


@njit(f"void(int64, int64, {_I}, {_L}, {_I}, {_I}, {_L}, {_I}, {_L}, {_I}, {_I}, {_I})", **_HELPER)
def _merge(begin, end, lists, first, elements, count, weight, into, key, bucket, chain, stamp):
    """Merge vertices of an element that have the same list; only those of one bucket by the sum of it are compared."""
    n = len(bucket)
    for k in range(begin, end):
        i = lists[k]
        b = key[i] % n
        for m in range(first[i], first[i] + count[i]):
            stamp[lists[m]] = i
        j = bucket[b]
        while j >= 0:
            same = weight[j] > 0 and elements[i] == elements[j] and count[i] == count[j]
            m = first[j]
            while same and m < first[j] + count[j]:
                same = stamp[lists[m]] == i
                m += 1
            if same:
                weight[i] += weight[j]
                weight[j], into[j] = 0, i
            j = chain[j]
        for m in range(first[i], first[i] + count[i]):
            stamp[lists[m]] = -1
        chain[i], bucket[b] = bucket[b], i
    for k in range(begin, end):
        bucket[key[lists[k]] % n] = -1


@njit(
    "Tuple((int32[::1], int32[::1], int32[::1], int64[::1]))(int64[::1], int32[::1], int64[::1])",
    nogil=True,
    cache=True,
)
def minimum_degree(start, neighbour, size):
    """Order of elimination.

    Parameters
    ----------
    start : (n + 1,) int64
    neighbour : (.,) int32
    size : (n,) int64
        Unknowns of each vertex, positive.

    Returns
    -------
    pivots : (m,) int32
        Vertices in the order of their elimination, one of each merged set.
    parent : (n,) int32
        For each pivot the later one whose element absorbed its own; -1 for roots.
    into : (n,) int32
        The vertex a vertex was merged with; -1 for pivots.
    extent : (n,) int64
        For each pivot the unknowns of its element: the boundary of its front.
    """
    n = len(size)
    weight, first, count, total = (
        np.empty(n, dtype=np.int64),
        np.empty(n, dtype=np.int64),
        np.empty(n, dtype=np.int32),
        0,
    )
    for i in range(n):
        weight[i], first[i], count[i] = size[i], start[i], start[i + 1] - start[i]
        total += size[i]
    elements, at = np.zeros(n, dtype=np.int32), len(neighbour)
    lists = np.empty(2 * at + 2 * n + 2, dtype=np.int32)
    for k in range(at):
        lists[k] = neighbour[k]
    degree, head = np.zeros(n, dtype=np.int64), np.full(total + 1, -1, dtype=np.int32)
    following, previous = np.full(n, -1, dtype=np.int32), np.full(n, -1, dtype=np.int32)
    for i in range(n - 1, -1, -1):
        for k in range(start[i], start[i + 1]):
            degree[i] += size[neighbour[k]]
        _enter(i, degree[i], head, following, previous)
    parent, into = np.full(n, -1, dtype=np.int32), np.full(n, -1, dtype=np.int32)
    mark = np.full(n, -1, dtype=np.int32)
    outside, key = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    bucket, chain, stamp = (
        np.full(n, -1, dtype=np.int32),
        np.full(n, -1, dtype=np.int32),
        np.full(n, -1, dtype=np.int32),
    )
    extent = np.zeros(n, dtype=np.int64)
    pivots, m, lowest, left = np.empty(n, dtype=np.int32), 0, 0, total
    while left > 0:
        while head[lowest] < 0:
            lowest += 1
        p = head[lowest]
        _leave(p, degree[p], head, following, previous)
        pivots[m] = p
        m += 1
        if at + n + 1 > len(lists):
            larger = np.empty(2 * len(lists) + n + 1, dtype=np.int32)
            for k in range(at):
                larger[k] = lists[k]
            lists = larger
        begin, own = at, weight[p]
        weight[p] = 0
        end = _gather(p, begin, lists, first, elements, count, weight, parent, mark)
        left -= own
        for k in range(begin, end):
            i = lists[k]
            _leave(i, degree[i], head, following, previous)
            extent[p] += weight[i]
        _outside(p, begin, end, lists, first, elements, weight, extent, parent, mark, outside)
        for k in range(begin, end):
            i = lists[k]
            degree[i] = min(degree[i], _renew(i, p, lists, first, elements, count, weight, parent, mark, outside, key))
        _merge(begin, end, lists, first, elements, count, weight, into, key, bucket, chain, stamp)
        at = begin
        for k in range(begin, end):
            i = lists[k]
            if weight[i] > 0:
                lists[at] = i
                at += 1
                degree[i] = min(degree[i] + extent[p] - weight[i], left - weight[i])
                _enter(i, degree[i], head, following, previous)
                lowest = min(lowest, degree[i])
        first[p], elements[p], count[p] = begin, 0, at - begin
    return pivots[:m].copy(), parent, into, extent
