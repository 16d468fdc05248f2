"""Woven cloth in Mitsuba 3: importing this enters the BSDF `twillight` and the integrator `twillight_path`.

    import mitsuba as mi
    import twillight_mitsuba

    cloth = {"type": "twillight", "fabric": "denim", "yarns": 400.0}

Import it at any time: with a variant set, that one is used; without one, the fastest that works is set. How to use it:
docs/mitsuba.md. Properties: `pipeline.mitsuba.worn` and `pipeline.mitsuba.integrator`.
"""

from jobs.terminal import tracked
from pipeline.mitsuba import integrator
from pipeline.mitsuba.integrator import evaluated
from pipeline.mitsuba.register import register

__all__ = ["evaluated"]

integrator.tracked = tracked
register()
