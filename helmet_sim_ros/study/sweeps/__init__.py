"""Sweeps: a study file becomes rows, engines compute them, a folder keeps the results."""
