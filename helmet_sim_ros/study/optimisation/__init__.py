"""Optimisation: a study file with objectives becomes a search for better helmet designs."""
