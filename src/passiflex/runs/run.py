"""The result of a simulation: signals with units, and everything needed to make it again."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from passiflex.elements import Books, MotorFriction
from passiflex.errors import FrozenError, RunFileError
from passiflex.files import as_path, read_json, whole_file
from passiflex.layout import Layout
from passiflex.loops.plant import Plant
from passiflex.loops.witness import Noted
from passiflex.origin import package_version, source_commit
from passiflex.problems.own_parts import parts_said
from passiflex.problems.problem import SampledProblem
from passiflex.problems.unbooked import UNKNOWN, unbooked
from passiflex.robots.flexible import FlexibleJointRobot
from passiflex.runs.run_attributes import renamed, wrong_attributes, wrong_units
from passiflex.runs.run_bounds import require_bounded
from passiflex.runs.run_file import FORMAT, cut_short, defects, foreign, require_file, unreadable
from passiflex.runs.run_scenario import scenario_of_text
from passiflex.scenarios.scenario import Scenario

if TYPE_CHECKING:
    from passiflex.problems.problem import Problem

JOINT_PARAMETERS = ("joint_stiffness", "joint_damping", "motor_inertia")
"""Of the robot as described: with the arm's description they make it again, without its file."""
AS_READ = "a robot"
"""Engine of a run that a robot's own readings make."""
COORDINATES = {
    "axis": ["x", "y", "z"],
    "column": ["x", "y", "z"],
    "component": ["fx", "fy", "fz", "mx", "my", "mz"],
}


