"""Draft files that weaving programs read: a fabric as WIF text, written by dtx-to-wif."""

import io
from importlib.metadata import version
from math import lcm
from typing import Any, Final

import numpy as np
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
    levels = (np.rint(255 * encoded(threads.diffuse)).astype(int).tolist() for threads in fabric.thread_colours())
    orders = [list(map(tuple, colours)) for colours in levels]
    _, table = numbered([colour for order in orders for colour in order])
    parts: dict[str, Any] = {}
    names = (("warp", "threading", "ends"), ("weft", "treadling", "picks"))
    for axis, ((name, section, key), order) in enumerate(zip(names, orders, strict=True)):
        repeat = getattr(loom, section)
        if (threads := lcm(len(repeat), len(order))) > MOST_THREADS:
            needed = f"structure and colours repeat together after {threads:,} {key}"
            raise BadInput(fabric.name, "", needed, f"at most {MOST_THREADS:,} can be written to a draft file")
        colours = {index + 1: table.index(order[index % len(order)]) + 1 for index in range(threads)}
        yarns = WarpWeftData(threads=threads, color=colours[1])
        if fabric.yarns_per_cm is not None:
            yarns.units, yarns.spacing = "Decipoints", DECIPOINTS / fabric.yarns_per_cm[axis]
            yarns.thickness = yarns.spacing * getattr(fabric, name).width
        numbers = {index + 1: {repeat[index % len(repeat)]} for index in range(threads)}
        parts |= {name: yarns, section: numbers, f"{name}_colors": colours}
    pattern = PatternData(
        name=fabric.name,
        tieup=tieup,
        liftplan={},
        color_table=dict(enumerate(table, 1)),  # type: ignore[arg-type]
        color_range=(0, 255),
        source_program="twillight",
        source_version=version("twillight"),
        num_shafts=len(loom.tie_up[0]),
        num_treadles=len(tieup),
        **parts,
    )
    file = io.StringIO()
    write_wif(file, pattern)
    return file.getvalue()
