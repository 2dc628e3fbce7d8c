"""What a servo is: models as data, the parameters of one drive, PROFIdrive's access to them.

``model("akd-profinet")`` gives a :class:`Model`; ``ParameterStore(model, AxisHandle(axis_row, image_row))`` is one
drive's parameters; ``profiles.profidrive`` carries them over the wire.
"""
