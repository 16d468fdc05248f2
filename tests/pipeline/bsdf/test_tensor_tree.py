"""Trees by closed forms, by a reader that follows one pair of labels, and by Radiance (external)."""

import re

import numpy as np
import pytest
from scipy.stats import chisquare

from pipeline.bsdf.klems import KLEMS_FULL
from pipeline.bsdf.tensor_tree import Square, read_tree, tree_text
from weaves.errors import BadInput


def test_cells_are_even_in_projected_solid_angle_and_turn_with_their_labels():
    square, random = Square.of(3), np.random.default_rng(1)
    cell, (u, v) = np.arange(64), random.random((2, 64))
    label = square.directions(cell, u, v)
    assert np.linalg.norm(label, axis=1) == pytest.approx(1.0)
    assert (square.cells(np.hypot(*label.T[:2]), np.arctan2(*label.T[1::-1])) == cell).all()
    assert square.directions(square.opposite, 1.0 - u, 1.0 - v) == pytest.approx(label * [-1, -1, 1], abs=1e-12)
    assert square.directions(square.mirror, 1.0 - u, v) == pytest.approx(label * [-1, 1, 1], abs=1e-12)
    radius, azimuth = np.sqrt(random.random(64_000)), np.pi * (2.0 * random.random(64_000) - 1.0)
    assert chisquare(np.bincount(square.cells(radius, azimuth), minlength=64)).pvalue > 1e-3


def value_at(text, place):
    """Return the value of a tree at a place of the unit cube, by walking down to its grid."""
    tokens = re.findall(r"[{}]|[^\s,{}]+", text)
    start, scale = 0, 1.0
    while tokens[start + 1] == "{":
        bits = [int(x * scale % 1.0 >= 0.5) for x in place]
        start, scale = start + 1, 2.0 * scale
        for _ in range(sum(bit << axis for axis, bit in enumerate(bits))):
            depth = 0
            while True:
                depth += {"{": 1, "}": -1}.get(tokens[start], 0)
                start += 1
                if depth == 0:
                    break
    end = tokens.index("}", start)
    side = round((end - start - 1) ** (1.0 / len(place)))
    index = 0
    for x in place:
        index = index * side + int(x * scale % 1.0 * side)
    return float(tokens[start + 1 + index])


def test_a_lobe_straight_through_is_written_in_finer_cells():
    random = np.random.default_rng(2)
    scattered, straight = random.random((16, 16)), random.random(256)
    square = Square.of(2)
    values = scattered + np.diag(square.means(straight) * 16 / np.pi)
    plain, sharp = tree_text(values, square), tree_text(values, square, straight)
    for _ in range(200):
        light, out = random.random((2, 2))
        out = light + (out - 0.5) / 32.0 if random.random() < 0.5 else out
        if not ((out > 0.0) & (out < 1.0)).all():
            continue
        (coarse_in, coarse_out), (fine_in, fine_out) = (
            [int(x * side) * side + int(y * side) for x, y in (light, out)] for side in (4, 16)
        )
        assert value_at(plain, [*light, *out]) == pytest.approx(values[coarse_out, coarse_in], rel=1e-4)
        expected = scattered[coarse_out, coarse_in]
        if fine_in == fine_out:
            expected += straight[fine_in] * 256 / np.pi
        assert value_at(sharp, [*light, *out]) == pytest.approx(expected, rel=1e-4)


def test_klems_patches_have_the_light_of_a_tree():
    """Means over patches: of a tree of random cells the integral of all light, of a symmetric one the closed form."""
    square, straight = Square.of(3), np.full(1024, 0.2)
    values = np.random.default_rng(3).random((64, 64)) + np.diag(square.means(straight) * 64 / np.pi)
    size = KLEMS_FULL.projected_solid_angle
    block = read_tree("here", tree_text(values, square, straight), 4)
    assert size @ block @ size == pytest.approx(values.sum() * (np.pi / 64) ** 2, rel=1e-3)
    # Rank 3: sine^2 of the light times (2 + cosine of the azimuth between both).
    side = 32
    square = Square.of(5)
    out = square.directions(np.arange(1024), *np.full((2, 1024), 0.5))
    sine = 1.0 - 2.0 * (np.arange(side) + 0.5) / side
    grid = (sine**2)[:, None] * (2.0 + np.cos(np.arctan2(out[:, 1], out[:, 0])))
    block = read_tree("here", "{" + " ".join(f"{value:.6g}" for value in grid.ravel()) + "}", 3)
    middle = KLEMS_FULL.directions(np.arange(145), *np.full((2, 145), 0.5))
    turn = np.arctan2(middle[:, 1], middle[:, 0])
    expected = (1.0 - middle[:, 2] ** 2) * (2.0 + np.cos(turn[:, None] - turn))
    ring = slice(25, 133)  # patches between 15 and 75 degrees
    assert block[ring, ring] == pytest.approx(expected[ring, ring], abs=0.15)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("{1 2 3}", "values of a grid = 3: a power of 16"),
        ("{{1}{2}}", "branches of a tree = 2: 16 branches"),
        ("{{1}", "braces without a match"),
        ("1", "braces without a match"),
        ("{}", "values of a grid = 0"),
        ("{nan}", "not a finite number"),
        ("{x}", "could not convert string to float: 'x'"),
    ],
)
def test_a_broken_tree_is_one_sentence(text, part):
    with pytest.raises(BadInput, match=part):
        read_tree("here", text, 4)
