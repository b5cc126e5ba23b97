// node agent.mjs SIDE HOST PORT: a haptic agent with a simulated device, written from PROTOCOL.md alone.
//
// It meets the server, sends a `Stylus` every millisecond in step with the server's ticks, renders what comes back behind a
// safety chain, and says once a second, as a line of JSON, how it goes. The hand is a mass that is pulled, critically
// damped, to where it wants to be; the force of the device moves it. It looks at what its station's display is sent, and
// lifts its end of the board when the ball is to roll away from it. SIGTERM: it says Goodbye and ends.

import { Worker } from "node:worker_threads";
import { Subscriber } from "zeromq";
import { Link, now, say, understand } from "./link.mjs";
import { LATER, WAITING } from "./metronome.mjs";
import { Safety } from "./safety.mjs";
import { encodeFixed } from "./wire.mjs";

const [side, host, port] = process.argv.slice(2);

const LEAD_NS = 300_000;
const TICK_NS = 1_000_000;
const MOST_STEER_NS = 5_000;
const REMEMBERED = 1024n;
const LIFT = 0.035; // metres for an acceleration of 1 m/s2 of the ball

/** A hand of 0.5 kg that wants to be at a height, at rest at 0 to begin with; SI units. */
class Hand {
  #at = now();
  goal = 0;
  z = 0;
  vz = 0;

  move(force, time) {
    const dt = Math.min(Number(time - this.#at) / 1e9, 0.01);
    this.#at = time;
    const pull = 2 * Math.PI * 4;
    this.vz += (pull * pull * (this.goal - this.z) - 2 * pull * this.vz + force / 0.5) * dt;
    this.z += this.vz * dt;
  }
}

const hand = new Hand();
const link = new Link(`tcp://${host}:${port}`, "agent", side);
const metronome = new Int32Array(new SharedArrayBuffer(8));
const safety = new Safety();
const stamps = new BigInt64Array(Number(REMEMBERED));
let seq = 0n;
let session = newSession("");
let seen = { samples: 0, forces: 0, beats: 0, lead_ns: null };

/** What is counted anew in every session, not with every block; the samples' own numbers go on. */
function newSession(id) {
  const answer = { force_tick: -1n, force_sent_ns: 0n, force_received_ns: 0n };
  return { id, answer, rendered_seq: -1n, loop_ns: 0n };
}

/** Where the hand goes: by its share of the tilt that pulls the ball to the target, like a damped spring. */
function aim(view, before) {
  if (view.p === null || view.p === before?.p) return;
  const seconds = before === null || before.p === null ? Infinity : Number(view.tick - before.tick) / 1000;
  const speed = (view.p - (before?.p ?? view.p)) / seconds;
  const push = 3 * (view.target - view.p) - 3 * speed;
  hand.goal = Math.max(-0.03, Math.min(0.03, LIFT * push * (side === "left" ? 1 : -1)));
}

async function watch() {
  const views = new Subscriber({ linger: 0, tcpKeepalive: 1, conflate: true });
  views.connect(`tcp://${host}:${Number(port) + { left: 2, right: 3 }[side]}`);
  views.subscribe();
  let before = null;
  for await (const [frame] of views) {
    const view = understand(frame);
    if (view === null) continue;
    aim(view, before);
    before = view;
  }
}

/** Shift the next millisecond so that samples arrive LEAD_NS before the deadline of a tick. */
function steerBy(lead) {
  const early = ((((Number(lead) - LEAD_NS) % TICK_NS) + 1.5 * TICK_NS) % TICK_NS) - TICK_NS / 2;
  const shift = Math.max(-MOST_STEER_NS, Math.min(MOST_STEER_NS, Math.round(early / 16)));
  Atomics.store(metronome, LATER, shift);
}

function rendered(message, received) {
  if (message.is === "Heartbeat") message.arm ? safety.arm(received) : safety.disarm();
  safety.hear(message.is === "Force" ? message.force : 0, received);
  const from = message.stylus_seq;
  if (message.is === "Heartbeat" || from <= session.rendered_seq || seq - from > REMEMBERED) return;
  session.rendered_seq = from;
  session.loop_ns = now() - stamps[Number(from % REMEMBERED)];
}

function hear(message, received) {
  if (message.tick <= session.answer.force_tick) return;
  session.answer = { force_tick: message.tick, force_sent_ns: message.sent_ns, force_received_ns: received };
  rendered(message, received);
  if (message.stylus_seq >= 0n) steerBy(message.lead_ns);
  seen[message.is === "Force" ? "forces" : "beats"] += 1;
  seen.lead_ns = message.lead_ns;
}

function beat() {
  Atomics.store(metronome, WAITING, 0);
  const stamp_ns = now();
  hand.move(safety.render(stamp_ns), stamp_ns);
  if (link.welcome === null) return;
  const where = { x: 0, y: 0, z: hand.z, vx: 0, vy: 0, vz: hand.vz };
  const state = { buttons: 0n, safeguards: safety.takeBits(), rendered: safety.rendered, loop_ns: session.loop_ns };
  link.send(encodeFixed("Stylus", { seq, stamp_ns, ...where, ...state, ...session.answer, sent_ns: now() }));
  stamps[Number(seq % REMEMBERED)] = stamp_ns;
  seq += 1n;
  seen.samples += 1;
}

async function listen() {
  for await (const [message, received] of link.messages()) {
    if (message.is === "Welcome") {
      if (message.session !== session.id) session = newSession(message.session);
    } else if (link.welcome !== null && (message.is === "Force" || message.is === "Heartbeat")) {
      hear(message, received);
    }
  }
}

function report() {
  say({ armed: safety.armed, ...seen, loop_ns: session.loop_ns, z: hand.z, lost: link.lost, welcomes: link.welcomes });
  seen = { ...seen, samples: 0, forces: 0, beats: 0 };
}

process.on("SIGTERM", async () => {
  report();
  await link.leave("stopped");
  process.exit(0);
});
new Worker(new URL("metronome.mjs", import.meta.url), { workerData: metronome.buffer }).on("message", beat);
setInterval(report, 1000);

await Promise.all([watch(), listen()]);
