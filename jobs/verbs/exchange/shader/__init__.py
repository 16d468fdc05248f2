"""`twillight export --shader`: soft nodes as one source for every shading language, with tables of a cloth.

soft_nodes.slang is the BSDF, made of query, horizons, shade, fixed_nodes and placed_nodes; importance.slang draws
directions; colours.slang applies colours; evaluate.slang and draw.slang are entry points. sides tabulates both sides
of a cloth; constants and tables generate `layout.slang` and the buffers; languages runs slangc; golden makes queries
with their answers; descriptor says what is in the folder; export_shader writes it.
"""
