import itertools

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from reports.page.colours import LIGHT
from reports.page.figures import new_figure
from reports.page.labels import CLEARANCE, MARK, UNJOINED, Label, place_labels


@pytest.fixture(scope="module")
def drawn():
    """Five methods of nearly one time and error, each with two labelled ends, a few pixels apart.

    The figure as it is written, its labels and the boxes of their letters.
    """
    figure, panels = new_figure(8.6, 4.5, 2, sharey=True)
    labels = []
    for axes in panels:
        for index in range(5):
            x, y = [2.0 + 0.05 * index, 2.6 + 0.03 * index], [0.03 + 0.0004 * index, 0.0302 + 0.0004 * index]
            axes.plot(x, y, marker="o", markersize=7)
            for text, *at in zip(("bounded", "unbounded"), x, y, strict=True):
                labels.append(Label(axes, text, *at, LIGHT.ink))
        axes.plot([1.0, 10.0], [0.5, 0.02], marker="s")
        axes.set(xscale="log", yscale="log")
    texts, canvas = place_labels(figure, labels, LIGHT), FigureCanvasAgg(figure)
    canvas.draw()
    return figure, texts, [Text.get_window_extent(text, canvas.get_renderer()) for text in texts]


def test_no_label_covers_another_or_a_mark_and_those_far_off_are_joined_to_theirs(drawn):
    figure, texts, boxes = drawn
    assert len(boxes) == 20 and not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))
    half = MARK * figure.dpi / 72
    for text, box in zip(texts, boxes, strict=True):
        panel = text.axes.bbox
        assert panel.x0 <= box.x0 and box.x1 <= panel.x1 and panel.y0 <= box.y0 and box.y1 <= panel.y1
        for line in text.axes.lines:
            for x, y in text.axes.transData.transform(line.get_xydata()):
                away = max(box.x0 - x, x - box.x1, box.y0 - y, y - box.y1)
                assert away >= half - 1e-6
    # A label without a line touches the ring of `UNJOINED` points round its mark.
    joined = [text.arrow_patch.get_visible() for text in texts]
    assert any(joined) and not all(joined)
    for text, box, line in zip(texts, boxes, joined, strict=True):
        x, y = text.axes.transData.transform(text.xy)
        gap = np.hypot(x - np.clip(x, box.x0, box.x1), y - np.clip(y, box.y0, box.y1))
        assert line or gap <= 1.5 * (UNJOINED + CLEARANCE) * figure.dpi / 72
