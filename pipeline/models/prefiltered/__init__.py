"""`prefiltered`: averaged normals and one evaluation of the point model, without shadows."""
