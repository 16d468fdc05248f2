"""Recipes: TOML in, a frozen Recipe out; every key is checked here.

recipe has the keys with their types and ranges, validation checks the sections against each other, load reads a file
and what it names, shipped names those of the package, trained_by resolves models of other recipes. fallback_share
predicts a method's share in a scene.
"""
