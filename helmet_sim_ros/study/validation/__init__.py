"""Validation: spring, foam, published values and the solver against each other."""
