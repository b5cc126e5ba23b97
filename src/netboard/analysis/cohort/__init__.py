"""Cohorts of virtual studies with simulated participants, and the power of a study's contrasts and models in them."""
