"""Texture maps from the sums of a level, and the numbers of the material that hold for all texels.

A material of base colour, specular and roughness cannot have the optics of a yarn exactly. These rules fix one:

    base colour         k_d rho_d / c: rho_d the reflectance of the truth's diffuse component under an even sky, seen
                        from above, c the coverage of its family; so the mean of base colour times opacity is the
                        diffuse albedo of the truth
    transmitted colour  k_dt rho_dt / c, likewise, for a sky behind the cloth
    specular F0         k_s rho_s / (c E), E the share that GGX of F = 1 and the yarn's roughness returns towards the
                        normal; as index of refraction of the largest F0, and a colour of at most 1
    roughness           with S the mean flake matrix of the texel (pipeline.materials.planes), n its mean normal, and
                        e_1, e_2 the axes of S in the plane across n:
                            alpha_along^2 = e_1 S e_1 / n S n,   alpha_across^2 = min(1, e_2 S e_2 / n S n)
                        On one fibre that is alpha and 1: GGX of these two has the density of the fibre's flakes
                        [Heitz2015SGGX]; over several, the variance of their directions is added.
    sheen               what the truth returns more than diffuse and GGX lobe under an even sky, seen at 75 degrees

Programs take perceptual roughness, the square root of alpha. OpenPBR takes r and a with
alpha_across = r^2 sqrt(2 / (1 + (1 - a)^2)), alpha_along = (1 - a) alpha_across [Andersson2024OpenPBR]. glTF takes r
and s with alpha_along = r^2, alpha_across = r^2 + (1 - r^2) s^2 [Khronos2021GLTF].
"""

from typing import Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32, Float64
from pipeline.materials.lobes import Reflectance, ggx_reflectance, grazing_views, sheen_reflectance, white_f0
from pipeline.materials.planes import PAIRS, Planes, material_colours
from weaves.fabric import Fabric

_TINY: Final = 1e-6
_BAND: Final = 1 << 18  # texels that are worked on at once


class Constants(NamedTuple):
    """Numbers of a material that no map holds."""

    ior: float  # index of refraction by which F0 is the largest of the fabric
    largest_f0: float  # its F0: specular colour 1 in a map
    sheen: Float64  # colour of the sheen, linear RGB, (3,)
    transmitted: float
    """Weight of the light that goes through: the largest transmitted colour, or less where the base colour would not
    fit beside it."""
    open_cloth: bool  # true if there are gaps


class Textures(NamedTuple):
    """Maps of one level, float32 (H, W) or (H, W, 3), pick 0 in row 0."""

    base_color: Float32
    specular_color: Float32
    transmission_color: Float32
    """Linear RGB, not multiplied by the opacity; specular colour as a share of `Constants.largest_f0`, (H, W, 3)."""
    opacity: Float32  # share of the texel that is covered, (H, W)
    height: Float32  # in yarn spacings, (H, W)
    normal: Float32  # unit normal: x along the weft, y along the warp, z up, (H, W, 3)
    tangent: Float32
    """Unit direction of the fibres, at right angles to the normal; along +y, or +x where it lies nearer to x,
    (H, W, 3)."""
    alpha_along: Float32
    alpha_across: Float32
    """GGX roughness along the fibres and across them, not its square root, (H, W)."""
    occlusion: Float32  # share of an even sky's light that reaches the yarns, 1 in gaps, (H, W)


def constants(fabric: Fabric, share: Reflectance) -> Constants:
    """Return the numbers of a fabric's material that hold for all texels."""
    colours = zip(*material_colours(fabric, share), strict=True)
    back, largest, through = (max(float(rows.max()) for rows in kind) for kind in colours)
    largest = min(max(largest, 1e-4), 0.9)
    root = largest**0.5
    open_cloth = (1.0 - fabric.warp.width) * (1.0 - fabric.weft.width) > 0.0
    return Constants(
        (1 + root) / (1 - root), largest, _sheen(fabric, share), through / max(1.0, back + through), open_cloth
    )


