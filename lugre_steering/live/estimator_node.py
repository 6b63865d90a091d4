# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The managed node: its life cycle, its parameters, its services, its report; the samples are the session's."""

from __future__ import annotations

import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from lugre_steering.counted import counted
from lugre_steering.effects.registry import add_files
from lugre_steering.errors import DataError, LugreSteeringError
from lugre_steering.estimator.state_file import Ownership, read_learned, read_state, write_state
from lugre_steering.live.console import Console
from lugre_steering.live.later import Later, Work
from lugre_steering.live.parameters import changed, check_files, declare, undeclared
from lugre_steering.live.session import LEAVE_S, TICK_S, Session
from lugre_steering.recording import NODE
from lugre_steering.vehicle import Vehicle, load
from lugre_steering.watch.detector import UNCALIBRATED
from lugre_steering.watch.window import Part

LATENCY_WINDOW = 4096
REPORT_S = 1.0
NEWS_S = 0.1
"""What is new is reported at once, or this long after the news before."""
STEP_S = 0.001
"""From one part of such a report to the next, so that torques that have come meanwhile go out between."""
LOOK_TICKS = 4
"""At one tick in so many the middleware is asked who else is there, at another what it lost: while messages come, asking takes a tenth
of a millisecond, and a torque may wait for it."""


