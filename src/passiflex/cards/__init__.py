"""Cards: one page on which gains are safe for an arm at its rate, what limits them, and how that was found."""

from passiflex.cards.card import Card as Card
from passiflex.cards.card import card as card
