"""What is felt of the contacts of a MuJoCo model, after a step: wrench, loss, and what is stored."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from passiflex.engines.contact import Contact, hand_geom
from passiflex.engines.felt import FELT
from passiflex.engines.mujoco_model import mujoco_module
from passiflex.loops.plant import Plant

Array = NDArray[np.float64]


class _Where(NamedTuple):
    """Where an element is in y = (x, energies): what is felt of it, and what it gave and lost."""

    wrench: slice
    lost: slice
    stored: slice
    given: slice
    loss: slice


class Touching:
    """Reads the contacts of a model into the states of the elements that stand for them (`Felt`).

    The force is that of the state as it is, by MuJoCo's own solver. What a contact loses is all that the hand gives to
    it but for what its spring takes up: the damper, the friction, and what is left of MuJoCo's mass in it.
    """

    def __init__(self, model: Any, data: Any, contacts: Mapping[str, Contact], plant: Plant):
        self._mujoco = mujoco_module()
        self._model, self._data = model, data
        self._of = {
            model.geom(hand_geom(name, i)).id: (name, contact.stiffness, contact.crossing)
            for name, contact in contacts.items()
            for i in range(len(contact.points))
        }
        state, energies, begin = plant.state.slices, plant.energies.slices, plant.state.size
        books = {e.name: e.books for e in plant.booked}
        self._at = {}
        for name in contacts:
            passed = (energies[flow] for flow in (books[name].given, books[name].name))
            sums = [slice(begin + at.start, begin + at.stop) for at in passed]
            self._at[name] = _Where(*(state[f"{name}_{part}"] for part in FELT), *sums)
        self.crosses = any(contact.crossing for contact in contacts.values())
        self._external = begin + energies["external"].start
        self._tip, self._force = model.site("tip").id, np.zeros(6)

    def cross(self) -> None:
        """Make the dampers of contacts grow with their depth, for this evaluation of MuJoCo's forces."""
        data = self._data
        for i in range(data.ncon):
            contact = data.contact[i]
            first, second = contact.geom.tolist()
            crossing = self._of[second if second in self._of else first][2]
            if crossing and contact.efc_address >= 0:
                k, _, d, _ = factors = data.efc_KBIP[contact.efc_address]
                factors[1] = k * d * crossing * max(0.0, -contact.dist)

    def feel(self, y: Array, given: float) -> None:
        """Write what is felt now, after the contacts gave so much energy to the links since it was written last [J].

        It is shared out by the forces then and now, where several touch.
        """
        held, share = {}, {}
        for name, at in self._at.items():
            held[name] = y[at.stored].item()
            share[name] = np.abs(y[at.wrench][:3]).sum()
            for part in at[: len(FELT)]:
                y[part] = 0.0
        for i in range(self._data.ncon):
            self._add(y, i)
        y[self._external] += given
        for name, at in self._at.items():
            share[name] += np.abs(y[at.wrench][:3]).sum()
        whole = sum(share.values())
        for name, at in self._at.items():
            own = given * (share[name] / whole if whole else 1 / len(self._at))
            y[at.given] += own
            y[at.loss] -= own + y[at.stored].item() - held[name]

    def _add(self, y: Array, i: int) -> None:
        """Add one contact to what is felt."""
        data, force = self._data, self._force
        contact = data.contact[i]
        if contact.efc_address < 0:
            return
        first, second = contact.geom.tolist()
        hand = second if second in self._of else first
        name, stiffness, _ = self._of[hand]
        at = self._at[name]
        self._mujoco.mj_contactForce(self._model, data, i, force)
        fx, fy, fz = pushed = (force[:3] if hand == second else -force[:3]) @ contact.frame.reshape(3, 3)
        x, y_, z = contact.pos - data.site_xpos[self._tip]
        wrench = y[at.wrench]
        wrench[:3] += pushed
        wrench[3:] += y_ * fz - z * fy, z * fx - x * fz, x * fy - y_ * fx
        depth = max(0.0, -contact.dist)
        speed = data.efc_vel[contact.efc_address : contact.efc_address + contact.dim]
        y[at.lost] += -stiffness * depth * speed[0] - force[: contact.dim] @ speed
        y[at.stored] += stiffness * depth**2 / 2
