"""What participants are asked to do: studies, plans, trials, and the journal of a session. Pure.

Open `trials/state_machine.py` first: one table says what phase a trial is in and what comes next. `studies` describes
an experiment as a file does, `plans` derives the plan of each dyad from study, seed and number, `journal` tells from
the lines of a journal where a session stands. This wing knows no physics, no clock and no file system: texts come in
and go out.
"""
