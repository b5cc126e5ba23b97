"""Where methods and velocity estimators hold, and where they fail."""
