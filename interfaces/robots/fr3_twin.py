"""A simulated Franka Research 3 behind libfranka's protocol, with a Net F/T sensor: only its address tells it from one.

The server is that of franky-sim. Its physics is replaced by `TorqueArm`: the arm of the scenario, its compliance, the
peg, and the hole with exact contact. What franky-sim leaves out and a real arm has is added here: a velocity command
that holds a position, the estimate of the external wrench, and stops by itself (`_Server`).
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from franky_sim.base_simulator import BaseRobot, BaseSimulator, InnerRobotState, RobotParameters
from franky_sim.franka_robot_protocol import (
    AutomaticErrorRecoveryCommand,
    BaseCommand,
    MoveStatus,
    RobotCommand,
    RobotMode,
    SetCollisionBehaviorCommand,
    SetJointImpedanceCommand,
)
from franky_sim.franka_robot_server import FrankaRobotServer
from franky_sim.franka_robot_state import FrankaRobotState
from franky_sim.simulation_server import SimulationServer
from pydrake.geometry import Meshcat

from experiments.trial.trial_set import TrialSet, trial_scenario
from interfaces.sensors.net_ft_server import NetFtServer
from models.hardware import GRAVITY
from models.scenario import Scenario
from skill.arrays import Array
from systems.arm.arm_bodies import PERIOD
from systems.arm.tip_servo import tip_at, tip_pose
from systems.arm.torque_arm import TorqueArm
from systems.math.noise import standard_normal

logging.getLogger("franky_sim").setLevel(logging.ERROR)  # it warns of frames that are only stored

READY_HEIGHT = 0.08
"""Height of the tip over the mouth at the start, m."""

SENSOR_PORT, SENSOR_PAGE_PORT = 49152, 8049
"""Ports of the sensor; a real one has its page at 80, which a program may not take without permission."""

AWAY_HEIGHT, NEAR_HEIGHT = 0.025, 0.005
"""Heights of the tip, m: once it was below the second and is above the first, the next hole is there."""

TORQUE_BIAS, TORQUE_NOISE = 0.3, 0.05
"""Standard deviations of the error of an estimated joint torque, N m, constant and from step to step [choice]. They
give the flange errors of one to two newtons, as people report (franka_ros, issue 404)."""

ESTIMATE_TIME = 10e-3
"""Time constant of the estimate of the external wrench, s [choice]."""

CATCH_UP = 0.02
"""Time by which the clock of the arm may run faster than its speed after it was held up, s."""

LOST_COMMANDS = 20
"""Missing commands in a row after which the arm stops by itself, as a real one does."""

JOINT_REFLEX, CARTESIAN_REFLEX, COMMUNICATION = 6, 7, 25
"""Places in a state of the errors that libfranka names ``joint_reflex``, ``cartesian_reflex`` and
``communication_constraints_violation``."""


@dataclass(frozen=True)
class Insertion:
    """What has become of one hole.

    Attributes:
        number: of the trial.
        time: of the end, on the clock of the arm, s.
        depth: largest depth of the tip along the hole, m.
        peak_force: largest sum of the normal forces on the peg, N.
    """

    number: int
    time: float
    depth: float
    peak_force: float


class _Robot(BaseRobot):
    """The arm, as the server of franky-sim asks for it."""

    def __init__(self, arm: TorqueArm, seed: int) -> None:
        # A mass of zero would be divided by.
        flange = RobotParameters(ee_mass=1e-6, ee_com=(0.0,) * 3, ee_tcp_xyz=(0.0,) * 3, ee_tcp_rpy=(0.0,) * 3)
        super().__init__(robot_parameters=flange, kp=tuple(arm.stiffness), kv=tuple(arm.damping), has_gripper=False)
        self.arm, self.torques = arm, np.zeros(7)
        self._seed, self._tick = seed, 0
        self._bias = TORQUE_BIAS * standard_normal(seed, "bias of the joint torques", 0, 7)
        self._command, self._rate = arm.angles, np.zeros(7)
        self.estimate, self.wrench = self._bias.copy(), np.zeros(6)
        self.upper_force, self.upper_torque = np.full(6, np.inf), np.full(7, np.inf)

    def set_stiffness(self, stiffness: Sequence[float]) -> None:
        """Sets the stiffness of the joints (7,), N m/rad, and damping in proportion."""
        wanted, arm = np.array(stiffness), self.arm
        self.kp, self.kv = wanted, arm.damping * np.sqrt(wanted / arm.stiffness)

    def step(self) -> None:
        """Advances the arm with the last torques, and its estimate of the wrench of the world on it."""
        arm, error = self.arm, self.arm.scenario.arm.gravity_error
        arm.advance(self.torques + error * arm.kinematics.weight_torques(arm.angles, 0.0))
        self._tick += 1
        noise = TORQUE_NOISE * standard_normal(self._seed, "noise of the joint torques", self._tick, 7)
        angles, (force, moment) = arm.angles, np.split(arm.world_wrench(), 2)
        J, X_WF = arm.kinematics.jacobian(angles), arm.kinematics.flange(angles)  # J is that of the tip
        p_tip = arm.kinematics.tip(angles).translation()
        # The weight of what the arm was told to carry is no wrench of the world.
        load = np.array([0.0, 0.0, self.m_load * GRAVITY])
        moment = moment + np.cross(X_WF @ np.array(self.F_x_Cload) - p_tip, load)
        torques = J.T @ np.concatenate([moment, force + load]) + self._bias + noise
        self.estimate = self.estimate + PERIOD / ESTIMATE_TIME * (torques - self.estimate)
        moment, force = np.split(np.linalg.solve(J @ J.T, J @ self.estimate), 2)
        # libfranka reports the force of the arm on the world (libfranka, issue 26), here about the flange.
        self.wrench = -np.concatenate([force, moment - np.cross(X_WF.translation() - p_tip, force)])

    def collides(self) -> int | None:
        """Returns the error of an estimate beyond the limits, if it is."""
        if (np.abs(self.wrench) > self.upper_force).any():
            return CARTESIAN_REFLEX
        return JOINT_REFLEX if (np.abs(self.estimate) > self.upper_torque).any() else None

    @property
    def state(self) -> FrankaRobotState:
        """The state, with what franky-sim leaves empty."""
        return super().state.replace(
            q_d=tuple(self._command),
            tau_ext_hat_filtered=tuple(self.estimate),
            O_F_ext_hat_K=tuple(self.wrench),
        )

    def _get_state(self) -> InnerRobotState:
        return InnerRobotState(tuple(self.arm.angles), tuple(self.arm.rates), tuple(self.torques))

    def torque_control(self, torques: Sequence[float], has_new_command: bool = True) -> None:
        """Takes torques beside the weight; where they end, the joints are held as they are."""
        self._command = self.arm.angles
        super().torque_control(torques, has_new_command)

    def _torque_control(self, torques: Array) -> None:
        self.torques = np.asarray(torques)

    def _joint_position_control(self, target_q: Array) -> None:
        self._rate = (target_q - self._command) / PERIOD
        self._command = np.array(target_q)
        self._hold()

    def _joint_velocity_control(self, target_dq: Array) -> None:
        """A real arm integrates the rates and holds the angles; franky-sim damps the rates only."""
        self._rate = np.array(target_dq)
        self._command = self._command + PERIOD * self._rate
        self._hold()

    def _hold(self) -> None:
        arm = self.arm
        super().torque_control(self.kp * (self._command - arm.angles) + self.kv * (self._rate - arm.rates))

    def set_hand_goal(self, width: float, max_velocity: float, max_force: float) -> None:
        """There is no hand."""

    def _get_hand_width(self) -> float:
        return 0.0


class _Server(FrankaRobotServer):
    """Stops a motion by itself where a real arm does: without commands, and at a force beyond its limits."""

    def __init__(self, robot: _Robot, hostnames: Sequence[str]) -> None:
        super().__init__(robot, hostnames)
        self._missing = 0
        self._errors: tuple[int, ...] = ()
        # franky-sim acknowledges these commands and ignores them.
        commands = self._FrankaServer__command_class_map
        commands[RobotCommand.kSetCollisionBehavior] = _CollisionBehavior
        commands[RobotCommand.kSetJointImpedance] = _JointImpedance
        commands[RobotCommand.kAutomaticErrorRecovery] = _ErrorRecovery

    def recover(self) -> None:
        """Forgets the errors."""
        self._errors = ()

    def start_motion(self, *args: Any) -> None:
        """Begins a motion, unless an error has not been recovered from."""
        if self._errors:
            raise ValueError("an error has not been recovered from")
        self._missing = 0
        super().start_motion(*args)

    def _handle_udp_command(self, command_data: bytes) -> None:
        self._missing = -1
        super()._handle_udp_command(command_data)

    def _post_process_commands(self) -> None:
        self._missing += 1
        if self.current_motion_id:
            error = COMMUNICATION if self._missing > LOST_COMMANDS else self.robot.collides()
            if error is not None:
                self._abort(error)
        super()._post_process_commands()

    def _abort(self, error: int) -> None:
        number = self.current_motion_id
        self._errors = (error,)
        self.reset_current_motion_id()
        self.stop_motion(send_preemption_signal=False)
        BaseCommand.send_response(self._tcp_socket, RobotCommand.kMove, number, MoveStatus.kReflexAborted)

    def _reset_state(self) -> None:
        super()._reset_state()
        self._errors = ()

    @property
    def robot_state(self) -> FrankaRobotState:
        """The state with its errors."""
        state = super().robot_state
        if not self._errors:
            return state
        flags = tuple(place in self._errors for place in range(41))
        return state.replace(robot_mode=RobotMode.kReflex, errors=flags, reflex_reason=flags)


class _CollisionBehavior(SetCollisionBehaviorCommand):
    """Sets the limits of the estimated wrench and torques; accelerations and contacts are not told apart."""

    def handle(self, server: _Server) -> None:
        server.robot.upper_torque = np.array(self.upper_torque_thresholds_nominal)
        server.robot.upper_force = np.array(self.upper_force_thresholds_nominal)
        self.reply(0)


class _JointImpedance(SetJointImpedanceCommand):
    """Sets the stiffness of the joints."""

    def handle(self, server: _Server) -> None:
        server.robot.set_stiffness(self.K_theta)
        self.reply(0)


class _ErrorRecovery(AutomaticErrorRecoveryCommand):
    """Forgets the errors."""

    def handle(self, server: _Server) -> None:
        server.recover()
        super().handle(server)


class _Simulator(BaseSimulator):
    """A simulator of one robot that calls a function after each step."""

    def __init__(self, robot: _Robot, after: Callable[[], None]) -> None:
        super().__init__()
        self._robot, self._after = robot, after

    def _get_robots(self) -> list[BaseRobot]:
        return [self._robot]

    def _step(self) -> None:
        self._robot.step()
        self._after()


class _SimulationServer(SimulationServer):
    """Serves by `_Server`."""

    def init(self) -> None:
        """Binds the address, and starts the simulation."""
        (robot,) = self.sim.robots
        server = _Server(robot, list(self._hostname_candidates))
        server.init()
        self.robot_servers.append(server)
        self.sim.start()


class Fr3Twin:
    """An arm over a hole of a scenario; each hole is that of a trial, and the next one is there once the arm is away.

    Attributes:
        arm: the arm.
        sensor: the server of the sensor.

    Args:
        scenario: of the arm.
        seed: number of the first trial.
        trials: which trials the holes are of.
        host: address to serve at, of this machine.
        ended: what is called with what has become of each hole.
        meshcat: where to draw; None draws nothing.

    Raises:
        OSError: if the address is taken.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        seed: int,
        trials: TrialSet,
        host: str,
        ended: Callable[[Insertion], None],
        meshcat: Meshcat | None = None,
    ) -> None:
        self._scenario, self._number, self._trials, self._ended = scenario, seed, trials, ended
        first = trial_scenario(scenario, number=seed, trial_set=trials)
        self.arm = TorqueArm(first, meshcat=meshcat)
        self.arm.set_start(self.arm.kinematics.angles_at(tip_pose(np.zeros(3), tip_at(READY_HEIGHT))))
        self.arm.set_trial(first)
        self._depth = self._force = 0.0
        self._was_near = False
        self.sensor = NetFtServer(host, SENSOR_PORT, SENSOR_PAGE_PORT)
        self._server = _SimulationServer(_Simulator(_Robot(self.arm, seed), self._after_step), [host])

    def run(self, speed: float) -> None:
        """Serves until it is interrupted.

        Args:
            speed: of the clock of the arm, at most, in units of real time.
        """
        with self._server.sim, self._server:
            (robot,) = self._server.robot_servers
            due = time.perf_counter()
            while True:
                robot.process_commands()
                self._server.sim.step()
                robot.send_state()
                due = max(due + PERIOD / speed, time.perf_counter() - CATCH_UP)
                early = due - time.perf_counter()
                if early > 0.0:  # even a sleep of no time lets other programs run first
                    time.sleep(early)

    def close(self) -> None:
        """Frees the address of the sensor."""
        self.sensor.close()

    def _after_step(self) -> None:
        arm = self.arm
        self.sensor.send(arm.reading())
        height = float(arm.peg_in_hole().translation()[2])
        self._depth, self._force = max(self._depth, -height), max(self._force, arm.contact_force())
        self._was_near |= height < NEAR_HEIGHT
        if self._was_near and height > AWAY_HEIGHT:
            self._ended(Insertion(self._number, arm.time, self._depth, self._force))
            self._number, self._depth, self._force, self._was_near = self._number + 1, 0.0, 0.0, False
            arm.set_trial(trial_scenario(self._scenario, number=self._number, trial_set=self._trials))
