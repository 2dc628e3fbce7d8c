"""PROFIBUS DP: telegrams of the line, slaves and masters as machines without clock and line (EN 50170 part 2)."""
