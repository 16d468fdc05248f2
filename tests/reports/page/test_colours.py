import pytest

from reports.page.colours import DARK, LIGHT, OF_TEXT, contrast, readable


def test_contrast_of_known_pairs_and_a_colour_that_can_be_read_stays():
    """Black on white is 21; #767676 is the lightest grey that passes 4.5 on white [Campbell2023WCAG]."""
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0, abs=1e-3) and contrast("#ffffff", "#ffffff") == 1.0
    assert contrast("#767676", "#ffffff") > 4.5 > contrast("#777777", "#ffffff")
    assert contrast("#123456", "#fedcba") == contrast("#fedcba", "#123456")
    assert readable("#3d55cc", "#ffffff", "#000000") == "#3d55cc"  # can be read
    assert readable("#ffffff", "#ffffff", "#000000") == "#737373"  # 11 of 20 steps to black


@pytest.mark.parametrize("scheme", [LIGHT, DARK], ids=lambda scheme: scheme.name)
def test_text_marks_and_the_focus_stand_out_on_every_ground(scheme):
    own = (*scheme.methods.values(), *scheme.others)
    for ground in (scheme.ground, scheme.card, scheme.tint):
        assert min(contrast(colour, ground) for colour in (scheme.ink, scheme.muted)) >= OF_TEXT
        assert min(contrast(colour, ground) for colour in (*own, scheme.focus)) >= 3.0
    assert min(contrast(scheme.text(colour), scheme.ground) for colour in own) >= OF_TEXT
