"""The report of a study, and the folder of an analysis."""
