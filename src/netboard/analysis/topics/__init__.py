"""The topics of a study: the results of each, as rows of one tidy table, and the figure that shows them.

Computing results does not load matplotlib; only the drawing functions do.
"""
