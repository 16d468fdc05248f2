import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.refusals import accepted, refusal
from weaves.errors import BadInput
from weaves.fabric import Fabric, load_fabric, preset_names
from weaves.population import Population
from weaves.validation import read_toml, validated

GOOD = load_fabric("twill_4_4").model_dump(mode="json")
LOOM = {"family": "loom", "tie_up": [[1, 0]], "treadling": [1]}

KNOWN = [*GOOD, *GOOD["warp"], *GOOD["draft"], "rows", "move", "satin", "loom", "wavelengths", "values", "#ffffff"]
words = st.one_of(st.text(max_size=8), st.sampled_from(KNOWN))
scalars = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), words, st.dates(), st.binary(max_size=3))
trees = st.recursive(
    scalars,
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(words, inner, max_size=4)),
    max_leaves=8,
)


def with_warp(**change):
    return {**GOOD, "warp": {**GOOD["warp"], **change}}


def counted(sett=None, **change):
    table = with_warp(**change)
    if "width" not in change:
        del table["warp"]["width"]
    return table | ({"sett": sett} if sett else {})


def with_draft(**draft):
    return {**GOOD, "draft": draft}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (with_warp(roughness=0), "warp.roughness = 0: Input should be greater than or equal to 0.01"),
        (with_warp(bend=float("nan")), "warp.bend = nan: Input should be a finite number"),
        (with_warp(bend="12"), "warp.bend = '12': Input should be a valid number"),
        (with_warp(rougness=0.2), "warp.rougness = 0.2: unknown key; did you mean 'roughness'?"),
        ({**GOOD, "wrap": {}}, "wrap = {}: unknown key; did you mean 'warp'?"),
        ({**GOOD, "warp": 3}, "warp = 3: a table is needed"),
        ({**GOOD, "name": "../x"}, "name = '../x': a name has 1 to 60 letters"),
        (with_draft(family="satin", ends=6, move=3), "draft.move = 3: a move shares no factor with the ends"),
        (with_draft(family="satn"), "draft.family = 'satn': did you mean 'satin'?"),
        (with_draft(family="satin", mov=2), "draft.mov = 2: unknown key; did you mean 'move'? known: ends, family"),
        (with_draft(ends=5), "draft.family is missing: it is required"),
        (with_draft(family="twill", over=2), "draft.under is missing: it is required"),
        (with_draft(family="matrix", rows=["#.", "#"]), "draft.rows = '#': rows of equal length"),
        (with_draft(**LOOM, threading=[3]), "draft.threading = [3]: numbers from 1 to 2 are needed"),
        (with_warp(diffuse="red"), "warp.diffuse = 'red': a colour is three numbers"),
        (with_warp(diffuse=[0.1, 0.2]), "warp.diffuse = [0.1, 0.2]: a colour is three numbers"),
        (with_warp(diffuse=[0.1, 0.2, 7]), "warp.diffuse.2 = 7: Input should be less than or equal to 1"),
        (with_warp(diffuse={"wavelengths": [400, 500], "value": [0, 1]}), "warp.diffuse.value = [0, 1]: unknown key; "
         "did you mean 'values'? known: values, wavelengths (one of 2 errors)"),
        ({**GOOD, "yarns_per_cm": [float("nan"), 20.0]}, "yarns_per_cm.0 = nan: Input should be a finite number"),
        (counted(tex=25), "warp.tex = 25: sett = [ends per cm, picks per cm] is needed with it"),
        (counted([30, 20], packing=0.5), "warp.packing = 0.5: give exactly one of tex and ne"),
        (counted([30, 20], tex=25, ne=20), "warp.tex = 25: give exactly one of tex and ne"),
        (counted([30, 20], tex=25, width=0.5), "warp.width = 0.5: follows from tex and sett"),
        (counted([30, 20], ne=-1), "warp.ne = -1: Input should be greater than or equal to 0.1"),
        (counted([30, "x"], tex=25), "sett.1 = 'x': Input should be a valid number"),
        (counted([30, 20], tex=250), "warp.tex = 250: at 30 ends per cm yarns of 0.591 mm have 1.77 of their spacing; "
         "with this count the sett may be from 0.846 to 16.9, or more with a larger packing"),
        (counted([30, 20], texx=25), "warp.texx = 25: unknown key; did you mean 'tex'?"),
        ({**GOOD, "sett": [30, 20], "yarns_per_cm": [30, 20]}, "sett = [30, 20]: yarns_per_cm states the same"),
        ({}, "name is missing: it is required (one of 4 errors)"),
    ],
)  # fmt: skip
def test_sentence(change, sentence):
    assert refusal(validated, Fabric, change, "cloth.toml").startswith(f"cloth.toml: {sentence}")


def test_other_models_complain_in_the_same_words():
    for table, words in (
        ({"twill": {"bend": [3, 99]}}, "twill.bend = [3, 99]: Input should be less"),
        ({"twill": {"ben": [3, 9]}}, "did you mean 'bend'"),
        ({"exclude": ["twil 4/4"]}, "called twill 4/4"),
    ):
        assert words in refusal(validated, Population, table, "random.toml")


@settings(max_examples=300)
@given(st.sampled_from([None, "warp", "draft", "weft"]), words, trees)
def test_any_single_change_of_a_good_fabric_is_a_fabric_or_one_sentence(table, key, tree):
    changed = {**GOOD, key: tree} if table is None else {**GOOD, table: {**GOOD[table], key: tree}}
    if fabric := accepted(validated, Fabric, changed, "cloth.toml"):
        assert fabric.weave.repeat


@settings(max_examples=200)
@given(st.one_of(st.text(), st.text(alphabet='ab=[]{}".#\n0123456789', max_size=60)))
def test_any_text_is_toml_or_one_sentence(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("any") / "cloth.toml"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    accepted(read_toml, path)


@given(st.text())
def test_any_name_is_a_preset_or_one_sentence(name):
    if fabric := accepted(load_fabric, name):
        assert fabric.name in preset_names()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b'name = "x"\n[warp\n', r"torn\.toml: broken TOML: .*at line 2"),
        (b"\xff\xfe", "not UTF-8"),
        (b"a = " + b"[" * 5000, "nested too deeply"),
        (b"a = 1" + b"0" * 5000, "broken TOML"),
    ],
)
def test_broken_files_are_refused(tmp_path, content, words):
    (tmp_path / "torn.toml").write_bytes(content)
    with pytest.raises(BadInput, match=words):
        load_fabric(tmp_path / "torn.toml")
