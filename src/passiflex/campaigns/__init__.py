"""Campaigns: many simulations of one scenario whose parameters are uncertain, each reproducible alone."""

from passiflex.campaigns.campaign import Campaign as Campaign
from passiflex.campaigns.campaign_file import load_campaign as load_campaign
from passiflex.campaigns.campaign_file import parse_campaign as parse_campaign
from passiflex.campaigns.draws import columns as columns
from passiflex.campaigns.draws import draws as draws
from passiflex.campaigns.evaluate import replay as replay
from passiflex.campaigns.possible import require_possible as require_possible
from passiflex.campaigns.run_campaign import Results as Results
from passiflex.campaigns.run_campaign import run_campaign as run_campaign
from passiflex.campaigns.samples import sample_scenario as sample_scenario
from passiflex.campaigns.samples import with_values as with_values
