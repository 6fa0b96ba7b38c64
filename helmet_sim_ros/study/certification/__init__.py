"""Certification: protocols of test houses as data, and whole campaigns of their impacts."""
