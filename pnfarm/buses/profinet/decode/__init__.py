"""PROFINET frames as text: the wire codecs parse the frames, the models name telegrams and parameters.

One file for each family of PDUs; :mod:`decoder` has their table.
"""
