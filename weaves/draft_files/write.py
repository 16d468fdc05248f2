"""Draft files that weaving programs read: a fabric as WIF text, written by dtx-to-wif."""

from __future__ import annotations

import io
from importlib.metadata import version
from math import lcm
from typing import Final

import numpy as np
import numpy.typing as npt
from dtx_to_wif import PatternData, WarpWeftData, write_wif

from weaves.colour import encoded
from weaves.colour_order import MOST_THREADS
from weaves.draft import numbered
from weaves.errors import BadInput
from weaves.fabric import Fabric

DECIPOINTS: Final = 720 / 2.54
"""Decipoints per centimetre: the smallest unit of WIF, because lengths are written with three decimals."""


def wif_text(fabric: Fabric) -> str:
    """Return a fabric as a Weaving Information File, version 1.1.

    Threading, tie-up and treadling are those of `Fabric.loom`. The file has as many ends and picks as the repeats of
    structure and colours fill. Spacing and thickness are written if the fabric has `yarns_per_cm`. BadInput if more
    than `MOST_THREADS` ends or picks would be needed.
    """
    loom = fabric.loom()
    tieup = {
        treadle: {shaft for shaft, lifted in enumerate(shafts, 1) if lifted}
        for treadle, shafts in enumerate(loom.tie_up, 1)
    }
    orders = [[_eight_bits(colour) for colour in threads.diffuse] for threads in fabric.thread_colours()]
    _, table = numbered([colour for order in orders for colour in order])
    axes = []
    for key, repeat, order in (("ends", loom.threading, orders[0]), ("picks", loom.treadling, orders[1])):
        if (threads := lcm(len(repeat), len(order))) > MOST_THREADS:
            needed = f"structure and colours repeat together after {threads:,} {key}"
            raise BadInput(fabric.name, "", needed, f"at most {MOST_THREADS:,} can be written to a draft file")
        numbers = {index + 1: {repeat[index % len(repeat)]} for index in range(threads)}
        colours = {index + 1: table.index(order[index % len(order)]) + 1 for index in range(threads)}
        axes.append((numbers, colours))
    pattern = PatternData(
        name=fabric.name,
        threading=axes[0][0],
        tieup=tieup,
        treadling=axes[1][0],
        liftplan={},
        color_table=dict(enumerate(table, 1)),  # type: ignore[arg-type]
        warp=_yarns(fabric, 0, len(axes[0][0]), axes[0][1][1]),
        weft=_yarns(fabric, 1, len(axes[1][0]), axes[1][1][1]),
        warp_colors=axes[0][1],
        weft_colors=axes[1][1],
        color_range=(0, 255),
        source_program="twillight",
        source_version=version("twillight"),
        num_shafts=len(loom.tie_up[0]),
        num_treadles=len(tieup),
    )
    file = io.StringIO()
    write_wif(file, pattern)
    return file.getvalue()


def _yarns(fabric: Fabric, axis: int, threads: int, colour: int) -> WarpWeftData:
    """Return the numbers of the warp (0) or weft (1)."""
    yarns = WarpWeftData(threads=threads, color=colour)
    if fabric.yarns_per_cm is not None:
        yarns.units, yarns.spacing = "Decipoints", DECIPOINTS / fabric.yarns_per_cm[axis]
        yarns.thickness = yarns.spacing * (fabric.warp, fabric.weft)[axis].width
    return yarns


def _eight_bits(linear: npt.NDArray[np.float64]) -> tuple[int, ...]:
    return tuple(int(level) for level in np.rint(255 * encoded(linear)))
