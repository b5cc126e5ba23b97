"""From recordings to tidy tables of measures: trials, movements of the board, paths, and how the paper was read."""
