"""Views of cloth and Mitsuba scenes as queries, and queries as pictures."""
