"""Views of cloth as queries, and queries as pictures."""
