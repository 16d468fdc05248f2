"""`unified_btf`: one encoding of bidirectional textures for all fabrics [Rainer2020Unified]."""
