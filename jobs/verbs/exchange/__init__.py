"""Verbs that exchange fabrics with other programs: `import`, `export`, and `view`, whose page browsers open."""
