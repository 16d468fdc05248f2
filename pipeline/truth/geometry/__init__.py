"""The surface of one repeat and what hides what: heightfield, visibility (shadows, masking), horizon, opacity.

pieces and symmetry cut a repeat into what differs; gloss varies the specular colour from float to float.
"""
