"""The estimator `quadrature`: adaptive Gauss-Legendre rules, cut at shadow edges; the reference of references."""
