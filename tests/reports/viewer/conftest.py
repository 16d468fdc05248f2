"""Pages of the viewer, small and whole, and the whole one in a browser."""

import pytest

from reports.viewer import view as module
from reports.viewer.view import content, whole_page
from tests.browser import opened
from weaves.fabric import load_fabric

FABRIC = "gingham"
SIZE = 24
"""Pixels along each side of the pictures of the truth."""


def shown_of(truth, levels, bends, still, name=FABRIC):
    """Return what the page has of a fabric at its own width, with pictures of the truth of `truth` pixels."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "DETAILS", levels)
        patch.setattr(module, "BEND_FACTORS", bends)
        patch.setattr(module, "NARROWER", (1.0,))
        patch.setattr(module, "STILL_SIZE", still)
        return content(load_fabric(name), truth)


def viewer(shown, folder, **how):
    """Return the page of a content, written to a folder, in a browser; `how` as for `Page.open`."""
    path = folder / "gingham.html"
    path.write_text(whole_page(shown), encoding="utf-8")
    ready = "/full|still/.test(document.body?.className)"
    return opened(path.as_uri(), folder / "profile", ready=ready, **how)


@pytest.fixture(scope="session")
def small():
    """What a small page has: one table, no truth."""
    return shown_of(0, (2,), (1.0,), 32)


@pytest.fixture(scope="session")
def whole():
    """What the page has: all levels, two bends, pictures of the truth."""
    return shown_of(SIZE, module.DETAILS, (1.0, 1.4), module.STILL_SIZE)


@pytest.fixture(scope="session")
def page(whole, tmp_path_factory):
    with viewer(whole, tmp_path_factory.mktemp("viewer")) as own:
        yield own


@pytest.fixture
def fresh(page):
    """The page as it was when it was opened."""
    page.run("viewer.reset(), viewer.drawn")
    return page
