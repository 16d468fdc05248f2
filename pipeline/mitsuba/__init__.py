"""Cloth in Mitsuba 3: the BSDF `twillight`, which any method answers, and the integrator `twillight_path`.

options: properties of the BSDF. footprint: what a ray sees of the cloth. worn: cloth with its place in uv, in NumPy.
columns: arrays of Mitsuba's variants as NumPy arrays and back. bsdf, integrator and its path: the two plugins.
evaluated: how Mitsuba must compute. register: enters the plugins. dress: shipped scenes wear them. For users:
`import twillight_mitsuba`. How scenes become pictures without Mitsuba's integrators is in pipeline.scenes.
"""
