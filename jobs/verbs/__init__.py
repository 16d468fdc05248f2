"""Verbs of the command line, like ones in one file."""
