"""The law of a scenario as a folder of C99: no allocation, no files, no globals, the math library alone."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from passiflex.errors import NameUnknownError
from passiflex.exports.law_rows import test_rows
from passiflex.exports.law_text import functions_text, listed, parts_text, struct_text, values_text
from passiflex.files import OutputError, as_path
from passiflex.onboard import Controller, Sensed, WatchSettings
from passiflex.scenarios.scenario import Scenario
from passiflex.scenarios.sensor_settings import SensorSettings
from passiflex.version import __version__

Array = NDArray[np.float64]

AS_THEY_ARE = ("Makefile", "CMakeLists.txt", "test_pf_law.c", "example.c", "pf_law.hpp")


def export_law(
    scenario: Scenario | str | Path,
    out: str | Path,
    says: Sequence[str] | None = None,
    watch: WatchSettings | None = None,
    *,
    weight_in_readings: bool | None = None,
) -> Path:
    """Write the law of a scenario as C into a folder, and return its path; `make check` there compares it with Python.

    Parameters
    ----------
    says: What the robot says, of q, theta, dq, dtheta, tau_a, F_e, applied; the scenario's `sensors.says` if left out.
    watch, weight_in_readings: As of `Controller`.

    Raises
    ------
    UnstableLoopError
        If the loop is unstable with what the robot says.
    OutputError
        If the folder holds something else already.
    """
    folder = as_path(out, "the folder to write")
    if folder.exists() and (
        not folder.is_dir() or (os.listdir(folder) and not (folder / "pf_law.h").exists())
    ):
        raise OutputError(
            "the folder to write is none, or holds something else", got=str(folder), needs="a new one"
        )
    controller = Controller(scenario, watch, weight_in_readings=weight_in_readings)
    for name in says or ():
        if name not in Sensed._fields:
            raise NameUnknownError("thing that a robot says", name, Sensed._fields)
    told = says or (controller.scenario.sensors or SensorSettings()).says
    start = _standing(controller, told)
    controller.start(start)
    folder.mkdir(parents=True, exist_ok=True)
    ours = resources.files("passiflex.exports").joinpath("law")
    for name in AS_THEY_ARE:
        (folder / name).write_text(ours.joinpath(name).read_text(encoding="utf-8"), encoding="utf-8")
    functions = {"PF_LAW_STEP": controller.law.function, "PF_LAW_BEGIN": controller.law.begin}
    body = ours.joinpath("pf_law_body.c").read_text(encoding="utf-8")
    (folder / "pf_law_functions.c").write_text(functions_text(functions), encoding="utf-8")
    (folder / "pf_law.h").write_text(_header(controller), encoding="utf-8")
    (folder / "pf_law.c").write_text(body + _data(controller, start), encoding="utf-8")
    (folder / "numbers.yaml").write_text(_numbers(controller), encoding="utf-8")
    with (folder / "test_rows.txt").open("w", encoding="ascii") as rows:
        rows.writelines(test_rows(controller, start))
    return folder


def _standing(controller: Controller, says: Sequence[str]) -> Sensed:
    """Return what a robot says that stands where the scenario has it."""
    problem, n = controller.problem, controller.law.robot.n
    weight = problem.held if controller.scenario.law.gravity != "robot" else np.zeros(n)
    still = {
        "q": problem.q,
        "theta": problem.theta,
        "dq": np.zeros(n),
        "dtheta": np.zeros(n),
        "tau_a": weight,
        "F_e": np.zeros(6),
        "applied": weight,
    }
    return Sensed(**{name: still[name] for name in says})


def _header(controller: Controller) -> str:
    law, problem = controller.law, controller.problem
    says = [name for name in Sensed._fields if _says(controller, name)]
    sizes = {
        "JOINTS": law.robot.n,
        "SAID": law.said.size,
        "SETPOINT": law.setpoint.size,
        "MEMORY": law.memory.size,
        "NUMBERS": law.parameters.size,
        "SIGNALS": law.signals.size,
        "MEASURED": law.period.measurement.size,
    }
    return "\n".join(
        [
            f"/* The law of {problem.name!r} for {law.robot.name}, by passiflex {__version__}.",
            "",
            f"   Made for {1 / problem.period:g} Hz, a delay of {1e3 * problem.delay:g} ms, and a robot that says",
            f"   {', '.join(says)}.",
            "   All units are SI. Matrices are stored row by row. Nothing here allocates, locks, or reads a clock. */",
            "#ifndef PF_LAW_H",
            "#define PF_LAW_H",
            "",
            "#ifdef __cplusplus",
            'extern "C" {',
            "#endif",
            "",
            *(f"#define PF_LAW_{name} {size}" for name, size in sizes.items()),
            f"#define PF_LAW_PERIOD {problem.period!r} /* s */",
            f"#define PF_LAW_LEVEL {problem.tank.initial!r} /* J: of the tank at the start */",
            "",
            struct_text(
                "pf_law_said",
                "What the robot says in a period; what it does not say is not looked at.",
                law.said,
            ),
            struct_text(
                "pf_law_setpoint",
                "What is asked for. pf_law_step sets fresh, pf_law_stop and _resume run.",
                law.setpoint,
            ),
            struct_text(
                "pf_law_memory", "What is remembered from period to period: copy it to keep it.", law.memory
            ),
            struct_text("pf_law_signals", "What is said of a period.", law.signals),
            parts_text(
                "pf_law_numbers",
                "The numbers of law, robot and watch; numbers.yaml has them to read.",
                law.parameters,
            ),
            _PROMISES,
        ]
    )


_PROMISES = """\
typedef struct {
    pf_law_memory memory;
    pf_law_setpoint setpoint;
    pf_law_numbers numbers;
    pf_law_signals signals;
    double torque[PF_LAW_JOINTS]; /* N m: what to send, within limits and rate limits */
    int asked;
} pf_law;

