"""Models as one source for every shading language, with tables of a cloth.

soft_nodes.slang is made of query, look, horizons, shade, fixed_nodes and view_lines; neumip.slang of perceptron;
importance draws directions; colours applies colours; evaluate and draw are entry points. soft_nodes.py and neumip.py
return what a model writes; tables and constants make buffers and constants, within limits. languages runs slangc;
golden makes queries with their answers; descriptor says what is in the folder; export_shader writes it.
"""
