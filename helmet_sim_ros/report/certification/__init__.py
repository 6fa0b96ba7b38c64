"""What a certification campaign found, to hand to somebody: CSV, JSON and an HTML page."""
