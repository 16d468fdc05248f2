"""Cloth in Mitsuba 3: the BSDF `twillight`, which any method answers, and the integrator `twillight_path`.

worn: cloth with its place in uv and its footprints, in NumPy. bsdf and integrator: the two plugins. register: enters
the plugins, and lets shipped scenes wear cloth. For users: `import twillight_mitsuba`. How scenes become pictures
without Mitsuba's integrators is in pipeline.scenes.
"""
