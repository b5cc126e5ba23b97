"""From recordings to results: measures, extraction, statistics, topics and the report.

Start with `measures`: pure functions of arrays, one for each measure of the paper and of later work. `extraction`
applies them to recordings and builds tables. `statistics` has the models and tests, and `topics` the results of each
topic with their figure; `report` presents them. `cohort` simulates virtual studies and computes the power of a study
from them; `inference` fits simulated participants to people. This package uses no devices, sockets or windows.
"""
