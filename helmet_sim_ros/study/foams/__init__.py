"""Foams from a laboratory's compression tests."""
