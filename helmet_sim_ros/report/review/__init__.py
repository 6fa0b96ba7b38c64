"""What logs say: checked against their samples, and compared with each other."""
