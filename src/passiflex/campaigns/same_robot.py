"""Rows of one folder are of one robot: a campaign names its file, and the file may change."""

from __future__ import annotations

import hashlib
import re

import numpy as np

from passiflex.campaigns.campaign import Campaign
from passiflex.errors import PassiflexError
from passiflex.robots.flexible import FlexibleJointRobot

MARK = "# robot: "


class OtherRobotError(PassiflexError):
    """The robot's file is not what it was when the campaign began."""


def robot_digest(campaign: Campaign) -> str:
    """Return a digest of the numbers of the robot that a campaign names, as they are now.

    Raises
    ------
    PassiflexError
        If it cannot be read.
    """
    robot = FlexibleJointRobot.load(campaign.scenario.robot)
    numbers = [*robot.nominal().values(), robot.torque_limit, robot.velocity_limit, robot.position_limit]
    return hashlib.sha256(b"".join(np.asarray(n, dtype=float).tobytes() for n in numbers)).hexdigest()[:16]


def marked(text: str, digest: str) -> str:
    """Return a campaign's text that says which robot it is of."""
    return f"{text}{MARK}{digest}\n"


def require_same_robot(campaign: Campaign, text: str) -> None:
    """Raise OtherRobotError if a campaign's text is marked with another robot than its file now holds."""
    found = re.search(rf"^{MARK}(\w+)$", text, re.MULTILINE)
    now = robot_digest(campaign)
    if found is not None and found[1] != now:
        raise OtherRobotError(
            f"robot {campaign.scenario.robot!r} is not what it was when the campaign began",
            got=f"digest {now}",
            needs=found[1],
            try_="its file as it was, or another folder",
        )
