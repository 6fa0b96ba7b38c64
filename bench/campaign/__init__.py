"""Attacks on purpose, counted: ``python -m bench.campaign [--long] [--only NAME] [--seed S]``.

One module per attack, each with one class after :class:`bench.campaign.attack.Attack`;
``__main__.py`` lists them. What is promised, and the table of a long run: ``docs/reliability.md``.
"""
