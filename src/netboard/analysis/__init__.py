"""From recordings to results: measures, extraction, statistics, figures and the report.

Start with `measures`: pure functions of arrays, one for each measure of the paper and of later work. `extraction`
applies them to recordings and builds tables. `statistics` has the models and tests, and `results` the numbers to
report; `figures` and `report` present them. This package knows no device, no socket and no window.
"""
