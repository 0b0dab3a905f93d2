"""What there is to look at in a run: diagrams of its signals over time, with the events that explain them."""

from passiflex.views.events import marks_of as marks_of
from passiflex.views.events import spans_of as spans_of
from passiflex.views.ideal import ideal_motion as ideal_motion
from passiflex.views.kinds import KINDS as KINDS
from passiflex.views.kinds import panels as panels
from passiflex.views.panel import Curve as Curve
from passiflex.views.panel import Level as Level
from passiflex.views.panel import Mark as Mark
from passiflex.views.panel import Panel as Panel
from passiflex.views.panel import Span as Span
from passiflex.views.viewed import Viewed as Viewed
from passiflex.views.viewed import roles_of as roles_of
from passiflex.views.viewed import viewed as viewed
