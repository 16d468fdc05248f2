"""How good, how fast, how stable: measurements, Records and the page."""
