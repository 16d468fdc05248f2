"""Names of earlier versions: every one is refused, and its replacement is a name that exists."""

import pytest
from pydantic import BaseModel, ConfigDict, Field

from weaves.errors import BadInput, nearest
from weaves.renamed import KEY, RENAMED, replacement
from weaves.validation import validated


class Choice(BaseModel):
    model_config = ConfigDict(extra="forbid")
    size: int = Field(default=1)


def test_a_name_that_never_changed_has_no_replacement():
    assert replacement("model", "woven") == "" and replacement("no such kind", "table") == ""


def test_one_old_name_of_two_kinds_has_two_replacements():
    assert replacement("estimator", "table") == "'table' is now 'node_table'"
    assert replacement("scene", "table") == "'table' is now 'dinner_table'"


def test_an_old_name_is_not_corrected_as_if_it_were_misspelt():
    assert nearest("sums", ["soft_nodes", "sumo"], "model") == "'sums' is now 'soft_nodes'"
    assert nearest("sums", ["soft_nodes", "sumo"]).startswith("did you mean 'sumo'?")


@pytest.mark.parametrize("value", [["table"], 3, None, {"table": 1}])
def test_values_that_are_no_names_are_left_to_other_checks(value):
    assert replacement("estimator", value) == ""


def test_a_renamed_key_is_refused_with_the_new_one(monkeypatch):
    monkeypatch.setitem(RENAMED[KEY], "width", "size")
    with pytest.raises(BadInput) as refused:
        validated(Choice, {"width": 3}, "a.toml")
    assert str(refused.value) == "a.toml: width = 3: unknown key; 'width' is now 'size'"
