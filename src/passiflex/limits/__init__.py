"""Which gains a robot bears at a rate and a delay: the limit map, and gains with a margin."""

from passiflex.limits.check import check as check
from passiflex.limits.confirmation import Confirmation as Confirmation
from passiflex.limits.limit_map import LimitMap as LimitMap
from passiflex.limits.limit_map import limit_map as limit_map
from passiflex.limits.recommend import recommend as recommend
from passiflex.limits.recommend_for import recommend_for as recommend_for
from passiflex.limits.recommendation import Recommendation as Recommendation
from passiflex.stability.admissible import Admissible as Admissible
