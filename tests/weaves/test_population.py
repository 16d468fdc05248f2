from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from weaves.draft import cells
from weaves.fabric import Fabric
from weaves.families import Herringbone, Twill
from weaves.population import FamilyName, Population, Ranges, population_fabrics

RANGES = ("plain", "twill", "satin", "irregular")
UNSEEN: tuple[FamilyName, ...] = ("compound_twill", "large_satin", "irregular")
NARROW = dict.fromkeys(RANGES, Ranges(width=(0.6, 0.9)))
SEEDS = st.integers(0, 2**63 - 1)


def test_fabric_i_depends_on_seed_and_i_alone_and_is_known():
    """A change of the known value changes every data set: raise the VERSION of the shards with it."""
    few, many = (population_fabrics(Population(count=count, seed=5)) for count in (4, 12))
    assert many[:4] == few and population_fabrics(Population(count=4, seed=6)) != few
    assert [fabric.name for fabric in few] == ["random_000", "random_001", "random_002", "random_003"]
    fabric = population_fabrics(Population(count=1, seed=3))[0]
    assert fabric.source == "Drawn from seed 3: plain, begun 1 ends and 1 picks further."
    assert tuple(fabric.warp.optics().values()) == (1.0, 39.383086, 0.0, 0.129511, 1.062292, 0.5)


def test_excluded_drafts_do_not_occur_in_any_disguise():
    """Of 200 twills some are 4/4, straight, broken or herringbone (checked); with the exclusion, none."""
    four = {"over": 4, "under": 4}
    weaves = (Twill(**four), Twill(family="broken_twill", **four), Herringbone(**four))
    banned = {weave.build().canonical() for weave in weaves}
    families: tuple[FamilyName, ...] = ("twill", "broken_twill", "herringbone")

    def occurs(exclude):
        fabrics = population_fabrics(Population(count=200, seed=1, families=families, exclude=exclude))
        return any(fabric.weave.canonical() in banned for fabric in fabrics)

    assert occurs(()) and not occurs(("twill 4/4",))


@pytest.mark.parametrize("family", get_args(FamilyName))
def test_numbers_lie_in_their_ranges(family):
    shared = {"relief": (0.5, 0.6), "width": (0.8, 0.9), "bend": (7, 9), "twist": (5, 6), "blend": (0.2, 0.3)}
    ranges = Ranges(roughness_warp=(0.1, 0.2), roughness_weft=(0.3, 0.4), optical_thickness=(0.1, 4.0), **shared)
    population = Population(count=20, seed=2, families=(family,), **dict.fromkeys(RANGES, ranges))
    for fabric in population_fabrics(population):
        assert Fabric.model_validate(fabric.model_dump()) == fabric and max(fabric.weave.repeat) <= 16
        for yarn, roughness in ((fabric.warp, (0.1, 0.2)), (fabric.weft, (0.3, 0.4))):
            for key, (low, high) in (shared | {"roughness": roughness}).items():
                assert low <= getattr(yarn, key) <= high
        assert fabric.warp.bend != fabric.weft.bend and fabric.warp.twist == fabric.weft.twist
        assert 0.1 <= fabric.optical_thickness <= 4.0 and fabric.warp.blend == fabric.weft.blend


def test_square_roots_of_roughness_are_uniform_and_families_equally_likely():
    """Mean of U(0.1, 0.7): 0.4; standard error of 400 draws 0.0087; four of them are allowed."""
    fabrics = population_fabrics(Population(count=400, seed=9, families=("plain",)))
    roots = np.sqrt([fabric.warp.roughness for fabric in fabrics])
    assert abs(roots.mean() - 0.4) < 0.035 and roots.min() >= 0.1 and roots.max() <= 0.7
    fabrics = population_fabrics(Population(count=400, seed=4, families=("plain", "satin")))
    plain = sum(fabric.weave.repeat == (2, 2) for fabric in fabrics)
    assert abs(plain - 200) < 40
    with pytest.raises(ValueError, match="at least one draft must remain"):
        Population(count=1, families=("plain",), exclude=("plain",))


def test_a_share_of_solid_cloth_changes_nothing_but_widths():
    """A binomial test at .1 % on the share; all else is as without it."""
    loose, mixed = (Population(count=200, seed=3, solid=solid, **NARROW) for solid in (0.0, 0.4))
    pairs = list(zip(population_fabrics(loose), population_fabrics(mixed), strict=True))
    solid = [b for _, b in pairs if b.warp.width == b.weft.width == 1.0]
    assert stats.binomtest(len(solid), 200, 0.4).pvalue > 1e-3
    for a, b in pairs:
        same = [y.model_copy(update={"width": x.width}) for x, y in ((a.warp, b.warp), (a.weft, b.weft))]
        assert b.model_copy(update=dict(zip(("warp", "weft"), same, strict=True))) == a


@settings(max_examples=40)
@given(seed=SEEDS)
def test_irregular_cloth_hangs_together_and_has_short_floats(seed):
    for fabric in population_fabrics(Population(count=2, seed=seed, families=("irregular",))):
        over = fabric.weave.warp_over
        assert min(over.shape) >= 4 and max(over.shape) <= 8
        for axis in (0, 1):  # every end and every pick interlaces
            assert over.any(axis=axis).all() and not over.all(axis=axis).any()
        floats = cells(fabric.weave)
        assert max(floats.top_length.max(), floats.under_length.max()) <= 4 and fabric.weave.hangs_together()


@settings(max_examples=20)
@given(seed=SEEDS, other=SEEDS)
def test_drafts_for_unseen_cloth_are_in_no_population_of_the_default_families(seed, other):
    """Also with shifts and mirror images: `canonical` is equal for them."""
    populations = Population(count=6, seed=seed, families=UNSEEN), Population(count=40, seed=other)
    unseen, trained = ({fabric.weave.canonical() for fabric in population_fabrics(p)} for p in populations)
    assert not unseen & trained


@pytest.mark.parametrize(("solid", "expected"), [(0.5, 2), (0.25, 1), (1.0, 4), (0.0, 0)])
def test_a_balanced_population_has_every_family_and_the_share_of_solid_cloth_in_each(solid, expected):
    """Sixteen fabrics of four families: four each, of which 4 * solid are solid."""
    population = Population(count=16, seed=8, families=("plain", *UNSEEN), balanced=True, solid=solid, **NARROW)
    fabrics = population_fabrics(population, "cloth_{index}_{family}")
    for place, family in enumerate(population.families):
        own = fabrics[place::4]
        assert [fabric.name for fabric in own] == [f"cloth_{place + 4 * turn}_{family}" for turn in range(4)]
        assert sum(fabric.warp.width == fabric.weft.width == 1.0 for fabric in own) == expected
    assert {fabric.weave.repeat for fabric in fabrics[::4]} == {(2, 2)}
