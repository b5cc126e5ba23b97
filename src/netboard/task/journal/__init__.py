"""The journal of a session: entries, progress, and the check that it belongs to the session to be resumed.

Parameters
----------
entry : Header or Entry
    A line of the journal.
header : Header
    First line of the journal.
entries : sequence of Entry
    All other lines, in order.
now : Header
    Header that a new journal would have now.
source : str
    Name of the journal, for error messages.
progress : Progress
    Progress of the session, from `progress_of`.
"""
