"""What is felt of the contacts of a MuJoCo model, after a step: wrench, loss, and what is stored."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from passiflex.engines.contact import Contact, hand_geom
from passiflex.engines.felt import FELT
from passiflex.engines.mujoco_model import mujoco_module
from passiflex.layout import Layout

Array = NDArray[np.float64]


class Touching:
    """Reads the contacts of a model into the states of the elements that stand for them (`Felt`).

    The force is that of the state as it is, by MuJoCo's own solver. What a contact loses is all that the hand gives to
    it but for what its spring takes up: the damper, the friction, and what is left of MuJoCo's mass in it.
    """

    def __init__(self, model: Any, data: Any, contacts: Mapping[str, Contact], state: Layout):
        self._mujoco = mujoco_module()
        self._model, self._data = model, data
        self._of = {
            model.geom(hand_geom(name, i)).id: (name, contact.stiffness)
            for name, contact in contacts.items()
            for i in range(len(contact.points))
        }
        self._at = {name: [state.slices[f"{name}_{part}"] for part in FELT] for name in contacts}
        self._tip, self._force = model.site("tip").id, np.zeros(6)

    def any(self) -> bool:
        """Return whether anything touches."""
        return bool(self._of) and self._data.ncon > 0

    def feel(self, x: Array) -> None:
        """Write what is felt into a state."""
        if not self._of:
            return
        for parts in self._at.values():
            for part in parts:
                x[part] = 0.0
        data, force = self._data, self._force
        for i in range(data.ncon):
            contact = data.contact[i]
            first, second = contact.geom
            hand = second if second in self._of else first
            if contact.efc_address < 0:
                continue
            name, stiffness = self._of[hand]
            wrench, lost, stored = self._at[name]
            self._mujoco.mj_contactForce(self._model, data, i, force)
            frame = contact.frame.reshape(3, 3)
            pushed = (frame.T @ force[:3]) * (1.0 if hand == second else -1.0)
            x[wrench][:3] += pushed
            x[wrench][3:] += np.cross(contact.pos - data.site_xpos[self._tip], pushed)
            depth, rows = (
                max(0.0, -contact.dist),
                slice(contact.efc_address, contact.efc_address + contact.dim),
            )
            speed = data.efc_vel[rows]
            x[lost] += stiffness * depth * speed[0] - force[: contact.dim] @ speed
            x[stored] += stiffness * depth**2 / 2
