"""The HTML page of a recipe: page (what goes in), templates (its text), colours and marks, figures, strips of pictures.

`front_figures` draws errors against costs, `figures` the other plots, `plot_style` their look.
"""
