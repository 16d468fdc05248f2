"""Scattering at one point of a yarn: slab (a layer of microflakes), point (with visibility).

thread_colours sums points by the colours of their threads.
"""