class SteeringTorqueEstimator(LifecycleNode):
    """See INTERFACE: topics in, topics out. Raises ``LugreSteeringError`` for bad parameters; ``start`` for a bad vehicle file."""

    def __init__(self, *, latency_window: int = LATENCY_WINDOW) -> None:
        super().__init__(NODE)
        self.settings = declare(self)
        self.session: Session | None = None
        self.callbacks = 0
        self.last_exception = ""
        self._refusal: LugreSteeringError | None = None
        self._latency_window = latency_window
        self._began_ns = self._reported_ns = self._saved_ns = time.monotonic_ns()
        self._news_ns = 0
        self._ticks = 0
        self._reporting: Iterator[DiagnosticStatus] | None = None
        self._statuses: list[DiagnosticStatus] = []
        self._console = Console(self.get_logger())
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        # Steady, so that health is reported while simulated time stands still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(TICK_S, self.guarded(self._tick), clock=steady)
        self._urgent = 0  # reports to be made one part after the other
        self._telling = self.create_timer(STEP_S, self.guarded(self._tell_on), clock=steady, autostart=False)
        self._answering = [Later(self, f"~/{name}", work, self.fault) for name, work in (("reload", self._reload), ("mark", self._mark))]
        self._writer: threading.Thread | None = None
        self._ownership = Ownership()
        change = self._service_change_state
        change.callback = self._answered(change.callback)
        self.add_on_set_parameters_callback(self._check)
        self.add_post_set_parameters_callback(self._take_over)

    def start(self) -> None:
        """Configure and activate, unless a lifecycle manager is to do so. Raises what makes that impossible."""
        if not self.settings.autostart:
            self.get_logger().info("not configured (autostart is false), ready for a lifecycle manager")
            return
        for step in (self.trigger_configure, self.trigger_activate):
            if step() != TransitionCallbackReturn.SUCCESS:
                raise self._refusal or DataError(self.last_exception or "the node cannot be started")

    # ------------------------------------------------------------ life cycle

    def on_configure(self, _: LifecycleState) -> TransitionCallbackReturn:
        """Load the vehicle file, compile or load compiled code, join the topics; the state begins to follow the inputs."""
        begin = time.monotonic()
        try:
            vehicle = self._load(self.settings.vehicle_file)
            self.session = Session(self, self.settings, vehicle, self.guarded, self._latency_window)
        except LugreSteeringError as error:
            self._refusal = error
            self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        except Exception as error:  # rclpy would swallow it
            self.fault(error)
            return TransitionCallbackReturn.ERROR
        self._restore(self.session)
        if not self.session.watch.bound_Nm:
            self.get_logger().info(f"the watch tells changes only: {UNCALIBRATED}")
        if unknown := undeclared(self):
            self.get_logger().warning(f"no such parameter, not used: {', '.join(unknown)}")
        self.get_logger().info(
            f"'{vehicle.name}' ready, executor '{self.settings.executor}'; compiled code loaded in {time.monotonic() - begin:.2f} s"
        )
        return TransitionCallbackReturn.SUCCESS

    def _load(self, file: Path) -> Vehicle:
        """The vehicle file, with what is doubtful in it told as warnings."""
        with warnings.catch_warnings(record=True) as doubts:
            warnings.simplefilter("always")
            add_files(self.settings.effects_files)
            vehicle = load(file)
        for doubt in doubts:
            self.get_logger().warning(str(doubt.message))
        return vehicle

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        assert self.session is not None  # it is configured
        self.session.activate()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Outputs to zero and silent; the state goes on."""
        assert self.session is not None
        self.session.deactivate()
        self._begin_saving()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.leave()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.leave()
        return super().on_shutdown(state)

    def on_error(self, _: LifecycleState) -> TransitionCallbackReturn:
        """After an exception in a transition: back to unconfigured, from where it can be configured anew."""
        self.leave()
        return TransitionCallbackReturn.SUCCESS

    def leave(self) -> None:
        """Say so, lead the feed-forward to zero, keep the state, leave the topics."""
        session = self.session
        if session is not None:
            session.health.leaving = True
            self._report(session, time.monotonic_ns())
            session.withdraw()
        self.save()
        self._ownership.release()
        self.session = None
        if session is not None:
            session.close()

    def _answered(self, change: Callable[..., Any]) -> Callable[..., Any]:
        """A transition that is not possible now is refused; out of rclpy's service it would come as an exception."""

        def answer(request: Any, response: Any) -> Any:
            try:
                return change(request, response)
            except RCLError as error:
                self.get_logger().warning(f"transition refused: {' '.join(str(error).split())}")
                response.success = False
                return response

        return answer

    # ----------------------------------------------------- faults and report

    def guarded(self, handle: Callable[..., None]) -> Callable[..., None]:
        """``handle``, made unable to end the node: an exception would escape spin."""

        def callback(*message: Any) -> None:
            self.callbacks += 1
            try:
                handle(*message)
            except Exception as error:
                self.fault(error)

        return callback

    def fault(self, error: BaseException) -> None:
        """Count an exception, report it, and withhold the outputs for a while."""
        self.last_exception = f"{type(error).__name__}: {error}"
        if self.session is not None:
            self.session.health.fault(error, time.monotonic_ns())
            self.session.outputs.interrupt_commands()
        self.get_logger().error(self.last_exception, throttle_duration_sec=1.0)

    def late(self) -> None:
        """More comes than can be worked off; the middleware has dropped the rest."""
        if self.session is not None:
            self.session.health.unused["more messages came than could be read"] += 1

    def _tick(self) -> None:
        for service in self._answering:
            service.tick()
        session, now_ns = self.session, time.monotonic_ns()
        waited_s = (now_ns - self._reported_ns) * 1e-9
        if session is None:
            if waited_s >= REPORT_S:
                self._reported_ns = now_ns
                name = f"{self.get_name()}: outputs"
                self._diagnose([DiagnosticStatus(level=DiagnosticStatus.WARN, name=name, message="not configured")])
            return
        session.tick()
        self._ticks = (self._ticks + 1) % LOOK_TICKS
        if self._ticks == 0:
            own = self.get_name(), self.get_namespace()
            session.health.namesakes = self.get_node_names_and_namespaces().count(own) - 1
        elif self._ticks == LOOK_TICKS // 2:
            session.count_lost()
        news = now_ns - self._news_ns >= NEWS_S * 1e9 and session.untold
        if news:
            self._news_ns = now_ns
        if news:  # which a report that is under way may not tell any more
            self._urgent = 1 if self._reporting is None else 2
            self._telling.reset()
        elif self._urgent == 0 and (self._reporting is not None or waited_s >= REPORT_S):
            self._go_on_reporting(session, now_ns)
        if session.alarm:
            session.alarm = False
            write = session.window("the residual is not what it was")
            if write is not None:
                threading.Thread(target=self.guarded(self._write_window), args=(session, write), daemon=True).start()

    def _tell_on(self) -> None:
        """The next part of what is to be told at once."""
        session = self.session
        if session is None or self._urgent == 0:
            self._urgent = 0
            self._telling.cancel()
        elif not self._go_on_reporting(session, time.monotonic_ns()):
            self._urgent -= 1

    def _report(self, session: Session, monotonic_ns: int) -> None:
        """The whole report at once, after the rest of one that is under way."""
        if self._reporting is not None:
            self._finish_reporting(session, monotonic_ns)
        self._finish_reporting(session, monotonic_ns)

    def _finish_reporting(self, session: Session, monotonic_ns: int) -> None:
        while self._go_on_reporting(session, monotonic_ns):
            pass

    def _go_on_reporting(self, session: Session, monotonic_ns: int) -> bool:
        """One more status of the report, the last time the report itself: no torque waits for all of it. Whether it goes on."""
        if self._reporting is None:
            session.choose_clock()
            elapsed_s = (monotonic_ns - self._reported_ns) * 1e-9
            self._reported_ns = monotonic_ns
            self._reporting, self._statuses = session.statuses(monotonic_ns, elapsed_s), []
        status = next(self._reporting, None)
        if status is not None:
            self._statuses.append(status)
            return True
        self._reporting = None
        self._diagnose(self._statuses)
        self._console.tell(self._statuses, (monotonic_ns - self._began_ns) * 1e-9)
        if monotonic_ns - self._saved_ns >= self.settings.state_period_s * 1e9:
            self._begin_saving()
        return False

    def _diagnose(self, statuses: list[DiagnosticStatus]) -> None:
        message = DiagnosticArray(status=statuses)
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    # ------------------------------------------------- parameters and files

    def _check(self, changes: Sequence[Parameter]) -> SetParametersResult:
        try:
            check_files(changed(self, changes), [change.name for change in changes])
        except LugreSteeringError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _take_over(self, changes: Sequence[Parameter]) -> None:
        self.settings = changed(self, changes)
        if self.session is not None:
            self.session.change(self.settings)

    def _write_window(self, session: Session, write: Callable[[], tuple[Path, Part]]) -> None:
        """Write the window of an alarm; that a disk is full is no fault of the torques."""
        try:
            file, part = write()
        except OSError as error:
            session.health.window_trouble = str(error)
            self.get_logger().warning(f"window not written: {error}")
        else:
            session.health.window_trouble = ""
            missing = f" ({part.missing})" if part.missing else ""
            self.get_logger().warning(f"the model no longer matches: lugre-steering diagnose --window {file}{missing}")

    def _mark(self) -> Work:
        """Tell the mark in the report; with a folder for windows, write the one up to now, for diagnose."""
        session = self.session
        if session is None:
            return False, "the node is not configured"
        write = session.window("marked")
        if write is None:
            return True, f"marked at {session.health.mark}; no window, as parameter 'watch_folder' names no folder for them"
        try:
            file, part = yield write
        except OSError as error:
            return False, str(error)
        return True, "\n".join(filter(None, [str(file), f"{part.seconds:.1f} s", part.missing]))

    def _reload(self) -> Work:
        """Take over what ``vehicle_file`` says now, all of it or nothing."""
        session, file = self.session, self.settings.vehicle_file
        try:
            vehicle = yield lambda: self._prepared(session, file)
            if session is None or session is not self.session:
                raise DataError("the node is not configured")
            session.reload(vehicle, file)
            answer = True, f"'{vehicle.name}' taken over"
        except DataError as error:
            answer = False, f"{file}: {error}; cleanup and configure instead"
        except LugreSteeringError as error:
            answer = False, str(error)
        self.get_logger().info(f"reload: {answer[1]}")
        return answer

    def _prepared(self, session: Session | None, file: Path) -> Vehicle:
        """The vehicle file, with all that is called of it compiled."""
        vehicle = self._load(file)
        if session is not None:
            session.prepare(vehicle)
        return vehicle

    def _restore(self, session: Session) -> None:
        file = self.settings.state_file
        if file is None:
            self.get_logger().info("temperatures, bristles and what the watch learns are lost at the end: name a 'state_file' to keep them")
            return
        # The node in whose place this one comes may still be leaving.
        session.health.state_trouble = self._ownership.take(file, LEAVE_S + 1.0)
        if session.health.state_trouble:
            self.get_logger().warning(f"state not used: {session.health.state_trouble}")
            return
        if not file.exists():
            return
        self._remember_usual(session, file)
        if session.simulated:  # its clock comes as a topic, not before the first samples
            session.before_first = lambda stamp_ns: self._resume(session, file, stamp_ns)
        else:
            self._resume(session, file, time.time_ns())

    def _remember_usual(self, session: Session, file: Path) -> None:
        """What the watch has learned is as true after a year."""
        try:
            learned = read_learned(file, session.vehicle)
            if learned is not None:
                session.watch.resume(learned)
                self.get_logger().info(f"{file}: the watch goes on from {counted(session.watch.learned, 'manoeuvre')}")
        except DataError as error:
            self.get_logger().warning(f"the watch learns anew: {error}")

    def _resume(self, session: Session, file: Path, now_ns: int) -> None:
        try:
            session.estimator.resume(read_state(file, session.vehicle, now_ns, self.settings.state_max_age_s))
            self.get_logger().info(f"{file}: temperatures and bristles taken over")
        except DataError as error:
            self.get_logger().warning(f"state not used: {error}")

    def save(self) -> None:
        """Write the state file now."""
        if self._writer is not None:
            self._writer.join()
        self._to_write()()

    def _begin_saving(self) -> None:
        """Write the state file in a thread, unless it is being written: a disk may be slow."""
        if self._writer is None or not self._writer.is_alive():
            self._writer = threading.Thread(target=self._to_write(), daemon=True)
            self._writer.start()

    def _to_write(self) -> Callable[[], None]:
        """What writes the present state, if there is to be a file and anything to keep; a failure is told, not raised."""
        self._saved_ns = time.monotonic_ns()
        file, session = self.settings.state_file, self.session
        memory, learned, vehicle = None, None, None
        if session is not None:
            trouble = self._ownership.take(file) if file is not None else ""
            if file is None or trouble:
                session.health.state_trouble = trouble
            else:
                memory, learned, vehicle = session.estimator.memory, session.watch.memory, session.vehicle

        def write() -> None:
            if file is None or session is None or vehicle is None or not memory or not memory["sides"]:
                return
            try:
                write_state(file, vehicle, memory, learned)
                session.health.state_trouble = ""
            except (OSError, ValueError) as error:
                session.health.state_trouble = f"{file}: state cannot be written: {error}"
                self.get_logger().warning(session.health.state_trouble, throttle_duration_sec=30.0)

        return write
