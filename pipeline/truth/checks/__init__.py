"""Checks of physical invariants on any fabric: invariants, and check_result for the result of each."""
