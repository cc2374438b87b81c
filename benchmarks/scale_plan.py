"""What a block beyond one machine would take, from the order of elimination of its images alone: nothing is solved.

    python -m benchmarks.scale_plan 4000 100000 1000000 --parts 2 8 32
    python -m benchmarks.scale_plan --rates

A block of parallel strips, 80 % and 60 % overlap: an image meets those whose footprints it overlaps. The graph
is ordered by nested dissection as that of a bundle is, the tree cut as for parts. Given are flops and bytes of the
factor, and for each number of parts the largest part, the shared unknowns of all and of a part, and the bytes of an
iteration by the formula of docs/scale.md. `--rates` measures here what turns these into times: dgemm and the dense
factorisation of what parts share, per processor second of one thread, and messages between two processes of Dask, on
the clock.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from aatri.adjustment.elimination import lapack
from aatri.adjustment.parts.cut import nodes_of_parts
from aatri.adjustment.structure.graph import Graph, nested_dissection
from aatri.adjustment.structure.tree import Tree, build_tree
from aatri.adjustment.threads import one_blas_thread
from aatri.arrays import Float, Int

ALONG, ACROSS = 4, 2
"""Images before and after, and strips to both sides, that an image has points in common with: 80 % and 60 %."""

UNKNOWNS = 6
RAYS_PER_IMAGE, RAY_FLOPS = 285, 10_000.0
"""Image points of an image, and the work of one against that of the factorisation (`elimination.schedule`)."""


def main() -> None:
    """Print a table for each size."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("images", nargs="*", type=int)
    parser.add_argument("--parts", nargs="+", type=int, default=[2, 8, 32])
    parser.add_argument("--rates", action="store_true", help="measure the rates of this machine")
    given = parser.parse_args()
    if not given.images and not given.rates:
        parser.error("how many images, or --rates")
    if given.rates:
        sys.stdout.write(rates())
    for images in given.images:
        began = time.process_time()
        tree = tree_of_block(images)
        lines = [
            f"{len(tree.node_of):,} images, ordered in {time.process_time() - began:.0f} s: factorisation "
            f"{tree.flops / 1e12:.3g} Tflop, factor {tree.factor_bytes / 1e9:.3g} GB, largest front "
            f"{tree.largest_front:,}; image points {RAYS_PER_IMAGE * len(tree.node_of) * RAY_FLOPS / 1e12:.3g} Tflop",
            "| parts | Tflop of the largest | its factor, GB | shared, of a part | shared, of all | joining, Tflop "
            "| GB | up, GB | down, MB |",
            "|---|---|---|---|---|---|---|---|---|",
            *(_row(tree, parts) for parts in given.parts),
        ]
        sys.stdout.write("\n".join([*lines, ""]))


def tree_of_block(images: int) -> Tree:
    """The elimination tree of a block of as many strips as images in a strip."""
    side = int(np.sqrt(images))
    position, graph = _grid(side)
    size = np.full(graph.n, UNKNOWNS)
    return build_tree(graph, nested_dissection(graph, position), size, UNKNOWNS * np.arange(graph.n))


def _grid(side: int) -> tuple[Float, Graph]:
    """Positions of images in units of their base, with some disorder, and which of them have points in common."""
    row, column = np.divmod(np.arange(side * side), side)
    offsets = [(i, j) for i in range(-ACROSS, ACROSS + 1) for j in range(-ALONG, ALONG + 1) if i or j]
    near = np.stack([_shifted(row, column, i, j, side) for i, j in offsets], axis=1)
    inside = near >= 0
    start = np.concatenate([[0], np.cumsum(inside.sum(axis=1))])
    moved = np.random.default_rng(0).normal(0, 0.05, (side * side, 2))
    return np.column_stack([column, 2.0 * row]) + moved, Graph(start, near[inside].astype(np.int32))


def _shifted(row: Int, column: Int, i: int, j: int, side: int) -> Int:
    inside = (row + i >= 0) & (row + i < side) & (column + j >= 0) & (column + j < side)
    return np.where(inside, (row + i) * side + column + j, -1)


