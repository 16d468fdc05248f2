"""Scattering at one point of a yarn: microflake (flakes), slab (a layer of flakes), point (with visibility).

thread_colours sums points by the colours of their threads.
"""
