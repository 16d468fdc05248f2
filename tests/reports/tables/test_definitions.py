"""Every column of the tables of scenes and of errors is defined on the page."""

from reports.tables.definitions import definitions
from reports.tables.scene_rows import COLUMNS


def test_every_column_of_a_scene_is_defined():
    for column in COLUMNS:
        title = column.title.replace("\u00a0", " ").partition(",")[0]
        assert title in definitions(), title
    assert {"in the noise", "noise of the truth", "front", "bytes stored"} <= set(definitions())
