"""Models, tests, confidence intervals and effect sizes for few dyads.

Arguments that mean the same in all modules are described here, and in a function only where they differ:

Parameters
----------
design : Design
    Trials of a study with their factors; a model's columns and values.
fit : Specification
    Name, equation, assumptions and kind of interval of the model.
moments : Moments
    Moments of a mixed model, for small-sample inference.
contrast : ndarray of float64, shape (k,)
    Linear combination of the coefficients [1].
dyads, performers : array_like, shape (n,)
    Dyad and performer labels of each trial, of any type. The performer is a participant, or the dyad as one.
factors : sequence of Factor
    Fixed factors of the study, such as `netboard.analysis.statistics.factors.paper_factors`.
order : array_like, shape (n,)
    Position of each trial in its condition, from 1 [1].
level : float
    Confidence level [1].
interval : Interval
    ``t``: Student's t with the between-dyad degrees of freedom (`careful_freedom`). ``z``: the normal distribution,
    whose intervals are too short for few dyads.
unit : str
    Name of the unit of replication.
rng : numpy.random.Generator
    Random generator.
"""
