"""How one point of a yarn scatters light: microflake (flakes), slab (a layer of flakes), point (with visibility)."""
