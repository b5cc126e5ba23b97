"""Recording wing: write, read, recover, check, replay, export and import recordings.

Start with `format/FORMAT.md`, then `files/reader.py` (`Recording`), which gives each stream as an array. `recovery`
rebuilds complete recordings from broken ones. `integrity` checks that a recording is complete and bit-exact. `replay`
moves through a recording in time; `counterfactual` replays the recorded hand movements in another scene; `timing` finds
the causes of stutter. A file keeps the suffix ``.part`` until it is complete, and is never overwritten. This wing uses
no sockets, no live session and no analysis.
"""
