"""The experimental task: studies, plans, trials, and the journal of a session. Pure.

Open `trials/state_machine.py` first: one table lists the phases of a trial and their transitions. `studies` reads the
description of an experiment, `plans` derives the plan of each dyad from study, seed and number, and `journal` derives
the progress of a session from the lines of its journal. This wing uses no physics, no clock and no file system: it
reads and writes text.
"""
