"""Tests of physical invariants on any fabric: invariants, and check_result for what is said of each."""
