"""What a model was not taught is refused, by name."""

import numpy as np
import pytest

from pipeline.models.domain import Domain
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.options import TruthOptions
from weaves.errors import BadInput
from weaves.fabric import load_fabric

FABRICS = [load_fabric("denim"), load_fabric("silk_charmeuse")]
PLAIN = Domain.of({}, FABRICS)
WIDE = QueryOptions(behind=0.5, stretch=4.0, curvature=(0.01, 0.2))


def asked(**options):
    return draw_queries(QueryOptions(**options), (4, 4), 1, 0, 32)


def test_what_was_taught_is_answered():
    PLAIN.refuse(asked(), "m")
    Domain.of({"queries": WIDE.model_dump()}, FABRICS).refuse(draw_queries(WIDE, (4, 4), 1, 0, 32), "m")
    PLAIN.refuse_fabric(FABRICS[0], "m")
    PLAIN.refuse_truth(TruthOptions(relative_error=0.1), "m")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"behind": 1.0}, r"32 rows; first row 0: wi.*model m was trained for light from the viewer's side only"),
        ({"stretch": 4.0}, r"sigma_minor.*round footprints"),
        ({"curvature": (0.1, 0.1)}, r"curvature.*0.1.*flat cloth"),
    ],
)
def test_other_kinds_of_queries_are_refused(options, message):
    with pytest.raises(BadInput, match=message):
        PLAIN.refuse(asked(**options), "m")


def test_a_viewer_behind_the_cloth_is_refused():
    queries = asked()
    queries.wo[3] *= np.float32(-1)
    with pytest.raises(BadInput, match=r"1 rows; first row 3: wo"):
        PLAIN.refuse(queries, "m")


def test_yarns_outside_the_trained_ranges_are_refused():
    fabric = FABRICS[0]
    rough = fabric.model_copy(update={"warp": fabric.warp.model_copy(update={"roughness": 0.9})})
    with pytest.raises(BadInput, match=r"denim: roughness = 0.9.*0.16 to 0.55"):
        PLAIN.refuse_fabric(rough, "m")


def test_other_physics_is_refused_naming_both():
    with pytest.raises(BadInput, match=r"truth: frame = 'macro'.*frame = 'ply'"):
        PLAIN.refuse_truth(TruthOptions(frame="macro"), "m")
