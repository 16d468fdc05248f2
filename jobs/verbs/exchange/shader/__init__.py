"""`twillight export --shader`: soft nodes as one source for every shading language, with tables of a cloth.

soft_nodes.slang is the algorithm. constants and tables generate `layout.slang` and the buffers; languages runs slangc;
golden makes queries with their answers; descriptor says what is in the folder; export_shader writes it.
"""
