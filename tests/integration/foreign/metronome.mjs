// A worker that beats once a millisecond, without drift: Node's own timers know whole milliseconds only.
//
// Shared with whoever listens: by how many nanoseconds the next beat, and all after it, come later; and whether a beat has
// not been taken yet, in which case no other is sent. What was missed in a standstill is not made up for.

import { parentPort, workerData } from "node:worker_threads";

const PERIOD_NS = 1_000_000n;
const STANDSTILL_NS = -10_000_000;

export const LATER = 0;
export const WAITING = 1;

function run(shared) {
  const never = new Int32Array(new SharedArrayBuffer(4));
  let next = process.hrtime.bigint();
  for (;;) {
    next += PERIOD_NS + BigInt(Atomics.exchange(shared, LATER, 0));
    const wait = Number(next - process.hrtime.bigint());
    if (wait > 0) Atomics.wait(never, 0, 0, wait / 1e6);
    if (wait < STANDSTILL_NS) next = process.hrtime.bigint();
    if (Atomics.exchange(shared, WAITING, 1) === 0) parentPort.postMessage(null);
  }
}

if (parentPort !== null) run(new Int32Array(workerData));
