"""How tasks are executed: ledger, executor, progress, and the functions that do the work."""
