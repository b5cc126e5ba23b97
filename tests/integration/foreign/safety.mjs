// What stands between a force from the server and a device (PROTOCOL.md, sections 5 and 6): trusts nobody.
//
// Armed only by a `Beat` that allows it, force then comes back by a ramp; a force that is not finite is none, one that is too large is
// clamped, one that changes too fast follows slowly; without news the force fades and then the device is disarmed.

export const Bits = { ARMED: 1, RAMPING: 2, CLAMPED: 4, SLEWED: 8, STALE: 16, NOT_FINITE: 64 };

const MOST_N = 3.3;
const SLEW_N_PER_S = 100;
const RAMP_S = 0.5;

export class Safety {
  #limits;
  #armedNs = null;
  #heardNs = null;
  #wanted = 0;
  #movedNs = 0n;
  #bits = 0;
  rendered = 0;

  /** `limits`: stale_after_ms, fade_ms and disarm_after_ms of the server's configuration, as Numbers. */
  constructor(limits) {
    this.#limits = limits;
  }

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

  /** Hand the device what it may get now. Called with every force and at every reading. */
  render(now) {
    const silent = this.#heardNs === null ? Infinity : Number(now - this.#heardNs) / 1e6;
    if (silent > this.#limits.disarm_after_ms) this.#armedNs = null;
    const ramp = this.armed ? Math.min(1, Number(now - this.#armedNs) / 1e9 / RAMP_S) : 0;
    const fade = Math.max(0, Math.min(1, 1 - (silent - this.#limits.stale_after_ms) / this.#limits.fade_ms));
    if (fade < 1) this.#bits |= Bits.STALE;
    if (this.armed && ramp < 1) this.#bits |= Bits.RAMPING;
    const most = this.armed ? MOST_N * fade : 0;
    this.#approach(this.#clamp(this.#finite() * ramp * fade, most), most, now);
    return this.rendered;
  }

  #finite() {
    if (Number.isFinite(this.#wanted)) return this.#wanted;
    this.#bits |= Bits.NOT_FINITE;
    return 0;
  }

  #clamp(force, most) {
    if (Math.abs(force) > most && most === MOST_N) this.#bits |= Bits.CLAMPED;
    return Math.max(-most, Math.min(most, force));
  }

  #approach(force, most, now) {
    const step = (SLEW_N_PER_S * Math.min(Number(now - this.#movedNs), 1e6)) / 1e9;
    const change = Math.max(-step, Math.min(step, force - this.rendered));
    if (change !== force - this.rendered) this.#bits |= Bits.SLEWED;
    this.rendered = Math.max(-most, Math.min(most, this.rendered + change));
    this.#movedNs = now;
  }

  /** The `safeguards` since this was last asked. */
  takeBits() {
    const bits = this.#bits | (this.armed ? Bits.ARMED : 0);
    this.#bits = 0;
    return BigInt(bits);
  }
}
