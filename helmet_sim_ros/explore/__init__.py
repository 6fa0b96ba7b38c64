"""The explorer in the browser: turn a slider and see the head's answer at once.

:mod:`.session` and what it uses know no browser; :mod:`.page` and its panels draw it with viser.
"""
