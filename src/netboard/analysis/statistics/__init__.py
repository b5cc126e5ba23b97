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
level : float
    Confidence level [1].
unit : str
    Name of the unit of replication.
rng : numpy.random.Generator
    Random generator.
"""
