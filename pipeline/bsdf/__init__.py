"""Bidirectional scattering distribution functions of a whole cloth, between patches of directions.

klems: patches, and the function as matrices with its checks. tensor_tree: cells of several sizes. of_fabric: the
function of a fabric. files: XML of LBNL WINDOW, which Radiance and EnergyPlus read too, and measurements in Parquet.
"""
