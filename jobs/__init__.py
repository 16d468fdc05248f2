"""When and where it runs: recipes, plans, the ledger, execution and the command line."""
