"""Checks of physical invariants on any fabric: invariants."""
