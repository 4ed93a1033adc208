"""Expressions and values: text to trees (`parsing`), calculus and units on these, and numbers from them."""