/* All return 0, or not 0 if an iteration inside failed: the torque is then the one before. */

/* Begin where the robot stands, with a full tank. */
int pf_law_init(pf_law *law, const pf_law_said *said);
/* Begin anew, as after a reflex, with a level of the tank [J], as law->memory.tank_energy. */
int pf_law_reset_at(pf_law *law, const pf_law_said *said, double level);
/* One period: law->torque is what to send. setpoint is NULL if there is no new one. */
int pf_law_step(pf_law *law, const pf_law_said *said, const pf_law_setpoint *setpoint);
/* Let the arm go softly, and take it again. */
void pf_law_stop(pf_law *law);
void pf_law_resume(pf_law *law);
int pf_law_stopped(const pf_law *law);

extern const pf_law_numbers pf_law_default_numbers;
extern const pf_law_said pf_law_example_said; /* of a robot that stands where the scenario has it */

#ifdef __cplusplus
}
#endif

#endif
"""


def _data(controller: Controller, start: Sensed) -> str:
    law, numbers = controller.law, controller.inputs["numbers"]
    said = law.said.zeros() | {"elapsed": np.array(controller.period)}
    said |= {name: np.asarray(v, dtype=float) for name, v in start._asdict().items() if v is not None}
    example = ",\n".join(f"    .{name} = {listed(value)}" for name, value in said.items())
    return (
        f"\nconst pf_law_numbers pf_law_default_numbers = {{\n{values_text(law.parameters, numbers)}\n}};\n"
        f"\nconst pf_law_said pf_law_example_said = {{\n{example}\n}};\n"
    )


def _numbers(controller: Controller) -> str:
    """Return all numbers with units and meanings, to be read."""
    law, flat = controller.law, controller.inputs["numbers"]
    tree = {
        part: {
            f.name: {"value": values[f.name].tolist(), "unit": f.unit, "meaning": f.meaning}
            for values in [layout.unpack(flat[law.parameters.slices[part]])]
            for f in layout
        }
        for part, layout in law.parameters.layouts.items()
    }
    return yaml.safe_dump(tree, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110)


def _says(controller: Controller, name: str) -> bool:
    parts = controller.law.parameters
    return bool(parts.unpack("robot", controller.inputs["numbers"])[f"says_{name}"] > 0)