def _row(tree: Tree, count: int) -> str:
    """A row of the table for a number of parts."""
    own = np.array([n.flops for n in tree.nodes])
    rays = np.array([RAYS_PER_IMAGE * n.own for n in tree.nodes])
    of_node, above = nodes_of_parts(tree, rays, count)
    parts = range(int(of_node.max()) + 1)
    factor = np.array([8.0 * n.size * n.panel for n in tree.nodes])
    shared = [_shared(tree, (of_node == k) & ~above) for k in parts]
    joint = UNKNOWNS * sum(n.own for n, up in zip(tree.nodes, above) if up)
    largest = max(parts, key=lambda k: float((own + RAY_FLOPS * rays)[(of_node == k) & ~above].sum()))
    chosen = (of_node == largest) & ~above
    up, down = sum(4 * n * (n + 1) + 24 * n for n in shared), sum(16 * n for n in shared)
    return (
        f"| {count} | {float((own + RAY_FLOPS * rays)[chosen].sum()) / 1e12:.3g} | {factor[chosen].sum() / 1e9:.3g} | "
        f"{max(shared):,} | {joint:,} | {joint**3 / 3e12:.3g} | {8 * joint**2 / 1e9:.3g} | "
        f"{up / 1e9:.3g} | {down / 1e6:.3g} |"
    )


def _shared(tree: Tree, part: Int) -> int:
    """Shared unknowns of the subtrees of a part."""
    heads = [k for k in np.flatnonzero(part).tolist() if tree.nodes[k].parent < 0 or not part[tree.nodes[k].parent]]
    boundary = [tree.nodes[k].vertices[tree.nodes[k].own :] for k in heads]
    return UNKNOWNS * len(np.unique(np.concatenate(boundary)))


def rates(n: int = 4000, message_bytes: int = 64_000_000) -> str:
    """The rates of this machine, the best of three."""
    rng = np.random.default_rng(0)
    a = rng.normal(size=(n // 2, n // 2))
    N = np.asfortranarray(n * np.eye(n) + rng.uniform(-0.5, 0.5, (n, n)))
    with one_blas_thread():
        product = 2 * (n // 2) ** 3 / _least(lambda: a @ a)
        factor = n**3 / 3 / _least(lambda work: lapack.cholesky_panel(work, n), lambda: N.copy(order="F"))
    return (
        f"dgemm of {n // 2} rows {product / 1e9:.3g} Gflop/s, dense factorisation of {n} {factor / 1e9:.3g} Gflop/s, "
        f"messages of {message_bytes / 1e6:.0f} MB {message_bytes / _message_s(message_bytes) / 1e6:.3g} MB/s\n"
    )


def _least(work: Callable[..., Any], prepare: Callable[[], Any] | None = None) -> float:
    """Processor seconds of some work, the least of three; what is prepared for it does not count."""
    seconds = []
    for _ in range(3):
        arguments = () if prepare is None else (prepare(),)
        began = time.process_time()
        work(*arguments)
        seconds.append(time.process_time() - began)
    return min(seconds)


def _message_s(size: int) -> float:
    """Seconds from a worker to the process that waits for it, through the scheduler, as parts send."""
    from distributed import Client, LocalCluster

    from aatri.pipeline.run.dask_parts import Mailbox

    seconds = []
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        for k in range(3):
            box = Mailbox(client, f"rates-{k}")
            sent = client.submit(_send, f"rates-{k}", size, pure=False)
            while not box.packed():
                time.sleep(1e-3)  # a busy wait would take a core from the scheduler
            seconds.append(time.time() - sent.result())
    return min(seconds)


def _send(name: str, size: int) -> float:
    """On a worker: send a message; when it began."""
    from distributed import get_client

    from aatri.pipeline.run.dask_parts import Mailbox

    content, box = np.random.default_rng(0).bytes(size), Mailbox(get_client(), name)
    began = time.time()
    box.put(content)
    return began


if __name__ == "__main__":
    main()
