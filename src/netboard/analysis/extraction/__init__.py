"""Tables of measures from recordings: settings, exclusions, processes, caches."""
