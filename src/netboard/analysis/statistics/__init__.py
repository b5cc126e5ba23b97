"""Models, tests, confidence intervals and effect sizes for few dyads.

Arguments that differ in length, or lie outside the described range, raise a ValueError.

Arguments that mean the same in all modules are described here, and in a function only where they differ:

Parameters
----------
values : array_like, shape (n,)
    One value for each unit; NaN are ignored [any].
first, second : array_like, shape (n,) and (m,)
    One value for each unit of two groups; NaN are ignored [any].
response : ndarray of float64, shape (n,)
    Response of each trial; counts, or 0 and 1, for Firth's likelihood [any].
columns : ndarray of float64, shape (n, k)
    Columns of the fixed effects, linearly independent [any].
family : str or statsmodels family
    Distribution of the response, with its canonical link.
design : Design
    Trials of a study with their factors; a model's columns and values.
fit : Specification
    Name, equation, assumptions and kind of interval of the model.
coefficients : ndarray of float64, shape (k,)
    Coefficient of each column [log of the response].
covariance : ndarray of float64, shape (k, k)
    Covariance of the coefficients; NaN if unknown [square of the log of the response].
error : float
    Standard error [log of the response].
free : float
    Degrees of freedom [1].
p : float
    p value of the null hypothesis of no effect [1].
n : int
    Number of dyads [1].
moments : Moments or None
    Moments of a mixed model, for small-sample inference.
notes : tuple of str
    Problems and omissions.
why : str
    Reason for a missing fit.
contrast : ndarray of float64, shape (k,)
    Linear combination of the coefficients [1].
dyads, performers : array_like, shape (n,)
    Dyad and performer labels of each trial, of any type. The performer is a participant, or the dyad as one.
factors : sequence of Factor
    Fixed factors of the study, such as `netboard.analysis.statistics.factors.paper_factors`.
order : array_like, shape (n,)
    Position of each trial in its condition, 1 or more [1].
level : float
    Confidence level [1].
interval : Interval
    ``t``: Student's t with the degrees of freedom of `between_dyad_freedom`. ``z``: the normal distribution, whose
    intervals are too short for few dyads.
unit : str
    Name of the unit of replication.
rng : numpy.random.Generator or None
    Random generator; a permutation test needs it only if there are more than `MAX_EXACT` arrangements.
differences : array_like, shape (n,)
    One difference for each unit; NaN are ignored [any].
alternative : Alternative
    Alternative hypothesis: ``two-sided``; ``greater``: differences tend to be positive, or the first mean is larger;
    ``less``: the opposite.
resamples : int
    Number of bootstrap resamples, or of random arrangements where not all can be evaluated [1].
method : Bootstrap
    ``percentile`` or ``basic``: percentiles of the bootstrap distribution, or reflected ones; ``BCa``: bias-corrected
    and accelerated (Efron, J. Am. Stat. Assoc. 82:171, 1987).
correction : Correction
    ``none``: d; ``hedges``: g, by multiplication of the estimate by the small-sample `hedges_factor`. The interval is
    the same: that of the true effect.
slopes : Slopes
    Random slopes. ``maximal``: of each factor, and product of two, by dyad and by performer, if it varies within them;
    and of a factor by dyad at one level of another, so that effects at two levels may vary differently. ``performer``,
    ``dyad``: of each factor that varies within performers, by dyad and performer or by dyad alone. ``none``: none.
    Without a slope the confidence interval of an effect that differs between dyads is too short.
name : str
    Name of the effect or contrast.
"""
