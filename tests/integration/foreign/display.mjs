// node display.mjs STATION HOST PORT: a display that shows its participant's view as a line of text, written from
// PROTOCOL.md alone.
//
// Reads the views of its station, paints the newest sixty times a second, reports what it has painted, and answers the
// server's pings. Once a second it prints, as a line of JSON, what it shows and how often each thing has happened.
// SIGTERM: it says Goodbye and ends.

import { Subscriber } from "zeromq";
import { Link, now, say, setting, understand } from "./link.mjs";
import { encode } from "./wire.mjs";

const [station, host, port] = process.argv.slice(2);

const PAINT_EVERY_MS = 1000 / 60;
const REPORT_EVERY_MS = 500;
const CHANNEL = { left: 2, right: 3 };
const OTHER = { left: "right", right: "left" };

const link = new Link(`tcp://${host}:${Number(port) + 4}`, "display", station);
const views = new Subscriber({ linger: 0, tcpKeepalive: 1 });
let waiting = null;
let shown = [];
let picture = "";
let heardNs = now();
let limitMs = 500;
let lengthM = 1;
let following = null;
let phase = null;
const counts = { views: 0, missed: 0, frames: 0, dropped: 0, pings: 0, partner_seen: 0 };

/** The board, the ball and the target, from one end of the line to the other. */
function draw(view) {
  const line = Array(41).fill("-");
  const column = (p) => Math.max(0, Math.min(40, Math.round(20 + (40 * p) / lengthM)));
  line[column(view.target)] = "U";
  if (view.p !== null) line[column(view.p)] = "o";
  const tilt = `${((view.theta * 180) / Math.PI).toFixed(1)} deg`;
  return `${line.join("")} ${view.phase} ${view.trial}/${view.trials} of block ${view.block}/${view.blocks} ${tilt}`;
}

function paint() {
  if (Number(now() - heardNs) / 1e6 > limitMs) picture = "no news from the server";
  if (waiting === null) return;
  const { view, received } = waiting;
  waiting = null;
  picture = draw(view);
  shown.push([view.tick, received, now()]);
  counts.frames += 1;
  if (view.phase === phase) return;
  phase = view.phase; // a phase can be shorter than the time between two reports
  tell();
}

async function watch() {
  views.connect(`tcp://${host}:${Number(port) + CHANNEL[station]}`);
  views.subscribe();
  for await (const [frame] of views) {
    const view = understand(frame);
    if (view === null) continue;
    heardNs = now();
    counts.views += 1;
    if (following !== null && view.seq > following) counts.missed += Number(view.seq - following);
    following = view.seq + 1n;
    if (view[OTHER[station]] !== null) counts.partner_seen += 1;
    if (waiting !== null) counts.dropped += 1;
    waiting = { view, received: heardNs };
  }
}

function takeOver(config) {
  limitMs = setting(config, "display", "link_timeout_ms");
  lengthM = setting(config, "geometry", "board_length");
}

async function answer() {
  for await (const [message, received] of link.messages()) {
    if (message.is === "Welcome") takeOver(message.config);
    if (message.is !== "Ping") continue;
    link.send(encode("Pong", { ping_ns: message.sent_ns, received_ns: received, sent_ns: now() }));
    counts.pings += 1;
  }
}

function reportFrames() {
  if (link.welcome === null) return;
  link.send(encode("Frames", { station, shown: shown.splice(0), dropped: BigInt(counts.dropped) }));
}

const tell = () => say({ picture, ...counts, lost: link.lost, welcomes: link.welcomes });

process.on("SIGTERM", async () => {
  reportFrames();
  tell();
  await link.leave("stopped");
  process.exit(0);
});
setInterval(paint, PAINT_EVERY_MS);
setInterval(reportFrames, REPORT_EVERY_MS);
setInterval(tell, 1000);
await Promise.all([watch(), answer()]);
