"""Queries answered from a table of nodes, in single precision, with an estimate of the table's own error.

What the sum gets wrong is where shadow edges cross nodes, and how the integrand curves within one. Each node's share is
taken to be wrong by `_EDGE` of itself where an edge crosses it, by `_SMOOTH` elsewhere, independently of the others;
both numbers were fitted once to converged answers about random fabrics.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.truth.cloth import Columns, Model
from pipeline.truth.footprint import GAUSSIAN, interval_masses
from pipeline.truth.heightfield import ALPHA, BLEND, GAP
from pipeline.truth.kernel import fast_kernel, kernel
from pipeline.truth.query import HIDDEN_SHARE
from pipeline.truth.single import absorbed, remaining
from pipeline.truth.table import COLUMNS, FAMILY, FINE, FINE_START, KIND_X, KIND_Y, ROWS, START, Single, Table

_EDGE: Final = np.float32(0.01)
_EDGE_JUMP: Final = np.float32(0.1)
_UNSEEN: Final = 0.002
_SMOOTH: Final = np.float32(0.0005)

_0, _HALF, _1 = np.float32(0.0), np.float32(0.5), np.float32(1.0)
_JUMP = np.float32(3.0)
_TINY = np.float32(1e-30)
_GRAZING = np.float32(1e-6)
_STEEPEST = 1e4


@fast_kernel
def weigh(
    nx: Single, ny: Single, nz: Single, inverse: Single, weight: Single,
    ix: np.float32, iy: np.float32, iz: np.float32, ox: np.float32, oy: np.float32, oz: np.float32,
    slope_i: np.float32, low_i: Single, high_i: Single, turn_i: np.float32,
    slope_o: np.float32, low_o: Single, high_o: Single, turn_o: np.float32,
    blend: np.float32, lit: Single, areas: Single, diffuses: Single, margins: Single, lit_margins: Single,
) -> tuple[float, float]:
    """Write each node's weight if it is seen and lit, and its shares of area and diffuse; return the sums of both.

    The margins say by how much the viewer, and viewer and light, clear the horizon: negative where they do not.
    """
    area, diffuse = _0, _0
    for k in range(len(weight)):
        cos_o = max(ox * nx[k] + oy * ny[k] + oz * nz[k], _0)
        cos_i = ix * nx[k] + iy * ny[k] + iz * nz[k]
        margin_o = slope_o - low_o[k] - turn_o * (high_o[k] - low_o[k])
        margin_i = min(min(slope_i - low_i[k] - turn_i * (high_i[k] - low_i[k]), cos_i), margin_o)
        visible = weight[k] if margin_o > _0 else _0
        both = weight[k] if margin_i > _0 else _0
        projected = cos_o * inverse[k]
        a = visible * projected
        c = both * projected * (blend * cos_i + (_1 - blend) * iz)
        lit[k], areas[k], diffuses[k], margins[k], lit_margins[k] = both, a, c, margin_o, margin_i
        area += a
        diffuse += c
    return area, diffuse


@fast_kernel
def borders(
    areas: Single, diffuses: Single, speculars: Single, margins: Single, lit_margins: Single, columns: int
) -> tuple[float, float, float, float, float, float]:
    """Return what the borders of shadows, found between nodes, add to the three sums, and their squared errors.

    Where the margin changes sign from one node to the next, the border lies where its straight line crosses 0, and the
    visible node counts up to there instead of half-way. Where the margin jumps, half-way is as good as anything.
    """
    area, diffuse, specular = _0, _0, _0
    area_error, diffuse_error, specular_error = _0, _0, _0
    for k in range(columns, len(areas) - 2 * columns - 2):
        m, right, down = margins[k], margins[k + 1], margins[k + columns]
        share, doubt = _crossing(margins[k - 1], m, right, margins[k + 2], abs(m - down))
        v = areas[k] + areas[k + 1]
        area += v * share
        area_error += areas[k] * areas[k] * _SMOOTH + v * v * doubt
        share, doubt = _crossing(margins[k - columns], m, down, margins[k + 2 * columns], abs(m - right))
        v = areas[k] + areas[k + columns]
        area += v * share
        area_error += v * v * doubt

        m, right, down = lit_margins[k], lit_margins[k + 1], lit_margins[k + columns]
        share, doubt = _crossing(lit_margins[k - 1], m, right, lit_margins[k + 2], abs(m - down))
        v, w = diffuses[k] + diffuses[k + 1], speculars[k] + speculars[k + 1]
        diffuse += v * share
        specular += w * share
        diffuse_error += diffuses[k] * diffuses[k] * _SMOOTH + v * v * doubt
        specular_error += speculars[k] * speculars[k] * _SMOOTH + w * w * doubt
        share, doubt = _crossing(lit_margins[k - columns], m, down, lit_margins[k + 2 * columns], abs(m - right))
        v, w = diffuses[k] + diffuses[k + columns], speculars[k] + speculars[k + columns]
        diffuse += v * share
        specular += w * share
        diffuse_error += v * v * doubt
        specular_error += w * w * doubt
    return area, diffuse, specular, area_error, diffuse_error, specular_error


@fast_kernel
def _crossing(before: np.float32, m: np.float32, n: np.float32, after: np.float32, across: np.float32) -> tuple[float, float]:
    """Return what a border between nodes of margins m and n adds to the visible one's share, and its squared error.

    `before` and `after` are the margins beyond them, `across` the change of the margin at a right angle, which shares
    the border with the links in that direction.
    """
    change = abs(m - n)
    weight = change / (change + across + _TINY)
    jump = change > _JUMP * max(abs(before - m), abs(n - after))
    share = _0 if jump else max(m, n) / (change + _TINY) - _HALF
    crossed = min(m, n) <= _0 and max(m, n) > _0
    doubt = weight * (_EDGE_JUMP if jump else _EDGE)
    return (weight * share if crossed else _0), (doubt if crossed else _0)


@fast_kernel
def reflected(
    nx: Single, ny: Single, nz: Single, inverse: Single, tx: Single, ty: Single, tz: Single,
    ix: np.float32, iy: np.float32, iz: np.float32, ox: np.float32, oy: np.float32, oz: np.float32,
    square: np.float32, thickness: np.float32, size: np.float32, scale: np.float32, lit: Single, speculars: Single,
) -> float:
    """Add each node's share of the reflected specular component to `speculars`; return the sum.

    `square` is alpha^2, `size` one over the squared length of wi + wo, `scale` alpha^3 / (4 pi) over the finer nodes.
    """
    total = _0
    for k in range(len(lit)):
        cos_o = max(ox * nx[k] + oy * ny[k] + oz * nz[k], _0)
        cos_i = max(ix * nx[k] + iy * ny[k] + iz * nz[k], _0)
        # Cross products with the tangent; the half vector's are sums of the two.
        ax, ay, az = iy * tz[k] - iz * ty[k], iz * tx[k] - ix * tz[k], ix * ty[k] - iy * tx[k]
        bx, by, bz = oy * tz[k] - oz * ty[k], oz * tx[k] - ox * tz[k], ox * ty[k] - oy * tx[k]
        along_i = ix * tx[k] + iy * ty[k] + iz * tz[k]
        along_o = ox * tx[k] + oy * ty[k] + oz * tz[k]
        sigma_i = np.sqrt(ax * ax + ay * ay + az * az + square * along_i * along_i)
        sigma_o = np.sqrt(bx * bx + by * by + bz * bz + square * along_o * along_o)
        vx, vy, vz, along = ax + bx, ay + by, az + bz, along_i + along_o
        q = size * (square * (vx * vx + vy * vy + vz * vz) + along * along)
        crossed = sigma_i * cos_o + sigma_o * cos_i
        # One division serves 1 / (cos_i cos_o) and 1 / (q^2 crossed).
        cosines, spread = cos_i * cos_o, q * q * crossed
        both = _1 / (cosines * spread + _TINY)
        depth = thickness * crossed * spread * both
        value = lit[k] * scale * inverse[k] * cosines * cosines * both * absorbed(depth)
        speculars[k] += value
        total += value
    return total


@fast_kernel
def transmitted(
    nx: Single, ny: Single, nz: Single, inverse: Single, tx: Single, ty: Single, tz: Single,
    ix: np.float32, iy: np.float32, iz: np.float32, ox: np.float32, oy: np.float32, oz: np.float32,
    square: np.float32, thickness: np.float32, size: np.float32, scale: np.float32, lit: Single, speculars: Single,
) -> float:
    """Do the same for light from behind, of which (ix, iy, iz) is the opposite, -wi."""
    total = _0
    for k in range(len(lit)):
        cos_o = max(ox * nx[k] + oy * ny[k] + oz * nz[k], _0)
        cos_i = max(ix * nx[k] + iy * ny[k] + iz * nz[k], _0)
        ax, ay, az = iy * tz[k] - iz * ty[k], iz * tx[k] - ix * tz[k], ix * ty[k] - iy * tx[k]
        bx, by, bz = oy * tz[k] - oz * ty[k], oz * tx[k] - ox * tz[k], ox * ty[k] - oy * tx[k]
        along_i = ix * tx[k] + iy * ty[k] + iz * tz[k]
        along_o = ox * tx[k] + oy * ty[k] + oz * tz[k]
        lambda_i = np.sqrt(ax * ax + ay * ay + az * az + square * along_i * along_i) / max(cos_i, _GRAZING)
        lambda_o = np.sqrt(bx * bx + by * by + bz * bz + square * along_o * along_o) / max(cos_o, _GRAZING)
        vx, vy, vz, along = bx - ax, by - ay, bz - az, along_o - along_i
        q = size * (square * (vx * vx + vy * vy + vz * vz) + along * along)
        apart = max(thickness * abs(lambda_i - lambda_o), _TINY)
        through = remaining(thickness * min(lambda_i, lambda_o)) * absorbed(apart) / apart
        value = lit[k] * scale * inverse[k] * thickness * through / (q * q + _TINY)
        value = value if cos_i > _0 and cos_o > _0 else _0
        speculars[k] += value
        total += value
    return total


@fast_kernel
def crossing(
    nx: Single, ny: Single, nz: Single, tx: Single, ty: Single, tz: Single,
    ox: np.float32, oy: np.float32, oz: np.float32, square: np.float32, thickness: np.float32, areas: Single,
) -> float:
    """Return the sum of what crosses the layer unscattered, exp(-T Lambda), from each node's share of the area."""
    total = _0
    for k in range(len(areas)):
        cos_o = max(ox * nx[k] + oy * ny[k] + oz * nz[k], _GRAZING)
        bx, by, bz = oy * tz[k] - oz * ty[k], oz * tx[k] - ox * tz[k], ox * ty[k] - oy * tx[k]
        along_o = ox * tx[k] + oy * ty[k] + oz * tz[k]
        sigma_o = np.sqrt(bx * bx + by * by + bz * bz + square * along_o * along_o)
        total += areas[k] * remaining(thickness * sigma_o / cos_o)
    return total


