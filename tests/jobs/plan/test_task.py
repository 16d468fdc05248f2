import json
from typing import ClassVar

import pytest

from jobs.plan.task import Coloured, Made, Place, Task, Uncoloured
from weaves.fabric import load_fabric


class Example(Task):
    stage: ClassVar = "train"

    x: float
    folder: Place = ""
    network: Made = Made(task="0123", path="models/a")
    version: Place = "1"

    def versions(self):
        return {"example": int(self.version)}


class Twin(Example):
    stage: ClassVar = "bench"


class Shown(Task):
    stage: ClassVar = "bench"
    fabric: Coloured

    def versions(self):
        return {}


class Measured(Shown):
    fabric: Uncoloured


def test_stage_versions_and_every_field_but_places_make_the_identity():
    one, two = Example(x=1, folder="a"), Example(x=1, folder="b", network=Made(task="0123", path="models/b"))
    assert one.id == two.id and "models/a" not in json.dumps(one.identity())
    assert one.id != Example(x=1, network=Made(task="4567", path="models/a")).id
    one = Example(x=1)
    assert one.id not in {Twin(x=1).id, Example(x=2).id, Example(x=1, version="2").id}


@pytest.mark.parametrize(("kind", "changes"), [(Shown, True), (Measured, False)])
def test_colours_are_part_of_an_identity_where_they_shape_the_result(kind, changes):
    fabric = load_fabric("denim")
    blue = fabric.model_copy(update={"warp": fabric.warp.model_copy(update={"diffuse": (0.0, 0.0, 0.7)})})
    assert (kind(fabric=blue).id != kind(fabric=fabric).id) == changes
    elsewhere = fabric.model_copy(update={"source": "another book"})
    assert kind(fabric=elsewhere).id == kind(fabric=fabric).id
    thick = fabric.model_copy(update={"optical_thickness": 3.0})
    assert kind(fabric=thick).id != kind(fabric=fabric).id
