"""The page of a recipe: page, its figures, and what they look like (style)."""
