"""`twillight export --shader`: models as one source for every shading language, with tables of a cloth.

*.slang is the source. soft_nodes, selvage and neumip return what a model writes, models chooses among them; constants,
tables and weights generate constants and buffers. languages runs slangc; golden makes queries with their answers;
descriptor says what is in the folder, training_domain of what it learnt; export_shader writes it.
"""
