"""Recordings: written, read, recovered, checked, replayed, exported and imported.

Open `format/FORMAT.md`, then `files/reader.py` (`Recording`): streams as arrays. `recovery` makes whole recordings of
broken ones, `integrity` proves that a recording is complete and bit-exact, `replay` moves through one in time,
`counterfactual` replays the hands against another scene. Files are written once, under a `.part` name until they are
whole, and never overwritten. This wing knows no socket, no session that runs, and no analysis.
"""
