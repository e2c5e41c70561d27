"""Files as other programs write them, each with its right answer: what TEGA makes of them."""
