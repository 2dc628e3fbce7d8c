"""PROFINET's frames in words: frames are read by the wire codecs, telegrams and parameters by the models.

One file for each family of PDUs; :mod:`decoder` is their table.
"""
