// What stands between a force from the server and a device (PROTOCOL.md, sections 5 and 6): trusts nobody.
//
// Armed only by a `Heartbeat`, the force rises along a ramp; one that is not finite is none, one that is too large is
// clamped, one that changes too fast is followed slowly; without news it fades, and then the device is disarmed.

export const Bits = { ARMED: 1, RAMPING: 2, CLAMPED: 4, SLEWED: 8, STALE: 16, NOT_FINITE: 64 };

const STALE_AFTER_MS = 10;
const FADE_MS = 50;
const DISARM_AFTER_MS = 100;
const MOST_N = 3.3;
const SLEW_N_PER_S = 100;
const RAMP_S = 0.5;
const LONGEST_STEP_NS = 2e6;

export class Safety {
  #armedNs = null;
  #heardNs = null;
  #wanted = 0;
  #movedNs = 0n;
  #bits = 0;
  rendered = 0;

  get armed() {
    return this.#armedNs !== null;
  }

  hear(force, now) {
    this.#heardNs = now;
    this.#wanted = force;
    return this.render(now);
  }

  arm(now) {
    this.#armedNs ??= now;
  }

  disarm() {
    this.#armedNs = null;
  }

  /** Hand the device what it may get now. Called with every force and at every reading. */
  render(now) {
    const silent = this.#heardNs === null ? Infinity : Number(now - this.#heardNs) / 1e6;
    if (silent > DISARM_AFTER_MS) this.#armedNs = null;
    const ramp = this.armed ? Math.min(1, Number(now - this.#armedNs) / 1e9 / RAMP_S) : 0;
    const fade = Math.max(0, Math.min(1, 1 - (silent - STALE_AFTER_MS) / FADE_MS));
    if (fade < 1) this.#bits |= Bits.STALE;
    if (this.armed && ramp < 1) this.#bits |= Bits.RAMPING;
    this.#approach(this.#clamp(this.#finite() * ramp * fade), now);
    return this.rendered;
  }

  #finite() {
    if (Number.isFinite(this.#wanted)) return this.#wanted;
    this.#bits |= Bits.NOT_FINITE;
    return 0;
  }

  #clamp(force) {
    if (Math.abs(force) > MOST_N) this.#bits |= Bits.CLAMPED;
    return Math.max(-MOST_N, Math.min(MOST_N, force));
  }

  #approach(force, now) {
    const step = (SLEW_N_PER_S * Math.min(Number(now - this.#movedNs), LONGEST_STEP_NS)) / 1e9;
    const change = Math.max(-step, Math.min(step, force - this.rendered));
    if (change !== force - this.rendered) this.#bits |= Bits.SLEWED;
    this.rendered += change;
    this.#movedNs = now;
  }

  /** The `safeguards` since this was last asked. */
  takeBits() {
    const bits = this.#bits | (this.armed ? Bits.ARMED : 0);
    this.#bits = 0;
    return BigInt(bits);
  }
}
