"""The law on a robot: one controller, stepped from Python or exported as C."""

from passiflex.onboard.controller import Controller as Controller
from passiflex.onboard.guard import Guard as Guard
from passiflex.onboard.guard_server import GuardClient as GuardClient
from passiflex.onboard.guard_server import GuardServer as GuardServer
from passiflex.onboard.run_on import Ran as Ran
from passiflex.onboard.run_on import run_on as run_on
from passiflex.onboard.sensed import Sensed as Sensed
from passiflex.onboard.setpoint import Setpoint as Setpoint
from passiflex.onboard.settings import ApproachSettings as ApproachSettings
from passiflex.onboard.settings import WatchSettings as WatchSettings
from passiflex.onboard.twin import Twin as Twin
