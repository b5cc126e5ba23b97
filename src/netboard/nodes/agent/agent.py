"""The agent: one loop that owns one haptic device.

Each millisecond it reads the stylus and sends the sample. When a commanded force arrives, and at the latest before the
next millisecond, the safety chain turns it into the force that the device renders. The agent trusts no peer: without
fresh messages the force fades, and on every exit path the device gets zero force first.

A lost device does not end the agent: it leaves the session, looks for the device, and joins again with it. Forces then
return as after any pause.

The agent's milliseconds follow the server's ticks. The server reports how long before the tick's deadline a sample
arrived, and the agent slowly shifts its phase until that is `LEAD_NS`. A sample then waits only for the other side's.
"""

import logging
from collections.abc import Callable, Mapping
from importlib.metadata import version

from netboard.base.clock import Pacer, now_ns
from netboard.base.compiled import machine_code
from netboard.base.config import Config, Side
from netboard.base.device_kind import held_by
from netboard.base.errors import ConfigError, DeviceError, DeviceNotFound
from netboard.base.process.realtime import steady_loop
from netboard.base.process.resources import NAME
from netboard.base.terminal.logs import RateLimitedLog
from netboard.base.tick import TICK_NS
from netboard.devices.contract import registry
from netboard.devices.contract.access import CompiledAccess, Kernel
from netboard.devices.contract.device import Device, DeviceInfo, Reading
from netboard.devices.safety.arming import Arming
from netboard.devices.safety.chain import SafetyChain
from netboard.devices.safety.passivity import Passivity
from netboard.network import keys
from netboard.network.protocol.joining import Hello
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.transport import channels, fastpath, sockets
from netboard.network.transport.waiting import NO_FILE
from netboard.nodes.agent.agent_runs import (
    ANSWER_NS,
    ANSWERED,
    LATE,
    NEVER_DUE_NS,
    NO_READING,
    NOT_BEGUN,
    NOTHING_BEGUN,
    SENT,
    Begun,
    RunProgress,
    run_of,
    shifted,
)
from netboard.nodes.agent.holders import Holder, Holders, StylusSource, holder_of
from netboard.nodes.agent.motion_link import FORCE, POINT, MotionLink
from netboard.nodes.agent.rendered_buffer import RenderedRing
from netboard.nodes.agent.rules import LIMITED, RuleKernels, Rules, rules_of
from netboard.nodes.ports.latency import DELAY_LIMIT, limit_ns, loops_of
from netboard.physics.stability.delayed_coupling import Mechanism
from netboard.stage.blinding import ANOTHER_HOLDER

log = logging.getLogger(__name__)

MAX_TICKS = 20
"""Undisturbed ticks after which the agent looks whether it is to stop [1]."""

SEARCH_INTERVAL_NS = 500_000_000
"""Interval at which the agent looks for a lost device [ns]."""


