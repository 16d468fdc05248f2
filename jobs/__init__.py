"""Recipes, the plans of their tasks, execution with a ledger, and the command line."""
