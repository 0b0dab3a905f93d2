"""What there is to look at in a run: diagrams of its signals over time, with the events that explain them."""

from passiflex.diagrams.contact import surface_role as surface_role
from passiflex.diagrams.contact import touched as touched
from passiflex.diagrams.events import marks_of as marks_of
from passiflex.diagrams.events import spans_of as spans_of
from passiflex.diagrams.ideal import ideal_motion as ideal_motion
from passiflex.diagrams.kinds import KINDS as KINDS
from passiflex.diagrams.kinds import panels as panels
from passiflex.diagrams.panel import Curve as Curve
from passiflex.diagrams.panel import Level as Level
from passiflex.diagrams.panel import Mark as Mark
from passiflex.diagrams.panel import Panel as Panel
from passiflex.diagrams.panel import Span as Span
from passiflex.diagrams.viewed import Viewed as Viewed
from passiflex.diagrams.viewed import roles_of as roles_of
from passiflex.diagrams.viewed import viewed as viewed