@kernel
def _azimuth(x: float, y: float, count: int) -> tuple[int, int, float]:
    """Return the rows of the two tabulated azimuths around a direction, and where between them it lies."""
    place = math.atan2(y, x) / (2.0 * math.pi) * count
    row = math.floor(place)
    return int(row) % count, int(row + 1) % count, place - row


@kernel
def _slope(x: float, y: float, z: float) -> float:
    """Return the rise of a direction with z > 0, bounded."""
    return min(z / max(math.sqrt(x * x + y * y), 1e-9), _STEEPEST)


@kernel
def _fill_weights(table: Table, shape: int, columns: Columns, row: int, scratch: Single,
                  touched: npt.NDArray[np.bool_], weight: Single) -> None:
    """Write the share of a footprint that falls on each node and its copies.

    `scratch` is (2, cells, kinds, n), `touched` (2, cells, kinds): the shares along x and y, and whether there are any.
    """
    weight[:] = _0
    kinds, ends, picks = len(table.edges), table.repeat[0], table.repeat[1]
    for axis in range(2):
        centre, sigma, cells = columns.u[row], columns.sigma[row], ends
        if axis == 1:
            centre, sigma, cells = columns.v[row], columns.sigma_minor[row], picks
        centre -= math.floor(centre / cells) * cells
        for cell in range(cells):
            for kind in range(kinds):
                touched[axis, cell, kind] = interval_masses(
                    shape, centre, sigma, float(cells), table.edges[kind], float(cell), scratch[axis, cell, kind]
                )
    for p in range(len(table.pieces)):
        piece = table.pieces[p]
        start, across, lines = piece[START], piece[COLUMNS], piece[ROWS]
        for c in range(table.copies.shape[1]):
            end, pick = table.copies[p, c, 0], table.copies[p, c, 1]
            if touched[0, end, piece[KIND_X]] and touched[1, pick, piece[KIND_Y]]:
                along_x, along_y = scratch[0, end, piece[KIND_X]], scratch[1, pick, piece[KIND_Y]]
                _add_product(along_x[:across], along_y[:lines], weight[start : start + across * lines])


