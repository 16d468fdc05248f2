"""`gauss_nodes`: Gauss-Legendre nodes on every piece of yarn, k across it."""
