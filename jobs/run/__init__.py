"""Execution of tasks: kernels compiled first, executor, ledger, manifest, progress."""
