"""A fabric from a measured BSDF: light straight through gives the geometry, what is scattered the optics of the yarns.

Each of `DRAFTS` has its own best geometry and optics. The draft is the one whose errors, in units of those of
laboratories, are least.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from pipeline.bsdf.klems import Scattering
from pipeline.compiled.arrays import Mask
from pipeline.fitting.fitted import DRAFTS, LEAST_THICKNESS, Fitted, Interval, cloth
from pipeline.fitting.predicted import predict
from pipeline.fitting.scattered import fit_optics, optics_numbers, with_colours
from pipeline.fitting.straight import SEARCHES, STRAIGHT_NOISE, Geometry, fit_geometry, geometry_numbers, straight_of
from weaves.errors import BadInput

_FITTED_AGAIN = 2  # drafts that more searches are for
_USUAL_BEND = 25.0
_WIDE = 0.6  # part of a number's range, beyond which the data are said not to determine it
_CLOSED = f"No light goes straight through: widths are 1, bends {_USUAL_BEND:g} degrees, reliefs 1."
_ASSUMED = [
    "A cloth and its mirror image count as one; fibres are not twisted; both yarns have one blend.",
    "Yarns are opaque to light straight through; colours are grey.",
]
_RANGES = {"bend": 60.0, "relief": 1.95, "roughness": 0.97, "blend": 1.0, "width": 0.9}


def fit_bsdf(
    scattering: Scattering,
    band: str,
    name: str,
    advance: Callable[[float], None],
    lights: Mask | None = None,
    drafts: Sequence[str] = tuple(DRAFTS),
    resamplings: int = 12,
) -> Fitted:
    """Fit a fabric of a name to a band of a BSDF; BadInput if nothing of it is known.

    `lights` (P,) are the patches of the light that are fitted, if not all. `advance` takes the share that is done.
    """
    known = known_lights(scattering, band)
    lights = known if lights is None else lights & known
    if not lights.any():
        raise BadInput(name, band, "nothing", "the BSDF of some directions of the light is needed")
    straight = straight_of(scattering, band, lights & (scattering.basis.ring > 0))
    least = 0.0 if straight.closed else -math.log(max(straight.share.min(), 1e-6))
    thickness, steps = max(LEAST_THICKNESS, least), len(drafts) + _FITTED_AGAIN * SEARCHES + 2
    geometries, optics, scores = {}, {}, {}

    def fit_draft(draft: str, searches: int) -> None:
        if straight.closed:
            fabric = cloth(draft, (1.0, 1.0), (_USUAL_BEND,) * 2, (1.0, 1.0))
            geometries[draft] = Geometry(fabric, 0.0, np.empty((0, 6)), np.empty(0))
        else:
            geometries[draft] = fit_geometry(scattering.basis, straight, draft, searches)
        fabric = geometries[draft].fabric.model_copy(update={"optical_thickness": thickness})
        optics[draft] = fit_optics(scattering, band, lights, fabric)
        scores[draft] = math.hypot(geometries[draft].error / STRAIGHT_NOISE, optics[draft].error)

    for number, draft in enumerate(drafts, 1):
        fit_draft(draft, 1)
        advance(number / steps)
    for number, draft in enumerate(_near(scores)[: 0 if straight.closed else _FITTED_AGAIN], 1):
        fit_draft(draft, SEARCHES)
        advance((len(drafts) + SEARCHES * number) / steps)
    best = _near(scores)[0]
    fit, numbers = optics[best], {} if straight.closed else geometry_numbers(geometries[best], len(straight.patches))
    colours, of_optics = optics_numbers(fit, resamplings)
    numbers |= of_optics | {"optical_thickness": Interval(thickness, least, 100.0)}
    fabric = with_colours(fit.scatterer.fabric, colours, fit.optics).model_copy(update={"name": name})
    errors = predict(fabric, scattering, band, lights).errors(scattering, band)
    advance(1.0)
    ranked = dict(sorted(scores.items(), key=lambda item: item[1]))
    assumed = [_CLOSED, *_ASSUMED] if straight.closed else _ASSUMED
    return Fitted(fabric, numbers, errors._asdict(), ranked, assumed, _unknown(numbers, ranked))


def known_lights(scattering: Scattering, band: str) -> Mask:
    """Return the patches of the light of which something is known, (P,)."""
    return np.asarray(np.isfinite(scattering.bands[band]).any(axis=(0, 1, 2)))


def _near(scores: dict[str, float]) -> list[str]:
    """Return the drafts whose scores are within a tenth of the least, which is first."""
    return [draft for draft in sorted(scores, key=scores.__getitem__) if scores[draft] <= 1.1 * min(scores.values())]


def _unknown(numbers: dict[str, Interval], drafts: dict[str, float]) -> list[str]:
    near = _near(drafts)
    wide = [
        f"{key} ({number.low:.3g} to {number.high:.3g})"
        for key, number in numbers.items()
        if number.high - number.low > _WIDE * _RANGES.get(key.rpartition(".")[2], math.inf)
    ]
    sentences = [f"Hardly determined: {', '.join(wide)}."] if wide else []
    sentences += [f"Drafts within a tenth of the best: {', '.join(near)}."] if len(near) > 1 else []
    return [*sentences, "The optical thickness has a lower bound only; right and left of a twill are one."]
