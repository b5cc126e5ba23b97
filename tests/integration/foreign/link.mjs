// A peer's end of a channel with a way back (PROTOCOL.md, sections 1, 4 and 6): says Hello until it is welcome, and again
// after a silence, a Goodbye or a Refusal. A Welcome that comes again in the same session is another block.

import { hostname } from "node:os";
import { Dealer } from "zeromq";
import { PROTOCOL_VERSION, decode, encode } from "./wire.mjs";

const HELLO_EVERY_MS = 500;
const SILENT_NS = 500_000_000n;

export const now = () => process.hrtime.bigint();

/** One line of JSON on the standard output; a BigInt is written as a number. */
export const say = (words) =>
  console.log(JSON.stringify(words, (_, value) => (typeof value === "bigint" ? Number(value) : value)));

/** The message of a frame; one that is none is dropped, and said so. */
export function understand(frame) {
  try {
    return decode(frame);
  } catch (error) {
    say({ Undecodable: error.message });
    return null;
  }
}

export class Link {
  #socket;
  #hello;
  #heardNs = now();
  #timer;
  lost = 0;
  welcome = null;
  welcomes = 0;

  constructor(address, role, side) {
    const name = `${hostname()}:${process.pid}`;
    this.#hello = { role, side, protocol: PROTOCOL_VERSION, name, version: `node ${process.version}`, details: {} };
    this.#socket = new Dealer({
      routingId: `${role}.${side}@${name}`,
      immediate: true,
      sendHighWaterMark: 4,
      receiveHighWaterMark: 4,
      sendTimeout: 0,
      linger: 0,
      tcpKeepalive: 1,
      tcpKeepaliveIdle: 1,
      tcpKeepaliveInterval: 1,
      tcpKeepaliveCount: 3,
    });
    this.#socket.connect(address);
    this.#timer = setInterval(() => this.#greet(), HELLO_EVERY_MS);
    this.#greet();
  }

  #greet() {
    if (this.welcome === null || now() - this.#heardNs > SILENT_NS) this.send(encode("Hello", this.#hello));
  }

  /** Send a frame, or lose it: where nobody is, or the queue is full. */
  async send(frame) {
    try {
      await this.#socket.send(frame);
    } catch (error) {
      if (error.code !== "EAGAIN" && error.code !== "EBUSY") throw error;
      this.lost += 1;
    }
  }

  /** What the server says, as messages with the time at which each came. */
  async *messages() {
    for await (const [frame] of this.#socket) {
      this.#heardNs = now();
      const message = understand(frame);
      if (message?.is === "Welcome") this.#welcomed(message);
      if (message?.is === "Refusal" || message?.is === "Goodbye") this.#unwelcome(message);
      if (message !== null) yield [message, this.#heardNs];
    }
  }

  #welcomed(message) {
    if (message.session !== this.welcome?.session) say({ Welcome: message.session });
    this.welcome = message;
    this.welcomes += 1;
  }

  #unwelcome(message) {
    say({ [message.is]: message.reason });
    this.welcome = null;
  }

  /** Say Goodbye and give it a moment to leave. */
  async leave(reason) {
    clearInterval(this.#timer);
    this.welcome = null;
    await this.send(encode("Goodbye", { reason }));
    await new Promise((done) => setTimeout(done, 50));
    this.#socket.close();
  }
}

/** A setting in the configuration that a Welcome brings: `key = number` in `[table]`. */
export function setting(toml, table, key) {
  const [, body] = toml.split(`[${table}]\n`);
  return Number(body.split("\n[")[0].match(new RegExp(`^${key} = (.+)$`, "m"))[1]);
}
