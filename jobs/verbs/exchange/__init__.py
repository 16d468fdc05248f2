"""Verbs that exchange fabrics with other programs: `import` and `export`."""
