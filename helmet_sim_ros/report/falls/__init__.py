"""Falls on paper: a page with a table of head strikes, and files that other verbs take."""
