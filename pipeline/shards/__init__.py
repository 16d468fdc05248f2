"""Queries and answers on disk: Parquet shards and the manifest that lists them."""
