"""How far soft nodes are from what arithmetic alone could do: nodes of a query times operations of a node.

Nothing is counted by hand. The operations are those of the innermost loop of the compiled kernel, read from the code
that LLVM optimised for this processor; the nodes are those that the sums of real queries took.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from pipeline.analytic.soft_nodes.answer import nodes_taken
from pipeline.analytic.soft_nodes.features import FEATURES, OF_QUERY
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, Table
from pipeline.analytic.soft_nodes.shade import ROWS, SUMS, Directions, directions, shade_fixed, shade_footprint
from pipeline.models.per_query import Portable
from pipeline.truth.geometry.heightfield import ALPHA, BLEND, WARP
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

_OPERATION = re.compile(r"^ *%(\S+) = (?:tail )?(fadd|fsub|fmul|fdiv|fneg|select|call)\b(.*)$")
_FUNCTIONS = re.compile(r"@llvm\.(sqrt|fma|fmuladd|minnum|maxnum|minimum|maximum)\.")
_LANES = re.compile(r"<(\d+) x float>")


class Work(NamedTuple):
    """Work of a query of soft nodes, mean over queries.

    Attributes
    ----------
    fixed, in_footprint : float
        Nodes of the cloth and nodes placed in the footprint, each over all queries.
    operations : float
        Their arithmetic operations.
    """

    fixed: float
    in_footprint: float
    operations: float


class Network(NamedTuple):
    """Level of the soft nodes under a network, and its multiply-adds a query."""

    level: int
    multiply_adds: int


class Operations(NamedTuple):
    """Arithmetic operations of a node, fixed and placed in a footprint."""

    fixed: float
    in_footprint: float


def work_of(table: Table, queries: Queries, operations: Operations) -> Work:
    """Return the work of queries about flat cloth, light and viewer in front."""
    taken = nodes_taken(table, queries).mean(axis=0)
    return Work(float(taken[0]), float(taken[1]), float(taken @ np.array(operations)))


def operations_of(table: Table) -> Operations:
    """Return the operations of a node; kernels are compiled for it, some ten seconds."""
    number = np.float32
    stop = int(table.starts[1])
    # A tuple from a kernel holds numbers in double precision when it comes to Python.
    wi, wo = np.array([0.36, 0.48, 0.8], np.float32), np.array([0.0, 0.6, 0.8], np.float32)
    towards = Directions(*map(number, directions(wi[0], wi[1], wi[2], wo[0], wo[1], wo[2], WARP)))
    horizons = [table.mean[0, :stop], table.mean[1, :stop], table.sharpness[0, :stop], number(0.5)]
    optics = (number(table.yarn[WARP, ALPHA]), number(table.thickness), number(table.yarn[WARP, BLEND]))
    fixed = _optimised(shade_fixed, table.nodes[:stop], table.evenly[:stop], *horizons, *horizons, towards, *optics)
    nodes, cells = np.ones((ROWS, BLOCK_NODES), np.float32), np.zeros(BLOCK_NODES, np.uint32)
    azimuths = [np.uint32(0), np.uint32(1), number(0.5)]
    narrow = _optimised(
        shade_footprint, nodes, cells, table.grid.ravel(), *azimuths, *azimuths, number(1.0), towards,
        table.yarn[WARP], optics[1],
    )  # fmt: skip
    return Operations(loop_operations(fixed, SUMS), loop_operations(narrow, SUMS))


def _optimised(kernel: Callable[..., Any], *arguments: Any) -> str:
    """Return the optimised code of a kernel as LLVM writes it."""
    found: Any = kernel
    # A kernel read from the cache has lost that code; a copy that is not cached has it.
    copy = type(found)(found.py_func, targetoptions=dict(found.targetoptions))
    copy(*arguments)
    return str(copy.inspect_llvm(copy.signatures[0]))


def network_of(method: Portable, fabric: Fabric) -> Network:
    """Return the network of `selvage`: what depends on the fabric alone is no work of a query."""
    network: Any = method.per_query(fabric).module.network
    layers = [layer.weight for layer in (*network.hidden, network.last)]  # those of the correction
    whole = sum(weight.numel() for weight in layers)
    return Network(network.options.level, whole - (FEATURES - OF_QUERY) * network.options.width)


def loop_operations(code: str, sums: int) -> float:
    """Return the arithmetic operations of a node in a loop that sums over nodes.

    The loop is the block that jumps to itself and has most operations. A sum has a number for each node that the loop
    takes at a time. A product that is added is one operation with the sum; a comparison is one with its choice; a
    division and a root are one each.

    Parameters
    ----------
    code : str
        Optimised code of a function, as LLVM writes it.
    sums : int
        Sums of the loop.

    Raises
    ------
    ValueError
        If there is no such loop.
    """
    best, nodes = 0, 0
    for name, block in _blocks(code):
        if f"label %{name}" not in block[-1]:
            continue
        count = _operations(block)
        if count > best:
            best = count
            nodes = sum(_lanes(line) for line in block if " = phi " in line and "float" in line) // sums
    if not nodes:
        raise ValueError("no loop over nodes in the code")
    return best / nodes


def _blocks(code: str) -> list[tuple[str, list[str]]]:
    """Return the name and lines of each block of the first function."""
    found: list[tuple[str, list[str]]] = []
    for line in code.partition("\ndefine ")[2].splitlines()[1:]:
        if line.startswith("}"):
            break
        if label := re.match(r"([\w.$-]+):", line):
            found.append((label[1], []))
        elif line.strip() and found:
            found[-1][1].append(line)
    return [(name, block) for name, block in found if block]


def _lanes(line: str) -> int:
    """Return how many numbers a line computes at a time."""
    lanes = _LANES.search(line)
    return int(lanes[1]) if lanes else 1


def _operations(block: list[str]) -> int:
    """Return how many numbers the arithmetic of a block computes."""
    count, products = 0, set()
    used = re.findall(r"%[\w.$-]+", "\n".join(line.partition(" = ")[2] for line in block))
    for line in block:
        found = _OPERATION.match(line)
        if not found or "float" not in line or (found[2] == "call" and not _FUNCTIONS.search(line)):
            continue
        count += _lanes(line)
        if found[2] == "fmul" and used.count(f"%{found[1]}") == 1:
            products.add(f"%{found[1]}")
        if found[2] in ("fadd", "fsub"):
            added = products.intersection(re.findall(r"%[\w.$-]+", found[3]))
            if added:
                products.discard(added.pop())
                count -= _lanes(line)
    return count
