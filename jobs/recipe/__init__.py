"""Recipes: TOML in, a frozen Recipe out; every key is checked here."""
