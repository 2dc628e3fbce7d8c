"""What is in a capture, in words an engineer knows.

It stands in the room ``farm`` because it joins what protocols and drives know each for themselves: frames are read by
the wire codecs, telegrams and parameters by the models, names by the farm file.

:mod:`reading` a file's frames; :mod:`stations` who is who; one file for each family of PDUs (:mod:`dcp`, :mod:`calls`,
:mod:`cyclic`, :mod:`small`); :mod:`decoder` their table; :mod:`conversations` the summary.
"""
