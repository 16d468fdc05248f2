"""Verbs of the command line; related verbs share a file."""
