import numpy as np
import pytest

from pipeline.truth.cloth import cloth_side, columns_of
from pipeline.truth.footprint.mixture import COARSE_LINE, FINE_LINE
from pipeline.truth.node_table.tables import NodeTable
from pipeline.truth.options import TruthOptions
from tests.pipeline.truth.cloths import drawn
from weaves.fabric import load_fabric

DENIM = load_fabric("denim")


def _table(line=FINE_LINE, nodes=32):
    return NodeTable(lambda cells: nodes, 4, line)


def _columns(rows=6):
    return columns_of(drawn(DENIM, 5, rows, sigma=(0.5, 32.0), max_angle=60.0))


def test_a_table_is_built_once_and_knows_neither_curved_cloth_nor_tiny_footprints():
    cloth, table = cloth_side(DENIM, TruthOptions()), _table(nodes=4)
    front = table.table(cloth, False)
    assert table.table(cloth, False) is front
    both = table.table(cloth, True)
    assert len(both.slope_behind) == 4
    assert table.table(cloth, False) is both
    columns = _columns()
    bent, narrow = np.where(np.arange(6) == 1, 0.1, 0.0), np.where(np.arange(6) == 4, 0.01, 1.0)
    changed = columns._replace(curvature=bent, sigma=np.ones(6), sigma_minor=narrow)
    found = _table().knows(cloth_side(DENIM, TruthOptions()), changed)
    np.testing.assert_array_equal(found, [True, False, True, True, False, True])
    # At 45 degrees an ellipse with axes a and b has the correlation (a^2 - b^2) / (a^2 + b^2).
    columns = _columns(2)._replace(angle=np.full(2, np.pi / 4), sigma=np.full(2, 50.0))
    cloth = cloth_side(DENIM, TruthOptions())
    for line in (COARSE_LINE, FINE_LINE):
        thin, thick = (50.0 * np.sqrt((1 - r) / (1 + r)) for r in (line.most + 1e-4, line.most - 1e-4))
        found = _table(line).knows(cloth, columns._replace(sigma_minor=np.array([thin, thick])))
        np.testing.assert_array_equal(found, [False, True])
    boxes = cloth_side(DENIM, TruthOptions(footprint="box"))
    assert not _table().knows(boxes, columns._replace(sigma_minor=np.full(2, 20.0))).any()


@pytest.mark.parametrize("options", [{"frame": "macro"}, {"shadows": False}], ids=str)
def test_other_models_than_the_default_are_unknown(options):
    assert _table().knows(cloth_side(DENIM, TruthOptions()), _columns()).all()
    assert not _table().knows(cloth_side(DENIM, TruthOptions(parallax=False, **options)), _columns()).any()
