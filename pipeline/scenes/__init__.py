"""Views of cloth and Mitsuba scenes as queries, and queries as pictures.

scene and catalogue: what a scene is, and scenes by name; shipped has those of the package. loading, variant, sources,
places, lights and rays read a Mitsuba scene; frame makes its G-buffers. gbuffer turns pixels into queries, shade
turns answers into colours, picture makes whole pictures, requirement collects the ranges of queries. views has the two
simple views of one fabric. The fallback that answers queries outside a model's domain is in pipeline.models.fallback.
"""
