"""Studies of falls: what a head strike is measured by, and what many of them say together."""
