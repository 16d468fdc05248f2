"""`curved`: a neural material for curved surfaces [Kuznetsov2022Curved]."""