def textures(level: Planes, material: Constants, lit: Float32 | None = None) -> Textures:
    """Return the maps of a level; `lit` is that of `pipeline.materials.occlusion`, None for no occlusion."""
    lit = level.coverage if lit is None else lit
    rows = max(1, _BAND // level.coverage.shape[1])
    starts = range(0, len(level.coverage), rows)
    bands = [
        _band(Planes(*(plane[first : first + rows] for plane in level)), material, lit[first : first + rows])
        for first in starts
    ]
    return Textures(*(np.concatenate(parts) for parts in zip(*bands, strict=True)))


def _band(level: Planes, material: Constants, lit: Float32) -> Textures:
    """Return the maps of some rows."""
    covered = np.maximum(level.coverage, _TINY)[..., None]
    normal = np.where(level.coverage[..., None] > _TINY, level.normal, (0.0, 0.0, 1.0))
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    tangent, along, across = _flakes(normal, level.fibres / covered)
    specular = np.clip(level.specular / covered / material.largest_f0, 0.0, 1.0)
    base, through = (np.clip(plane / covered, 0.0, 1.0) for plane in (level.base, level.through))
    occlusion = np.where(level.coverage > _TINY, np.clip(lit / covered[..., 0], 0.0, 1.0), 1.0)
    maps = (base, specular, through, level.coverage, level.height, normal, tangent, along, across, occlusion)
    return Textures(*(np.asarray(values, np.float32) for values in maps))


def openpbr_roughness(along: Float32, across: Float32) -> tuple[Float32, Float32]:
    """Return roughness and anisotropy of OpenPBR."""
    return np.asarray(((along**2 + across**2) / 2) ** 0.25), np.asarray(1.0 - along / across)


def gltf_strength(along: Float32, across: Float32) -> Float32:
    """Return the strength of the anisotropy of glTF; its roughness is the square root of `along`."""
    return np.asarray(np.sqrt(np.clip((across - along) / np.maximum(1.0 - along, _TINY), 0.0, 1.0)))


def across_direction(normal: Float32, tangent: Float32) -> Float32:
    """Return the unit direction in the plane of the map that, laid into the surface, is across the fibres, (H, W, 2).

    It is b - (b_z / n_z) n, with b = n x t: a program that projects it onto the plane across n finds b.
    """
    b = np.cross(normal, tangent)
    flat = b[..., :2] - (b[..., 2:] / np.maximum(normal[..., 2:], _TINY)) * normal[..., :2]
    flat = np.where(flat[..., :1] < 0.0, -flat, flat)
    return np.asarray(flat / np.maximum(np.linalg.norm(flat, axis=-1, keepdims=True), _TINY), np.float32)


def _flakes(normal: Float64, fibres: Float64) -> tuple[Float64, Float64, Float64]:
    """Return the direction of the fibres and both roughnesses, from the normal and (1 - alpha^2) E[t t^T]."""
    matrix = np.empty((*fibres.shape[:-1], 3, 3), np.float64)
    for entry, (a, b) in enumerate(PAIRS):
        matrix[..., a, b] = matrix[..., b, a] = fibres[..., entry]
    # A frame across the normal; its first axis is x, laid into the surface.
    first = (1.0, 0.0, 0.0) - normal * normal[..., :1]
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    second = np.cross(normal, first)

    def entry_of(a: Float64, b: Float64) -> Float64:
        return np.asarray(np.einsum("...i,...ij,...j", a, matrix, b))

    xx, yy, xy = entry_of(first, first), entry_of(second, second), entry_of(first, second)
    middle, apart = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    turn = 0.5 * np.arctan2(2.0 * xy, xx - yy)[..., None]
    tangent = np.cos(turn) * first + np.sin(turn) * second
    leading = np.where(np.abs(tangent[..., :1]) > np.abs(tangent[..., 1:2]), tangent[..., :1], tangent[..., 1:2])
    tangent = np.where(leading < 0.0, -tangent, tangent)
    upright = 1.0 - entry_of(normal, normal)
    along = np.sqrt(np.clip((1.0 - middle - apart) / upright, 1e-4, 1.0))
    return tangent, along, np.sqrt(np.clip((1.0 - middle + apart) / upright, 1e-4, 1.0))


def _sheen(fabric: Fabric, share: Reflectance) -> Float64:
    """Return the colour of the sheen; formula in the module's docstring."""
    missing = np.zeros(3)
    factor = white_f0(fabric, share)
    for family, (yarn, colours) in enumerate(zip((fabric.warp, fabric.weft), fabric.thread_colours(), strict=True)):
        k_d, k_s = colours.diffuse.mean(axis=0), colours.specular.mean(axis=0)
        lobe = share.coverage[family] * ggx_reflectance(yarn.roughness, 1.0, k_s * factor[family])
        truth = k_d * share.grazing_diffuse[family] + k_s * share.grazing_specular[family]
        missing += truth - k_d * share.diffuse[family] * (1.0 - lobe.max()) - lobe
    return np.asarray(np.clip(missing / sheen_reflectance(grazing_views()[0]), 0.0, 1.0))
