"""How setups, records and evaluations look in a notebook: tables, figures, HTML.

What draws is imported when something is drawn; the classes themselves stay light.
"""
