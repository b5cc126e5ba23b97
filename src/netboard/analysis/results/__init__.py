"""The results of a study: levels, contrasts and models of each topic, as one tidy table."""
