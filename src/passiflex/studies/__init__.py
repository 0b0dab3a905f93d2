"""The paper's figures and their sensitivity."""

from passiflex.studies.paper import FIGURES as FIGURES
from passiflex.studies.paper import Case as Case
from passiflex.studies.paper import figure_cases as figure_cases
from passiflex.studies.paper import shipped_scenario as shipped_scenario
from passiflex.studies.summary import summarise as summarise
