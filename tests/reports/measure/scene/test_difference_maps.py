import io

import matplotlib.image
import numpy as np
import pytest

from reports.images import tiles
from reports.images.exr import read_exr, write_exr
from reports.images.tiles import flip_tile, relative_tile
from reports.measure.scene.image_error import image_errors, relative_differences
from reports.record import Record

MASK = np.zeros((24, 32), dtype=bool)
MASK[2:22, 3:29] = True
TRUTH = np.where(MASK[..., None], np.linspace(0.1, 0.5, 32)[:, None] * [1.0, 0.7, 0.4], np.nan)
SIGN = np.where(np.arange(32) < 16, 1.3, 0.7)[None, :, None]


@pytest.fixture
def written(tmp_path):
    records, maps = image_errors(Record(method="bright"), SIGN * TRUTH, TRUTH, 0.01 * TRUTH, MASK)
    write_exr(tmp_path / "differences.exr", maps)
    return {record.metric: record.value for record in records}, read_exr(tmp_path / "differences.exr")


def test_maps_average_to_the_errors_tiles_are_red_where_bright_and_differences_signed_shares(written):
    errors, exr = written
    assert (exr.channels["lit"] == MASK).all()
    for name in ("flip_ldr", "flip_hdr", "delta_e", "ssim"):
        assert exr.channels[name][MASK].mean() == pytest.approx(errors[name], rel=1e-5)
    squares = exr.stack("relative.R", "relative.G", "relative.B")[MASK].astype(float) ** 2
    assert squares.mean() == pytest.approx(errors["mse_relative"] + errors["mse_relative_floor"], rel=1e-5)
    _, exr = written
    for tile in (relative_tile(exr), flip_tile(exr)):
        rgba = matplotlib.image.imread(io.BytesIO(tile), format="png")[:: tiles.SCALE, :: tiles.SCALE]
        assert ((rgba[..., 3] > 0) == MASK).all()
    rgba = matplotlib.image.imread(io.BytesIO(relative_tile(exr)), format="png")[:: tiles.SCALE, :: tiles.SCALE]
    assert (rgba[5:20, 5:14, 0] > rgba[5:20, 5:14, 2]).all() and (rgba[5:20, 18:27, 0] < rgba[5:20, 18:27, 2]).all()
    maps = relative_differences(SIGN * TRUTH, TRUTH, MASK, epsilon=1e-12)
    assert set(maps) == {f"relative.{name}" for name in "RGBY"}
    for plane in maps.values():
        assert plane[:, :16][MASK[:, :16]] == pytest.approx(0.3)
        assert plane[:, 16:][MASK[:, 16:]] == pytest.approx(-0.3) and (plane[~MASK] == 0).all()
