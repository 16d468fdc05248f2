"""How numba is used; nothing here knows of cloth.

decorators: how kernels are compiled and cached. reproducible: the patches of numba that make compiled code a function
of its sources. float32: exponential, arcsine and normal distribution in single precision. arrays: types of arrays.
"""
