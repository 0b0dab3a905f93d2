"""Runs for other programs: tables, Rerun recordings, ROS 2 messages."""

from passiflex.exports.export import export_run as export_run
from passiflex.exports.export import formats as formats
from passiflex.exports.law_export import export_law as export_law
