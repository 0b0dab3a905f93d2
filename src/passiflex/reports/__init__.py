"""A run as one HTML file: the moving arm beside its time series, and what they mean."""

from passiflex.reports.report import report_text as report_text
from passiflex.reports.report import show as show
from passiflex.reports.report import write_report as write_report
from passiflex.reports.screen import open_in_browser as open_in_browser
from passiflex.reports.viewer import ViewerError as ViewerError
