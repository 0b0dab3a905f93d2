"""The energy ledger of a run, and the verdict on its passivity."""

from passiflex.passivity.audit import Audit as Audit
from passiflex.passivity.audit import audit as audit
from passiflex.passivity.audit import audit_if_possible as audit_if_possible
from passiflex.passivity.extremes import available_energy as available_energy
from passiflex.passivity.ledger import Balance as Balance
from passiflex.passivity.ledger import claimed_balance as claimed_balance
from passiflex.passivity.ledger import environment_balance as environment_balance
from passiflex.passivity.ledger import link_balance as link_balance
from passiflex.passivity.ledger import overclaimed as overclaimed
from passiflex.passivity.ledger import port_tank as port_tank
from passiflex.passivity.ledger import robot_balance as robot_balance
