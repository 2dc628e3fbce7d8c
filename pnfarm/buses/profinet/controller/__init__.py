"""A PROFINET IO controller: sessions with devices over shared machines."""
