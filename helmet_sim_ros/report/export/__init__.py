"""Logs for other programs: CSV, Parquet and ISO-MME."""
