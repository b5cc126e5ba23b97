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
differences : array_like, shape (n,)
    One difference for each unit; NaN are ignored [any].
alternative : Alternative
    Alternative hypothesis: ``two-sided``; ``greater``: differences tend to be positive, or the first mean is larger;
    ``less``: the opposite.
resamples : int
    Number of bootstrap resamples, or of random arrangements where not all can be evaluated [1].
slopes : Slopes
    Random slopes: none, by dyad, or by dyad and performer, of each factor that varies within performers. Without
    them the confidence interval of an effect that differs between dyads is too short.
name : str
    Name of the effect or contrast.
"""
