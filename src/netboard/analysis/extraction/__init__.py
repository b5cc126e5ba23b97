"""Extraction of tables of measures from recordings: settings, exclusions, worker processes, caches."""
