"""Verbs of the benchmark that is entered with a file: its questions, and rounds drawn from a secret seed.

questions writes the held-out queries of a recipe, with everything that is known of their fabrics, and the form of an
entry. challenge makes a seed and, once it is revealed, the recipe of its round. Answers come in by `bench --answers`;
its board shows those that were measured.
"""
