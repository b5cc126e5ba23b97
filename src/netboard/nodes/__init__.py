"""The loops of the running system.

Server, agent, logger, operator, replay, rehearsal, and the doctor that examines a machine.

Open `server/session.py` first: one dyad's session, tick by tick. `ports` are the server's endpoints of the channels,
`agent` owns a device, `logger` brings records to disk, `operator` commands. A node composes the wings below; it holds
no physics and no rule of a trial. This wing does not depend on windows or analysis.
"""
