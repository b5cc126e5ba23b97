"""From recordings to results: measures, extraction, statistics, figures and the report.

Open `measures` first: pure functions of arrays, one for each measure of the paper and of later work. `extraction`
applies them to recordings and makes tables, `statistics` has the models and tests, `results` the numbers that are
reported, `figures` and `report` show them. This wing knows no device, no socket and no window.
"""
