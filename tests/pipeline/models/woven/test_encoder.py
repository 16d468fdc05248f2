import numpy as np
import pytest
import torch

from pipeline.models.woven import WovenOptions
from pipeline.models.woven.encoder import read_cloth
from pipeline.models.woven.standard_position import standard as standard_of
from tests.pipeline.models.stand_ins import SMALL
from weaves.draft import Matrix
from weaves.fabric import load_fabric
from weaves.surface import surface_at

TWILL = load_fabric("cotton_twill")


def test_surface_parameters_and_what_is_blended_are_read_at_the_right_place():
    """Texel (row, column) is the point (u, v) = (column + 1/2, row + 1/2)/side of the repeat."""
    options = WovenOptions(map_texels=32, standard=False)
    maps, parameters, _ = read_cloth([TWILL], options)
    ends, picks = TWILL.weave.repeat
    point = surface_at(TWILL, np.array([(5 + 0.5) / 32 * ends]), np.array([(20 + 0.5) / 32 * picks]))
    np.testing.assert_allclose(maps[0, :3, 20, 5], point.normal[0], atol=1e-6)
    np.testing.assert_allclose(maps[0, 3:, 20, 5], point.tangent[0], atol=1e-6)
    expected = [TWILL.warp.roughness, TWILL.weft.roughness, TWILL.warp.relief, TWILL.weft.relief]
    np.testing.assert_allclose(parameters[0], expected, rtol=1e-6)
    # Plain weave has many standard positions, and the yarns choose: both fabrics take the first one's. With the
    # yarns exchanged, second = the first seen through the mirror x = y, whose own standard position is the same;
    # in the first one's position it is another cloth.
    plain = load_fabric("polyester_lining")
    exchanged = plain.model_copy(update={"warp": plain.weft, "weft": plain.warp})
    alone = [read_cloth([fabric], SMALL["woven"]) for fabric in (plain, exchanged)]
    assert alone[0].placement.exchange.item() != alone[1].placement.exchange.item()
    together = read_cloth([plain, exchanged], SMALL["woven"], like=plain)
    for part in together.placement:
        assert torch.equal(part[0], part[1])
    torch.testing.assert_close(together.maps[:1], alone[0].maps)
    torch.testing.assert_close(together.parameters[1], alone[0].parameters[0][[1, 0, 3, 2]])


@pytest.mark.parametrize("standard", [False, True])
def test_cloth_begun_elsewhere_is_the_cloth_with_its_draft_rolled(standard):
    """One end and three picks of four, 4 and 12 texels of 16: the maps of the rolled drawdown, the same point seen."""
    options = SMALL["woven"].model_copy(update={"standard": standard})
    cloth = read_cloth([TWILL], options)
    begun = cloth.begun(np.array([[1 / 4, 3 / 4]]))
    seen = standard_of(TWILL)[0] if standard else TWILL
    rolled = seen.model_copy(update={"draft": Matrix(rows=tuple(seen.weave.rolled(1, 3).rows()))})
    plain = options.model_copy(update={"standard": False})
    np.testing.assert_allclose(begun.maps, read_cloth([rolled], plain).maps, atol=1e-6)

    # A query lies on the same texel of the maps before and after.
    u, v = torch.tensor([[0.3]]), torch.tensor([[0.9]])
    before, after = (one.placement.move(u, v) for one in (cloth, begun))
    assert after[0].item() == pytest.approx((before[0].item() + 1 / 4) % 1, abs=1e-6)
    assert after[1].item() == pytest.approx((before[1].item() + 3 / 4) % 1, abs=1e-6)
