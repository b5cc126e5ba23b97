"""The figures of a study and of one trial."""
