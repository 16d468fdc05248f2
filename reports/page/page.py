"""Folder of a page: ``index.html``, its figures, tables and Records; it needs nothing outside of it.

The same input gives the same bytes. Figures are written first, then ``files.json`` with the hashes of all files, and
the page last: a page that exists is whole.
"""

import io
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from pipeline.atomic import atomic_write
from reports.images import tiles
from reports.images.draft import drawdown
from reports.images.exr import film, read_exr
from reports.page import figures, front_figures
from reports.page.content import PageInput
from reports.page.figures import render
from reports.page.files import write_files
from reports.page.html import page_html, schemes
from reports.page.pictures import films, filmstrip
from reports.record import OF_A_PAGE, TRUTH, machine_path, write_records
from reports.tables import summary
from reports.tables.page_tables import page_frames, ranged_frames


def write_page(folder: Path, page: PageInput, progress: Callable[[float], None] = lambda fraction: None) -> Path:
    """Write a page into `folder`, which is created if need be, and return the path of ``index.html``.

    `progress` receives the share that is done. BadInput if a picture is missing, or the folder cannot be written.
    """
    frames = page_frames(page.records)
    written = [OF_A_PAGE, machine_path(Path(OF_A_PAGE)).name]
    for name, frame in frames.items():
        write_table(folder / "tables" / name, frame)
        written += [f"tables/{name}.csv", f"tables/{name}.parquet"]
    progress(0.1)
    sizes: dict[str, tuple[int, int]] = {}
    expected = 18 + 3 * len(page.pictures) + 3 * len(page.fabrics)
    for name, content in itertools.chain(_plots(ranged_frames(frames), page), _tiles(page)):
        atomic_write(folder / "figures" / name, content)
        written.append(f"figures/{name}")
        sizes[name] = tiles.size_of(content)
        progress(0.1 + 0.9 * min(1.0, len(sizes) / expected))
    for fabric, path in page.live.items():
        atomic_write(folder / "live" / f"{fabric}.html", path.read_bytes())
        written.append(f"live/{fabric}.html")
    write_records(folder / OF_A_PAGE, page.records, page.machine)
    write_files(folder, written)
    index = folder / "index.html"
    atomic_write(index, page_html(page, frames, sizes).encode())
    return index


def write_table(path: Path, table: pd.DataFrame) -> None:
    """Write a table as ``path.csv`` and ``path.parquet``; equal tables give equal bytes."""
    atomic_write(path.with_suffix(".csv"), table.to_csv(index=False, lineterminator="\n").encode())
    buffer = io.BytesIO()
    table.to_parquet(buffer, index=False, compression="zstd")
    atomic_write(path.with_suffix(".parquet"), buffer.getvalue())


def _plots(frames: dict[str, pd.DataFrame], page: PageInput) -> Iterator[tuple[str, bytes]]:
    """Draw every plot that there are numbers for, in both schemes."""
    errors, timing, aliasing = frames["errors"], frames["timing"], frames["aliasing"]
    curves = summary.spectra(page.records)
    tradeoff, scenes = frames["tradeoff"], frames["scenes"]
    plots: dict[str, tuple[Any, ...]] = {
        "errors": (len(errors) > 0, figures.errors, errors, frames["errors_by_fabric"]),
        "error-against-time": (tradeoff["error"].notna().any(), front_figures.error_against_time, tradeoff),
        "error-against-bytes": (tradeoff["error"].notna().any(), front_figures.error_against_bytes, tradeoff),
        "aliasing-against-time": (tradeoff["flicker"].notna().any(), front_figures.aliasing_against_time, tradeoff),
        "error-by-size": (len(frames["by_size"]) > 0, front_figures.error_by_size, frames["by_size"]),
        "scenes": (scenes["frame_time"].notna().any(), front_figures.scenes, scenes),
        "aliasing": (len(aliasing) > 0, figures.aliasing, aliasing),
        "spectra": (len(curves) > 0, figures.spectra, curves),
        "timing": (len(timing) > 0, figures.timing, timing),
    }
    for name, (measured, plot, *data) in plots.items():
        for scheme in schemes(page).values() if measured else ():
            yield f"{name}-{scheme.name}.png", render(plot, scheme, *data)


def _tiles(page: PageInput) -> Iterator[tuple[str, bytes]]:
    """Draw every picture, every difference, every strip of frames, and the maps of every fabric."""
    truths = {(p.fabric, p.scene): read_exr(p.path) for p in page.shown if p.method == TRUTH}
    for file in page.shown:
        exr = truths[file.fabric, file.scene] if file.method == TRUTH else read_exr(file.path)
        yield f"{file.stem}.png", tiles.picture(exr)
        if file.method != TRUTH and file.fabric:
            yield f"{file.stem}-difference.png", tiles.difference(exr, truths[file.fabric, file.scene])
        elif file.method != TRUTH:
            yield f"{file.stem}-relative.png", tiles.relative_tile(exr)
            yield f"{file.stem}-flip.png", tiles.flip_tile(exr)
    for scene, files in films(page.pictures).items():
        yield f"film-{scene}.png", filmstrip({file.stem: film(read_exr(file.path)) for file in files})
    for fabric, _ in page.fabrics:
        for kind, draw in (("drawdown", drawdown), ("height", tiles.height), ("normals", tiles.normals)):
            yield f"{fabric.name}-{kind}.png", draw(fabric)
