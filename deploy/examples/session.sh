#!/bin/sh
# A short pilot session, run by a script: the first two blocks of the paper's study with two trials each, and simulated people.
#
#     session.sh [FOLDER]
#
# FOLDER (./pilot) gets the configuration, the journal, a recording of each block, and what every process said. Needs
# `netboard` in the PATH; PORT is the first of the eight ports it uses. On a rig the processes run on their machines already (netboard up): then only
# the part from "arm" on counts.
set -eu

folder=${1:-pilot}
rig=$folder/rig.toml
mkdir "$folder"     # an old session is never written over
cat > "$rig" <<TOML
[session]
pilot = true            # so the session is open from the start; a real one waits for its form ("open")
participant_a = "P07"
participant_b = "P08"

[network]
port = ${PORT:-5550}

[recording]
directory = "$folder"

[quality]
excluded_share = 1.0    # nobody is there to be asked whether lost trials are repeated
TOML

control() { netboard control -c "$rig" "$@"; }

# Start the block, or resume it after a pause that nobody asked for (the server stalled), until a phase.
proceed() { control start --until "$1" --seconds 300 || control resume --until "$1" --seconds 300; }

# Try again until the server accepts, for a minute; what it answers in between is in the log.
insist() {
    tries=60
    until "$@" 2>> "$folder/refused.log"; do
        tries=$((tries - 1))
        if [ "$tries" -eq 0 ]; then
            tail -n 1 "$folder/refused.log" >&2
            return 1
        fi
        sleep 1
    done
}

running=""
trap 'kill $running 2> /dev/null || true' EXIT
trap 'exit 1' INT TERM

netboard server -c "$rig" --study paper --dyad 3 --blocks 2 --trials 2 2> "$folder/server.log" &
server=$!
netboard logger -c "$rig" --once 2> "$folder/logger.log" &
logger=$!
running="$server $logger"
for side in left right; do
    netboard agent -c "$rig" --side "$side" 2> "$folder/agent-$side.log" &
    running="$running $!"
done

insist control arm

insist proceed finished     # block 1; 1.5 s later block 2 is there
control note "a rest" --until idle --seconds 30

insist proceed running
if control pause_after_trial --until paused --seconds 60; then
    control repeat || echo "there is no trial to repeat yet"    # the one before the pause, at the end of the block
    control resume
fi
control note "block 2 is the last one" --until finished --seconds 300 2>> "$folder/refused.log" || insist proceed finished
control end --json > "$folder/end.json"

wait "$server"
wait "$logger"
for recording in "$folder"/*.mcap; do
    netboard replay --verify "$recording"
done