@fast_kernel
def _add_product(along_x: Single, along_y: Single, weight: Single) -> None:
    """Add the products of the shares along x and along y to the nodes of a grid."""
    across = len(along_x)
    for j in range(len(along_y)):
        if along_y[j] > _0:
            line = weight[j * across : (j + 1) * across]
            for i in range(across):
                line[i] += along_y[j] * along_x[i]


@fast_kernel
def _any(share: Single) -> bool:
    total = _0
    for k in range(len(share)):
        total += share[k]
    return total > _0


@kernel
def sum_rows(
    model: Model, table: Table, columns: Columns
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Answer every row: means and standard errors (N, 5), and nodes visited.

    Footprints are round or lie along the axes, the cloth is flat, cosines go to the ply normal, points hide one
    another, and light comes from behind only if the table has horizons there.
    """
    rows, front = len(columns.u), model.front
    means, errors, counts = np.zeros((rows, 5)), np.zeros((rows, 5)), np.zeros(rows, np.int64)
    nodes = table.normal.shape[1]
    weight, lit = np.zeros(nodes, np.float32), np.zeros(nodes, np.float32)
    areas, diffuses, speculars = np.zeros(nodes, np.float32), np.zeros(nodes, np.float32), np.zeros(nodes, np.float32)
    margins, lit_margins = np.zeros(nodes, np.float32), np.zeros(nodes, np.float32)
    cells = max(table.repeat[0], table.repeat[1])
    scratch = np.zeros((2, cells, len(table.edges), table.edges.shape[1] - 1), np.float32)
    touched = np.zeros((2, cells, len(table.edges)), np.bool_)
    azimuths = len(table.slope)
    moved = np.zeros(5)
    thickness = np.float32(front.thickness)
    for row in range(rows):
        wi, wo = columns.wi[row], columns.wo[row]
        behind = wi[2] < 0.0
        sign = -1.0 if behind else 1.0
        ix, iy, iz = np.float32(sign * wi[0]), np.float32(sign * wi[1]), np.float32(sign * wi[2])
        ox, oy, oz = np.float32(wo[0]), np.float32(wo[1]), np.float32(wo[2])
        # Light from behind travels in its own azimuth, not in that of -wi.
        i0, i1, turn_i = _azimuth(wi[0], wi[1], azimuths)
        o0, o1, turn_o = _azimuth(wo[0], wo[1], azimuths)
        ti, to = np.float32(turn_i), np.float32(turn_o)
        slope_i, slope_o = np.float32(_slope(wi[0], wi[1], abs(wi[2]))), np.float32(_slope(wo[0], wo[1], wo[2]))
        horizon_i = table.slope_behind if behind else table.slope
        half = (wi[0] + wo[0]) ** 2 + (wi[1] + wo[1]) ** 2 + (wi[2] + wo[2]) ** 2
        size = np.float32(1.0 / max(half, 1e-12))

        even = model.shape == GAUSSIAN and min(columns.sigma[row], columns.sigma_minor[row]) >= table.uniform
        if not even:
            _fill_weights(table, model.shape, columns, row, scratch, touched, weight)
        shares = table.evenly if even else weight

        area, area_error, moved_area = 0.0, 0.0, 0.0
        moved[:] = 0.0
        sums, squares = means[row], errors[row]
        for p in range(len(table.pieces)):
            piece = table.pieces[p]
            start, across, count, family = piece[START], piece[COLUMNS], piece[COLUMNS] * piece[ROWS], piece[FAMILY]
            stop = start + count
            share = shares[start:stop]
            if not _any(share):
                continue
            counts[row] += count
            yarn = front.yarn[min(family, 1)]
            a, c = weigh(
                table.normal[0, start:stop], table.normal[1, start:stop], table.normal[2, start:stop],
                table.normal[3, start:stop], share, ix, iy, iz, ox, oy, oz,
                slope_i, horizon_i[i0, start:stop], horizon_i[i1, start:stop], ti,
                slope_o, table.slope[o0, start:stop], table.slope[o1, start:stop], to,
                np.float32(yarn[BLEND]), lit[:count], areas[:count], diffuses[:count], margins[:count], lit_margins[:count],
            )
            area += a
            speculars[:count] = _0
            if family == GAP:
                sums[4] += a
            else:
                square = np.float32(yarn[ALPHA] ** 2)
                f0 = piece[FINE_START]
                f1 = f0 + count
                sums[4] += crossing(
                    table.normal[0, start:stop], table.normal[1, start:stop], table.normal[2, start:stop],
                    table.fine[4, f0:f1], table.fine[5, f0:f1], table.fine[6, f0:f1],
                    ox, oy, oz, square, thickness, areas[:count],
                )
            if family != GAP and c > 0.0:
                sums[2 + family] += c / math.pi
                counts[row] += count * piece[FINE]
                scale = np.float32(yarn[ALPHA] ** 3 / (4.0 * math.pi * piece[FINE]))
                for _ in range(piece[FINE]):
                    parts = (
                        table.fine[0, f0:f1], table.fine[1, f0:f1], table.fine[2, f0:f1], table.fine[3, f0:f1],
                        table.fine[4, f0:f1], table.fine[5, f0:f1], table.fine[6, f0:f1],
                    )
                    if behind:
                        sums[family] += transmitted(
                            *parts, ix, iy, iz, ox, oy, oz, square, thickness, size, scale, lit[:count], speculars[:count]
                        )
                    else:
                        sums[family] += reflected(
                            *parts, ix, iy, iz, ox, oy, oz, square, thickness, size, scale, lit[:count], speculars[:count]
                        )
                    f0, f1 = f1, f1 + count
            a1, c1, s1, a2, c2, s2 = borders(
                areas[:count], diffuses[:count], speculars[:count], margins[:count], lit_margins[:count], across
            )
            moved_area += a1
            area_error += a2
            if family != GAP:
                moved[family] += s1
                moved[2 + family] += c1 / math.pi
                squares[family] += s2
                squares[2 + family] += c2 / (math.pi * math.pi)

        # Ratios: what borders between nodes move, what they leave in doubt, and what nothing here can see.
        below = wo[2] if model.projected else area
        if area < HIDDEN_SHARE * wo[2]:
            means[row], errors[row] = 0.0, 0.0
            continue
        squares[4] = area_error * (sums[4] / area) ** 2
        for c in range(5):
            mean = sums[c] / below
            inner = 0.0 if model.projected else mean
            shift = moved[c] - inner * moved_area
            doubt = squares[c] + inner * inner * area_error
            means[row, c] = mean
            errors[row, c] = math.sqrt(shift * shift + doubt) / below + _UNSEEN * mean
    return means, errors, counts
