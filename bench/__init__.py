"""Measurements and attacks, run from a checkout: ``python bench/bench_log.py``,
``python -m bench.campaign``."""