@dataclass(frozen=True, eq=False)
class Run:
    """A simulated run.

    Attributes
    ----------
    data: All signals over time, and what was noted at every step between the rows (`Witness.extremes`); every
        variable has the attributes `units` and `long_name`. Energies (`*_energy`) are in J since the start,
        powers (`*_power`) in W.
    """

    data: xr.Dataset

    @property
    def name(self) -> str:
        """Return the name of the scenario."""
        return str(self.data.attrs["name"])

    @property
    def scenario(self) -> Scenario | None:
        """Return the scenario that it was made from; None where the run carries none that can be read."""
        return scenario_of_text(str(self.data.attrs.get("scenario", "")))

    @property
    def own_parts(self) -> str:
        """Return the parts that no scenario has, by their classes; empty for most runs."""
        return parts_said(str(self.data.attrs.get("scenario", "")))

    @property
    def engine(self) -> str:
        """Return what moved the plant, with its version; empty in a file of before, when there was one way."""
        return str(self.data.attrs.get("engine", ""))

    @property
    def moved_elsewhere(self) -> bool:
        """Return whether another simulator moved the plant."""
        return bool(self.engine) and not self.engine.startswith("passiflex")

    @property
    def as_read(self) -> bool:
        """Return whether it is what a robot said of itself, and nobody else saw where that was."""
        return self.engine == AS_READ

    @property
    def sampled(self) -> bool:
        """Return whether the law ran once per control period."""
        return bool(self.data.attrs["control_period"])

    @property
    def has_tank(self) -> bool:
        """Return whether the law has a tank."""
        return bool(self.data.attrs["has_tank"])

    @property
    def failure(self) -> str:
        """Return why the run ended early; empty if it did not."""
        return str(self.data.attrs["failure"]) or cut_short(self.data)

    @property
    def unbooked(self) -> str:
        """Return what the law's books do not know in this run, in words."""
        return str(self.data.attrs.get("unbooked", UNKNOWN))

    @property
    def elements(self) -> tuple[Books, ...]:
        """Return what touched the robot; a sampled run of before had friction alone in its books."""
        found = read_json(self.data.attrs.get("elements", "[]"))
        if "elements" not in self.data.attrs and self.sampled:
            return (MotorFriction().books,)
        return tuple(Books(*entry) for entry in found)

    @property
    def events(self) -> list[dict[str, Any]]:
        """Return what happened at single instants, as the jumps of the reference and what they cost."""
        return list(read_json(self.data.attrs["events"]))

    @property
    def time(self) -> NDArray[np.float64]:
        """Return the time [s]."""
        return self.data["time"].to_numpy()

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return a signal as an array; time is the first axis."""
        return self.data[name].to_numpy()

    def every(self, rows: int) -> Run:
        """Return the run with one of so many rows; energies are sums since the start, so none is lost."""
        return Run(self.data.isel(time=slice(None, None, rows)))

    def save(self, path: str | Path) -> Path:
        """Write one netCDF4 file, whole or not at all, and return its path."""
        path = Path(path)
        rows = [v for v, values in self.data.data_vars.items() if values.ndim]
        compressed = {v: {"zlib": True, "complevel": 4, "shuffle": True} for v in rows}
        with whole_file(path) as temporary:
            self.data.to_netcdf(temporary, engine="h5netcdf", encoding=compressed)
        return path

    def show(self, out: str | Path | None = None, compare: Sequence[Run | str | Path] = ()) -> Path:
        """Write the run as one HTML file that can be looked at and sent, and return its path.

        Without `out` it lies in a temporary folder and is opened in the browser, where there is a screen.

        Parameters
        ----------
        compare: Runs to show beside this one, or the paths of their files.
        """
        from passiflex.reports import show

        beside = [compare] if isinstance(compare, Run | str | Path) else compare
        return show(self, out, [run if isinstance(run, Run) else Run.load(run) for run in beside])

    @classmethod
    def load(cls, path: str | Path) -> Run:
        """Read a run.

        Raises
        ------
        RunFileError
            If the file is not there, or is not a run of this package; `salvage` reads what is left of one.
        """
        path = as_path(path, "the file of a run")
        require_file(path)
        try:
            require_bounded(path)
            data = renamed(xr.load_dataset(path, engine="h5netcdf"))
        except RunFileError:
            raise
        except Exception as error:  # the readers raise many kinds for a file that is no netCDF
            raise unreadable(path, error) from error
        if data.attrs.get("format") != FORMAT:
            raise foreign(path, data)
        if wrong := wrong_attributes(data.attrs):
            got = "; ".join(f"{name}: {why}" for name, why in wrong.items())
            raise RunFileError(f"{path} says what no run says", got=got)
        if units := wrong_units(data):
            raise RunFileError(f"{path} has signals whose units are no text", got=", ".join(units))
        missing, broken = defects(data)
        if missing or not data.sizes.get("time"):
            got = f"no {', '.join(missing)}" if missing else "no rows"
            raise RunFileError(f"{path} is not a complete run", got=got)
        if broken:
            raise RunFileError(f"{path} has numbers that are not finite", got=f"in {', '.join(broken)}")
        return cls(data)


def _refuse_change(run: Run, name: str, *value: object) -> NoReturn:
    """Raise FrozenError."""
    got = f"{name} = ..." if value else f"del {name}"
    raise FrozenError("Run", got, "Run(run.data.assign(...))")


Run.__setattr__ = Run.__delattr__ = _refuse_change  # type: ignore[assignment,method-assign]


class Recorded(NamedTuple):
    """Recorded rows: what each column is, and the numbers (N, size)."""

    layout: Layout
    numbers: NDArray[np.float64]


def assemble(
    problem: Problem,
    time: NDArray[np.float64],
    recorded: Sequence[Recorded],
    events: list[dict[str, Any]],
    failure: str,
    noted: Noted,
    engine: str,
) -> Run:
    """Return the run of recorded rows, and of what was noted at every step, by the engine that moved the plant."""
    variables: dict[str, Any] = {}
    for layout, numbers in recorded:
        values = layout.unpack(numbers)
        for f in layout:
            variables[f.name] = (
                ("time", *f.dims), values[f.name], {"units": f.unit, "long_name": f.meaning},
            )  # fmt: skip
    for f in noted.layout:
        about = {"units": f.unit, "long_name": f.meaning}
        variables[f.name] = (("joint",) * len(f.shape), noted.values[f.name], about)
    robot = problem.law.robot
    variables |= _limits(robot)
    used = {d for dims, *_ in variables.values() for d in dims}
    coordinates: dict[str, Any] = {k: v for k, v in COORDINATES.items() if k in used}
    coordinates["joint"] = np.arange(1, robot.n + 1)
    coordinates["time"] = ("time", time, {"units": "s", "long_name": "time"})
    attributes = _attributes(problem) | {"events": json.dumps(events), "failure": failure, "engine": engine}
    return Run(xr.Dataset(variables, coordinates, attributes))


def _limits(robot: FlexibleJointRobot) -> dict[str, Any]:
    """Return the robot's limits as variables of a run."""
    angle, speed, torque = robot.arm.chain.joint_units
    limits = (
        ("torque_limit", robot.torque_limit, torque),
        ("velocity_limit", robot.velocity_limit, speed),
        ("lower_position_limit", robot.position_limit[:, 0], angle),
        ("upper_position_limit", robot.position_limit[:, 1], angle),
    )
    return {name: (("joint",), v, {"units": unit, "long_name": "of the robot"}) for name, v, unit in limits}


def _attributes(problem: Problem) -> dict[str, Any]:
    """Return what a run says of its problem."""
    robot = problem.law.robot
    return {
        "format": FORMAT,
        "name": problem.name,
        "robot": robot.name,
        "robot_description": _description(problem),
        "joint_parameters": json.dumps({name: getattr(robot, name).tolist() for name in JOINT_PARAMETERS}),
        "law": type(problem.law).__name__,
        "scenario": problem.text,
        "sources": json.dumps(robot.sources, ensure_ascii=False),
        "seed": problem.seed,
        "unbooked": unbooked(problem),
        "elements": json.dumps([e.books for e in Plant(robot, problem.elements).booked]),
        "has_tank": int(problem.law.has_tank),
        "control_period": problem.period if isinstance(problem, SampledProblem) else 0.0,
        "version": package_version(),
        "commit": source_commit(),
        "duration": problem.duration,
        "tolerance": problem.tolerance,
    }


def _description(problem: Problem) -> str:
    """Return the robot with its tool as URDF, so that whoever has the file can draw it."""
    robot = problem.law.robot
    plant = robot.layout.unpack(problem.plant)
    arm = replace(robot.arm.chain, tip_xyz=plant["tool_position"], tip_rotation=plant["tool_rotation"])
    return arm.to_urdf(own_names=True)
