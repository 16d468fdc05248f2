"""Measurements of methods: errors, aliasing, time, energy, extremes; every function returns Records, none plots."""