class AgentNode:
    """One device, its safety chain and its link to the server."""

    def __init__(
        self, config: Config, side: Side, device: Device, context: sockets.Context, source: StylusSource | None = None
    ) -> None:
        where = keys.reach(config.network, f"agent.{side}")
        socket = sockets.motion_agent(context, where.reach(channels.MOTION), f"agent.{side}@{NAME}")
        timeout_ns = int(config.network.sample_timeout_ms * 1e6)
        self._config, self._side = config, side
        self._holder = holder_of(config, device, source)
        self._holders = Holders(side, self._holder, context)
        introduced = introduction(side, config, device.info, self._holder.identity)
        log.info("%s hand: %s", side, held_by(introduced.details).text)
        self._link = MotionLink(socket, introduced, timeout_ns)
        self._device, self._source, self._safety = device, source, self._holder.safety
        self._fixture = config.fixture
        self._passivity = Passivity(on=config.safety.passivity)
        self._arming = Arming(device.agent.stop_buttons, device.agent.consent_buttons)
        self._rules = self._current_rules()
        self._seq = 0
        self._safeguards = 0
        self._rendered = 0.0
        self._shift_ns = 0
        self._ring = RenderedRing()
        self._kernels = RuleKernels(self._link.frame, self._rules)
        self._shifted = machine_code(shifted, 0, 0)

    def run(self, stopping: Callable[[], bool]) -> None:
        """Serve the device until stopped; the caller closes the device.

        Raises `ConfigError` if the server keeps refusing this agent, as when the side has another one.
        """
        self._warm()
        steady_loop()
        log.info("waiting for the server at %s:%d", self._config.network.host, self._config.network.port)

        def ends() -> bool:
            return stopping() or self._link.refusal != ""

        try:
            while not ends():
                try:
                    if (holder := self._serve(ends)) is not None:
                        self._take_holder(holder)
                except DeviceError as error:
                    self._close_lost_device(error)
                    self._find_device(ends)
        finally:
            self._holders.close()
        self._link.leave("the agent was stopped")
        if self._link.refusal:
            where = f"{self._config.network.host}:{self._config.network.port}"
            raise ConfigError(
                f"the {self._side} agent: the server at {where} refuses it: {self._link.refusal}; "
                "end the other agent, or correct --side, the address or the key, and start this one again"
            )

    def _warm(self) -> None:
        """Compile or load the kernels, so that the first tick is not late."""
        self._link.warm()
        self._undisturbed_ticks()

    def compile_for(self, access: CompiledAccess) -> None:
        """Compile the undisturbed ticks of another device, which need not be open."""
        run_of(access, self._link, self._ring, self._rules)

    def _serve(self, stopping: Callable[[], bool]) -> Holder | None:
        """Serve the connected device, and leave it with zero force; return the block's holder if it is another one."""
        run, pacer, holder = self._undisturbed_ticks(), Pacer(now_ns() + TICK_NS), self._holder
        while not stopping() and holder is self._holder:
            holder = self._holders.chosen() or holder
            pacer.wait()
            begun, reading = NOTHING_BEGUN, None
            if run is not None and not self._link.server_silent:
                first = self._seq
                begun, reading = self._run_undisturbed(run, pacer)
                if begun.stage == NOT_BEGUN and self._seq - first == MAX_TICKS:
                    pacer.shift(-TICK_NS)  # no tick needs single steps: `wait` comes to the same tick again
                    continue
            pacer.shift(self._tick(pacer.due_ns + TICK_NS, begun, reading))
        self._device.write(0.0, 0.0, 0.0)
        return None if holder is self._holder else holder

    def _take_holder(self, holder: Holder) -> None:
        """Serve the device of another holder from now on; the one before has zero force."""
        self._link.part(ANOTHER_HOLDER)
        self._holder, self._rendered = holder, 0.0
        self._device, self._source, self._safety = holder.device, holder.source, holder.safety
        self._arming.keep_stop(self._safety)
        self._rules = self._current_rules()
        introduced = introduction(self._side, holder.config, self._device.info, holder.identity)
        if not self._holders.blinded:
            log.info("%s hand: %s", self._side, held_by(introduced.details).text)
        self._link.introduce(introduced)

    def _undisturbed_ticks(self) -> Kernel | None:
        """Return the function that runs undisturbed ticks of the connected device, if it has compiled access."""
        access = self._device.compiled
        return None if access is None else run_of(access, self._link, self._ring, self._rules)

    def _current_rules(self) -> Rules:
        """Return the rules with the present safety chain, which is a new one after a loss of the device."""
        return rules_of(self._safety, self._arming, self._passivity, self._fixture)

    def _run_undisturbed(self, run: Kernel, pacer: Pacer) -> tuple[Begun, Reading | None]:
        """Run ticks until one needs single steps; return what has been done of that one, and its reading.

        The stylus source is advanced on the way.
        """
        progress = RunProgress(pacer.due_ns, self._seq, self._safeguards, self._rendered)
        begun, reading = NOTHING_BEGUN, NO_READING
        stop = self._seq + MAX_TICKS
        while True:
            progress, begun, reading = run(progress, begun, reading, stop, *self._source_due())
            if begun.stage < LATE or begun.came != fastpath.NOTHING:
                break
            self._advance_source()
        pacer.due_ns, self._seq, self._safeguards, self._rendered = progress
        self._ring.next_seq = self._seq
        return begun, None if begun.stage == NOT_BEGUN else Reading(*reading)

    def _close_lost_device(self, error: DeviceError) -> None:
        """Close the lost device, with zero force, and leave the session."""
        self._safety.device_lost()
        self._rendered = 0.0
        try:
            self._device.close()
        except DeviceError as last:
            log.warning("zero force could not be written to the device: %s", last)
        log.error("the device is lost, no force is rendered: %s", error)
        self._link.part(f"the device is lost: {error}")

    def _find_device(self, stopping: Callable[[], bool]) -> None:
        """Look for the lost device until it is back."""
        log.info("looking for the device every %g s", SEARCH_INTERVAL_NS * 1e-9)
        trouble = RateLimitedLog(log)
        while not stopping():
            try:
                info = self._device.open()
            except DeviceNotFound:
                Pacer(now_ns() + SEARCH_INTERVAL_NS).wait()
                continue
            except (DeviceError, ConfigError) as error:
                trouble.log(f"the device is back, but cannot be used yet: {error}")
                Pacer(now_ns() + SEARCH_INTERVAL_NS).wait()
                continue
            introduced = introduction(self._side, self._holder.config, info, self._holder.identity)
            log.info("the device is back: %s", held_by(introduced.details).text)
            lost, self._safety = self._safety, SafetyChain(self._config.safety, info.max_force, info.continuous_force)
            self._safety.keep_mean_of(lost)
            self._arming.keep_stop(self._safety)
            self._holder = self._holders.renewed(self._holder, self._safety)
            self._rules = self._current_rules()
            self._link.introduce(introduced)
            return

    def _tick(self, until_ns: int, begun: Begun = NOTHING_BEGUN, reading: Reading | None = None) -> int:
        """Read and send the stylus, then render until the next tick is due; return the phase shift [ns].

        An agent that computes the force itself need not wait for an answer, and renders at once. The stylus source runs
        after the first answer, or in the last quarter of the tick if none has come by then. What compiled code has
        ``begun`` is continued.
        """
        if reading is None:
            reading = self._device.read(now_ns())
        if begun.stage < SENT:
            self._send(reading)
        # A continued tick is not one of those: an answer after its sample may have been the first `POINT`.
        alone = begun.stage < SENT and self._link.kind == POINT
        if alone:
            self._render(reading)
        self._shift_ns = begun.shift_ns
        rendered = self._handle(begun.came, reading, alone) or begun.stage == ANSWERED
        if begun.stage < LATE:
            rendered = rendered or self._await(reading, until_ns - TICK_NS + ANSWER_NS, alone)
            self._advance_source()
        while now_ns() < until_ns:
            # No `or`: each newer answer is rendered, not only the first one of a tick.
            rendered |= self._await(reading, until_ns, alone)
        if not (alone or rendered):
            self._render(reading)
        # Last, so that no backfill delays a force.
        if self._link.asked is not None:
            self._link.answer(self._ring.answer(self._link.asked))
        return self._shift_ns

    def _await(self, reading: Reading, until_ns: int, alone: bool) -> bool:
        """Wait for an answer until a time [ns], and render its force unless this agent computes it alone."""
        link = self._link
        while True:
            came, fx, fy, fz, safeguards = self._kernels.await_limited_force(
                link.fast, link.frame, link.state, self._rules, until_ns, not alone, *reading[:7], self._rendered
            )
            if came == LIMITED:
                self._write(fx, fy, fz, safeguards)
                self._shift_ns = self._shifted(self._shift_ns, link.lead_ns)
                return True
            if self._handle(came, reading, alone):
                return True
            if came == fastpath.NOTHING or now_ns() >= until_ns:  # however many other messages there are
                return False

    def _handle(self, came: int, reading: Reading, alone: bool) -> bool:
        """Handle what the link has found; return whether it is a newer answer, whose force is then rendered."""
        if not self._link.handle_found(came):
            return False
        if not alone:
            self._render(reading)
        self._shift_ns = self._shifted(self._shift_ns, self._link.lead_ns)
        return True

    def _source_due(self) -> tuple[int, int]:
        """Return when the stylus source must be advanced [ns], and the file that signals it."""
        return (NEVER_DUE_NS, NO_FILE) if self._source is None else (self._source.due_ns, self._source.file)

    def _advance_source(self) -> None:
        """Advance the stylus source, at a time when that delays no force."""
        if self._link.block:
            text, self._link.block = self._link.block, ""
            self._holders.begin(text)
            if self._source is not None:
                self._source.begin(text)
        if self._source is not None:
            self._source.step(now_ns(), self._link.kind in (FORCE, POINT))

    def _render(self, reading: Reading) -> None:
        """Render the newest commanded or own force and the fixture's force, through the safety chain."""
        state, now = self._link.state, now_ns()
        self._write(*self._kernels.limited_force(state, self._rules, now, *reading[:7], self._rendered))

    def _write(self, fx: float, fy: float, fz: float, safeguards: int) -> None:
        """Hand a limited force to the device."""
        self._device.write(fx, fy, fz)
        self._link.rendered(now_ns())
        self._rendered = fz
        self._safeguards |= safeguards

    def _send(self, reading: Reading) -> None:
        """Arm or disarm the device, and send the sample, with the safeguards and the force since the last one."""
        self._safeguards = self._kernels.apply_reading(
            self._link.state, self._rules, self._seq, reading.z, reading.buttons, reading.ready, self._safeguards
        )
        self._link.send(self._seq, reading, self._safeguards, self._rendered)
        self._ring.add(self._seq, reading.stamp_ns, self._rendered, self._safeguards)
        self._seq += 1
        self._safeguards = 0


def introduction(side: Side, config: Config, info: DeviceInfo, policy: Mapping[str, str]) -> Hello:
    """Return the agent's `Hello`, with what the recording says of its device, and of the policy that moves it."""
    agent = config.agents.of(side)
    details = {
        **info.details,
        "device": agent.device,
        "kind": str(registry.kind_of(agent.device)),
        "maker": registry.maker_of(agent.device),
        "model": info.model,
        "serial": info.serial,
        "max_force": f"{info.max_force!r} N",
        "resolution": f"{info.resolution!r} m",
        "zero": f"{agent.zero!r} m",
        **policy,
    }
    if info.mass is not None and info.damping is not None:
        loops = loops_of(config, Mechanism(info.mass, info.damping))
        details[DELAY_LIMIT] = f"{limit_ns(loops) * 1e-6:g} ms"
    return Hello("agent", side, PROTOCOL_VERSION, NAME, version("netboard"), details)
