"""Fits simulated participants to results of people by simulation-based inference, and checks the fit.

Start with `fit`, the whole of it. `priors` declares what is fitted and what was known before, `summaries` the numbers
of people that it is fitted to and the same of simulated participants, `emulator` the regression that stands for the
simulation, `sampling` the posterior, `tables` the results. `cohort.posterior` is the result, from which cohorts draw
participants.
"""
