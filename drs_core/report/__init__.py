"""The page that says what a tuning run has changed: gather, draw, film, write."""
