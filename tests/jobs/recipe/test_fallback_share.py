import numpy as np
import pytest

from jobs.recipe.fallback_share import fallback_share
from jobs.recipe.load import load_recipe
from pipeline.models.domain import Domain
from pipeline.models.fallback import Fallback
from pipeline.shards.queries import QueryOptions, draw_queries
from weaves.fabric import load_fabric

QUICK = load_recipe("quick")
MODELS = {model.options.name: model for model in QUICK.models}
OPTIONS = QueryOptions(behind=0.3, stretch=4.0, sigma=(0.02, 20.0))


def asked(*names, options=OPTIONS):
    return [(load_fabric(name), draw_queries(options, (4, 4), 1, 0, 2000)) for name in names]


@pytest.mark.parametrize(
    ("model", "fabrics", "share"),
    [
        ("woven", ["denim"], 0.30 + 0.70 * 0.12),
        ("woven", ["voile"], 1.0),  # open cloth, and it saw solid cloth alone
        ("woven", ["denim", "voile"], 0.69),
        ("neumip", ["denim"], 0.30 + 0.70 * 0.12),
        ("neumip", ["twill_4_4"], 0.30 + 0.70 * 0.12),  # unseen by general models, and trained on by this one
        ("neumip", ["voile"], 1.0),
        ("selvage", ["denim", "voile"], 0.0),
        ("soft_nodes", ["voile"], 0.0),
        ("prefiltered", ["voile"], 0.30),  # nothing is trained: only light from behind
        ("point_sampled", ["voile"], 0.0),
    ],
)
def test_shares(model, fabrics, share):
    """Light from behind, 30 %; sizes below .0439 of log-uniform ones between .02 and 20, 11.4 %; or all."""
    assert fallback_share(MODELS[model], QUICK, asked(*fabrics)) == pytest.approx(share, abs=0.03)


def test_it_is_what_the_model_itself_will_leave_whichever_recipe_trains_it():
    trade = load_recipe("trade")
    shares = {model.options.name: fallback_share(model, trade, asked("voile")) for model in trade.models}
    assert shares["woven"] == 1.0 and 0.0 < shares["woven_transmission"] < 0.3

    class Trained:
        name = setting = ""
        domain = Domain.of(QUICK.dataset.model_dump(mode="json"), QUICK.seen + QUICK.population)

    (pair,) = asked("denim")
    method = Fallback(Trained(), MODELS["woven"].options.kinds)
    assert fallback_share(MODELS["woven"], QUICK, [pair]) == np.mean(method.out_of_domain(*pair))
