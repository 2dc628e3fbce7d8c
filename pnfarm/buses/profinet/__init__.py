"""PROFINET IO: everything that only this bus has."""
